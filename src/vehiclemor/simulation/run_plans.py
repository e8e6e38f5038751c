"""Plans of runs: what those over the same maneuver share, and the space that one of them takes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.loops import Loop, Ready
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.structures import NODES, Output
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS

NO_BUNDLE = Ready(None, b"")
# Of a run that is recorded at the samples: no inputs, points and places.
NO_POINTS = np.empty((0, 0)), np.empty((0, 0)), np.empty(0), np.empty((0, 2))


class Points(NamedTuple):
    """Points at which a run is recorded, see `structures.Output`.

    Attributes
    ----------
    inputs, moments
        Inputs (points, inputs) at the points, and their times (points,) in s.
    places
        How the samples follow from them (samples, 2).
    """

    inputs: np.ndarray
    moments: np.ndarray
    places: np.ndarray


class Solver(NamedTuple):
    """How a run is integrated.

    Attributes
    ----------
    name
        One of `catalogue.INTEGRATORS`.
    tolerance
        Largest local error of a state relative to its scale plus its own size.
    times
        Output times (samples,) in s, the maneuver's by default.
    longest_step
        In s; unlimited by default.
    begin
        Time in s at which the run begins with its state, in mid-maneuver if it isn't 0.
    """

    name: str
    tolerance: float
    times: np.ndarray | None = None
    longest_step: float | None = None
    begin: float = 0.0


class RunArguments(NamedTuple):
    """Arguments of the compiled time loop, see `integrators/loop.integrate`."""

    start: np.ndarray
    equations: Ready
    signal: Ready
    spans: Ready
    subspaces: Ready
    method: Ready
    control: Ready
    output: Output
    buffer: np.ndarray
    integers: np.ndarray


class Drive(NamedTuple):
    """What of a maneuver goes into a run.

    Attributes
    ----------
    signal, spans
        Piecewise polynomials, and the parts of the run.
    inputs
        At the output times (samples, inputs).
    """

    signal: Ready
    spans: Ready
    inputs: np.ndarray


class Space:
    """Arrays of one run at a time and, packed once, the loop that writes them.

    Attributes
    ----------
    arguments
        Of the loop; those of a maneuver may have been replaced.
    call
        The loop with these.
    signal
        Of the last run.
    given
        Inputs at the samples (samples, inputs); none if its plan is not kept.
    kept
        What other loops have made of the run; their spaces last as long.
    """

    __slots__ = ("arguments", "call", "given", "kept", "signal")

    def __init__(self, plan: Plan, drive: Drive) -> None:
        self.arguments, self.given = plan.fresh(drive)
        self.call, self.signal = plan.loop.prepared(*self.arguments), drive.signal
        self.kept: dict[str, Any] = {}

    def take(self, drive: Drive) -> None:
        """Have the next run driven by another maneuver of the same output times."""
        self.call.give("signal", drive.signal)
        self.call.give("spans", drive.spans)
        self.signal = drive.signal
        if self.given is not None:
            self.given[:] = drive.inputs


class Plan(NamedTuple):
    """What runs of a system over the same output times share.

    Attributes
    ----------
    arguments
        Those that are not shared are empty.
    sizes
        Numbers of states, of floats of scratch space and of integers.
    whole
        Whether it is over whole maneuvers, and kept.
    points
        Whether its runs are recorded at points.
    windows
        Kept alive: a plan is found by the object.
    spare
        Spaces that no run holds.
    """

    loop: Loop
    arguments: RunArguments
    sizes: tuple[int, int, int]
    whole: bool
    points: bool
    windows: ProjectionWindows
    spare: list[Space]

    def fresh(self, drive: Drive) -> tuple[RunArguments, np.ndarray | None]:
        """Arguments with arrays of their own, the start still to be written; inputs of a space."""
        (n, floats, integers), output = self.sizes, self.arguments.output
        size, given = len(output.samples), drive.inputs.copy() if self.whole else None
        counts = np.empty(len(DYNAMIC_COUNTS), dtype=np.int64)
        output = output._replace(path=np.empty((size, n)), counts=counts)
        if self.points and given is not None:
            moments, places = np.empty(size), np.empty((size, 2))
            output = output._replace(
                given=given, inputs=np.empty(given.shape), moments=moments, places=places
            )
        arguments = self.arguments._replace(
            start=np.empty(n),
            signal=drive.signal,
            spans=drive.spans,
            output=output,
            buffer=np.empty(floats),
            integers=np.empty(integers, dtype=np.int64),
        )
        return arguments, given

    def spare_space(self) -> Space | None:
        """A space that no other run holds, in whichever thread; none if there is none left."""
        try:
            return self.spare.pop()
        except IndexError:
            return None


class Run:
    """What a compiled run leaves behind.

    Attributes
    ----------
    times
        Output times (samples,) in s.
    whole
        States where it is recorded (rows or more, dim), NaN from a failure on.
    rows
        How many of its rows tell something.
    counts
        Numbers in the order of `DYNAMIC_COUNTS`.
    seconds
        Time spent in the compiled loop.
    failure
        Why the run has ended early, empty if it has not.
    plan, space
        Where its arrays are from; none of a path that is given.
    """

    __slots__ = ("counts", "failure", "plan", "rows", "seconds", "space", "times", "whole")

    def __init__(
        self,
        times: np.ndarray,
        whole: np.ndarray,
        counts: np.ndarray,
        seconds: float,
        failure: str,
        held: tuple[Plan, Space] | None = None,
    ) -> None:
        self.times, self.whole, self.rows, self.counts = times, whole, len(whole), counts
        self.seconds, self.failure = seconds, failure
        self.plan, self.space = held or (None, None)
        places = self.places
        if len(places):
            reached = int(places[:, 0].argmax()) if failure else -1
            row, part = places[reached].tolist()
            # Kernels take so many at once.
            self.rows = max(int(row) + (1 if part < 0.0 else NODES), LANES)

    @property
    def path(self) -> np.ndarray:
        """States (samples, dim) at the output times, or at `points`."""
        return self.whole[: self.rows]

    @property
    def places(self) -> np.ndarray:
        """How the samples follow from points (samples, 2); empty (0, 2) if they are these."""
        return NO_POINTS[-1] if self.space is None else self.space.arguments.output.places

    @property
    def points(self) -> Points | None:
        """Where it is recorded, if not at the output times."""
        if not len(self.places):
            return None
        moments, inputs = self.recorded_at(self.whole)
        return Points(inputs[: self.rows], moments[: self.rows], self.places)

    def recorded_at(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times (s) and inputs of its rows, or of more; those at the samples are given.

        Of a space that is used again they always stand in the same place.
        """
        if self.space is None:
            return self.times, inputs
        if not len(self.places):
            own = self.space.given
            return self.times, inputs if own is None else own
        output = self.space.arguments.output
        return output.moments, output.inputs

    @property
    def kept(self) -> dict[str, Any]:
        """What other loops have made of it."""
        return {} if self.space is None else self.space.kept

    def give_back(self) -> None:
        """Leave its arrays to the next run: nothing may read them any more."""
        if self.plan is not None and self.space is not None:
            self.plan.spare.append(self.space)
            self.plan = self.space = None
