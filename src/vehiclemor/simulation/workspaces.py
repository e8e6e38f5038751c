"""Workspaces: the arrays of one run at a time, packed once with the compiled loop that uses them.

Packing takes as long as a short run, so a workspace that a run has left serves the next one of its
kind.  It belongs to one run at a time, in whichever thread: lists are popped and appended at once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from vehiclemor.codegen.loops import Prepared, Ready
from vehiclemor.codegen.operations import LANES
from vehiclemor.simulation.control_periods import ControlPeriods
from vehiclemor.simulation.loop_arguments import Memory, Output

Item = TypeVar("Item")
# Kinds of runs whose workspaces are cached.
MOST_KINDS = 64


class Pool(Generic[Item]):
    """What no run holds at present, by what all runs of a kind share."""

    def __init__(self) -> None:
        self._spare: dict[Hashable, list[Item]] = defaultdict(list)

    def taken(self, kind: Hashable, make: Callable[[], Item]) -> Item:
        """One of that kind, a new one if none is left."""
        try:
            return self._spare[kind].pop()
        except IndexError:
            return make()

    def give_back(self, kind: Hashable, held: Item) -> None:
        """Leave it to the next run."""
        if len(self._spare) > MOST_KINDS:
            self._spare.clear()
        self._spare[kind].append(held)


class Solver(NamedTuple):
    """How a run is integrated: one of `catalogue.INTEGRATORS`, and as `DynamicModel.simulate`."""

    name: str
    tolerance: float
    times: np.ndarray | None = None
    longest_step: float | None = None
    begin: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether it runs over a whole maneuver, at its output times."""
        return self.times is None and not self.begin


@dataclass(eq=False, slots=True)
class Workspace:
    """Arrays of one run at a time and, packed once, the loop that uses them.

    The call is the time loop with its arguments, of which memory and output stay the same.  The
    windows stay alive with the workspace, which is cached by their identity.  The signal is that of
    the last run.  Other loops that read these arrays are cached by name.
    """

    call: Prepared
    memory: Memory
    output: Output
    windows: ControlPeriods
    signal: Ready
    cached_loops: dict[str, Any] = field(default_factory=dict)

    def take(self, signal: Ready, spans: Ready, inputs: np.ndarray) -> None:
        """Have the next run driven by another maneuver of the same output times."""
        self.call.give("signal", signal)
        self.call.give("spans", spans)
        self.signal = signal
        self.output.sample_inputs[:] = inputs


@dataclass(eq=False, slots=True)
class Run:
    """What a compiled run leaves behind."""

    output: Output
    seconds: float  # Time in the compiled loop.
    failure: str  # Why it has ended early.
    # Loops that read its arrays, by name; called once nothing reads these any more.
    cached_loops: dict[str, Any] = field(default_factory=dict)
    give_back: Callable[[], None] = lambda: None
    rows: int = field(init=False)  # How many rows are recorded.

    def __post_init__(self) -> None:
        """Count the rows that are recorded."""
        self.rows = len(self.output.states)
        if len(self.output.point_of_sample):
            # Kernels take so many at once.
            self.rows = max(int(self.output.rows[0]), LANES)

    @property
    def path(self) -> np.ndarray:
        """States (samples, dim) at the output times, or at points, see `loop_arguments.Output`."""
        return self.output.states[: self.rows]

    @property
    def inputs(self) -> np.ndarray:
        """Inputs of its rows, or of more; their address stays the same in a workspace."""
        output = self.output
        return output.point_inputs if len(output.point_of_sample) else output.sample_inputs
