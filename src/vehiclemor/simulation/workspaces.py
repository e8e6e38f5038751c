"""Workspaces: the arrays of one run at a time, packed once with the compiled loop that uses them.

Packing takes as long as a short run, so a workspace that a run has left serves the next one of its
kind.  It belongs to one run at a time, in whichever thread: lists are popped and appended at once.
"""

from __future__ import annotations

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
ALL_SAMPLES = np.empty((0, 2))


class Pool(Generic[Item]):
    """What no run holds at present, by what all runs of a kind share."""

    def __init__(self) -> None:
        self._spare: dict[Hashable, list[Item]] = {}

    def taken(self, kind: Hashable, make: Callable[[], Item]) -> Item:
        """One of that kind, a new one if none is left."""
        try:
            return self._spare[kind].pop()
        except (KeyError, IndexError):
            return make()

    def give_back(self, kind: Hashable, held: Item) -> None:
        """Leave it to the next run."""
        spare = self._spare.get(kind)
        if spare is None:
            if len(self._spare) >= MOST_KINDS:
                self._spare.clear()
            spare = self._spare.setdefault(kind, [])
        spare.append(held)


class Solver(NamedTuple):
    """How a run is integrated: one of `catalogue.INTEGRATORS`, and as `DynamicModel.simulate`."""

    name: str
    tolerance: float
    times: np.ndarray | None = None
    longest_step: float | None = None
    begin: float = 0.0


class RunInputs(NamedTuple):
    """What of a maneuver goes into a run: signal, parts of the run, inputs at the output times."""

    signal: Ready
    spans: Ready
    inputs: np.ndarray


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

    def take(self, drive: RunInputs) -> None:
        """Have the next run driven by another maneuver of the same output times."""
        self.call.give("signal", drive.signal)
        self.call.give("spans", drive.spans)
        self.signal = drive.signal
        self.output.sample_inputs[:] = drive.inputs


@dataclass(eq=False, slots=True)
class Run:
    """What a compiled run leaves behind."""

    times: np.ndarray  # Output times (samples,) in s.
    recorded_states: np.ndarray  # States (rows or more, dim), NaN from a failure on.
    # Numbers in the order of `DYNAMIC_COUNTS`; time in the compiled loop; why it has ended early.
    counts: np.ndarray
    seconds: float
    failure: str
    # Where its arrays are from; called with it once nothing reads them any more.
    space: Workspace | None = None
    left: Callable[[Workspace], None] | None = None
    rows: int = field(init=False)  # How many rows are recorded.

    def __post_init__(self) -> None:
        """Count the rows that are recorded."""
        self.rows = len(self.recorded_states)
        if self.space is not None and len(self.point_of_sample):
            # Kernels take so many at once.
            self.rows = max(int(self.space.output.rows[0]), LANES)

    @property
    def path(self) -> np.ndarray:
        """States (samples, dim) at the output times, or at points, see `loop_arguments.Output`."""
        return self.recorded_states[: self.rows]

    @property
    def point_of_sample(self) -> np.ndarray:
        """See `loop_arguments.Output` (samples, 2); empty (0, 2) if the samples are the points."""
        return ALL_SAMPLES if self.space is None else self.space.output.point_of_sample

    def recorded_at(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times (s) and inputs of its rows, or of more; those at the samples are given.

        In a workspace that serves further runs their addresses stay the same.
        """
        if self.space is None or self.left is None:
            return self.times, inputs
        output = self.space.output
        if len(self.point_of_sample):
            return output.point_times, output.point_inputs
        return self.times, output.sample_inputs

    @property
    def cached_loops(self) -> dict[str, Any]:
        """Loops that read the arrays of its workspace, by name."""
        return {} if self.space is None else self.space.cached_loops

    def give_back(self) -> None:
        """Leave its arrays to the next run: nothing may read them any more."""
        if self.left is not None and self.space is not None:
            self.left(self.space)
            self.space = self.left = None
