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
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.control_periods import ControlPeriods
from vehiclemor.simulation.loop_arguments import Output

Kept = TypeVar("Kept")
# Kinds of runs whose workspaces are kept.
MOST_KINDS = 64
ALL_SAMPLES = np.empty((0, 2))


class Pool(Generic[Kept]):
    """What no run holds at present, by what all runs of a kind share."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, list[Kept]] = {}

    def taken(self, kind: Hashable, make: Callable[[], Kept]) -> Kept:
        """One of that kind, made if none is left."""
        try:
            return self._kept[kind].pop()
        except (KeyError, IndexError):
            return make()

    def give_back(self, kind: Hashable, held: Kept) -> None:
        """Leave it to the next run."""
        spare = self._kept.get(kind)
        if spare is None:
            if len(self._kept) >= MOST_KINDS:
                self._kept.clear()
            spare = self._kept.setdefault(kind, [])
        spare.append(held)


class Solver(NamedTuple):
    """How a run is integrated: one of `catalogue.INTEGRATORS`, and as `DynamicModel.simulate`."""

    name: str
    tolerance: float
    times: np.ndarray | None = None
    longest_step: float | None = None
    begin: float = 0.0


class DrivenBy(NamedTuple):
    """What of a maneuver goes into a run: signal, parts of the run, inputs at the output times."""

    signal: Ready
    spans: Ready
    inputs: np.ndarray


@dataclass(eq=False, slots=True)
class Workspace:
    """Arrays of one run at a time and, packed once, the loop that uses them.

    The call is the time loop with its arguments, the start where a run begins (n,); output and
    buffer are as of `integrators/loop.integrate`.  Windows are kept alive: a workspace is found by
    the object.  The signal is that of the last run.  Kept is what other loops have made of the run;
    their arrays last as long.
    """

    call: Prepared
    start: np.ndarray
    output: Output
    buffer: np.ndarray
    windows: ControlPeriods
    signal: Ready
    kept: dict[str, Any] = field(default_factory=dict)

    def take(self, drive: DrivenBy) -> None:
        """Have the next run driven by another maneuver of the same output times."""
        self.call.give("signal", drive.signal)
        self.call.give("spans", drive.spans)
        self.signal = drive.signal
        self.output.sample_inputs[:] = drive.inputs


@dataclass(eq=False, slots=True)
class Run:
    """What a compiled run leaves behind."""

    times: np.ndarray  # Output times (samples,) in s.
    whole: np.ndarray  # States where it is recorded (rows or more, dim), NaN from a failure on.
    # Numbers in the order of `DYNAMIC_COUNTS`; time in the compiled loop; why it has ended early.
    counts: np.ndarray
    seconds: float
    failure: str
    # Where its arrays are from; called with it once nothing reads them any more.
    space: Workspace | None = None
    left: Callable[[Workspace], None] | None = None
    rows: int = field(init=False)  # How many of its rows tell something.

    def __post_init__(self) -> None:
        """Find how far it is recorded."""
        self.rows = len(self.whole)
        if self.space is not None and len(self.places):
            # Kernels take so many at once.
            self.rows = max(int(self.space.output.rows[0]), LANES)

    @property
    def path(self) -> np.ndarray:
        """States (samples, dim) at the output times, or at points, see `loop_arguments.Output`."""
        return self.whole[: self.rows]

    @property
    def places(self) -> np.ndarray:
        """How the samples follow from points (samples, 2); empty (0, 2) if they are these."""
        return ALL_SAMPLES if self.space is None else self.space.output.point_of_sample

    def recorded_at(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times (s) and inputs of its rows, or of more; those at the samples are given.

        Of a workspace that is used again they always stand in the same place.
        """
        if self.space is None or self.left is None:
            return self.times, inputs
        output = self.space.output
        if len(self.places):
            return output.point_times, output.point_inputs
        return self.times, output.sample_inputs

    @property
    def kept(self) -> dict[str, Any]:
        """What other loops have made of it."""
        return {} if self.space is None else self.space.kept

    def give_back(self) -> None:
        """Leave its arrays to the next run: nothing may read them any more."""
        if self.left is not None and self.space is not None:
            self.left(self.space)
            self.space = self.left = None
