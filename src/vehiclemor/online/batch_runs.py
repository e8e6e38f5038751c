"""Batches of runs of a dynamic model, full or reduced: one compiled loop does all runs of a chunk.

Arguments of its loops are packed once; from run to run only words of them change.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loops import Prepared, address_of_array, cache_lines, loops
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_loops import Lifted, Recorded, Stage, Told, Wanted
from vehiclemor.online.batch_result import Found, Selection
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.checks import check_inputs, cut_short, lifted_wheels, out_of_validity
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.input_polynomials import recorded_inputs, signal_of
from vehiclemor.simulation.paths import PATH_LOOPS
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.run_plans import Solver
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.spare_spaces import SpareSpaces
from vehiclemor.simulation.system import REASONS
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS, Start

NOTHING = np.zeros(0, dtype=np.int64)
NO_STAGE = Stage(NOTHING, NOTHING, NOTHING, NOTHING.reshape(0, 0), NOTHING)
WORD = 8


class Begin(NamedTuple):
    """Where a run begins.

    Attributes
    ----------
    state
        State of the system that is integrated.
    full
        Full state, where it is known better than what is lifted; else empty.
    excited
        What the start excites, see `Lifting.excited`.
    until
        Time (s) up to which points are samples, see `structures.Output`.
    """

    state: np.ndarray
    full: np.ndarray
    excited: np.ndarray
    until: float


NOTHING_EXCITED = np.zeros((2, 0, 2))


class Space(NamedTuple):
    """Arrays of one chunk of runs at a time, and the stages that write them.

    Attributes
    ----------
    integrate
        The time loop.
    stages
        Decay and lifting, each with the words that are a number of rows; none of a full model.
    times
        Output times (samples,) in s.
    rows
        Samples that are kept.
    """

    integrate: Prepared
    stages: tuple[tuple[Prepared, tuple[int, ...]], ...]
    recorded: Recorded
    lifted: Lifted
    wanted: Wanted
    times: np.ndarray
    direct: bool


class BatchRuns:
    """Runs of one model of which some quantities are kept.

    Parameters
    ----------
    fitted
        Full-order model, or reduced vehicle.
    """

    def __init__(self, fitted: FullOrderModel | ReducedVehicle, chosen: Selection) -> None:
        assert isinstance(fitted.model, DynamicModel)
        self.model: DynamicModel = fitted.model
        self.chosen, self._spare = chosen, SpareSpaces[Space]()
        self.reduced = fitted if isinstance(fitted, ReducedVehicle) else None
        self.system = self.reduced.system if self.reduced else self.model.system
        self.windows = whole_space(len(self.system.error_scale))
        self.solver, self.tolerance = fitted.solver, fitted.tolerance

    def found(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of some runs, in their order; they have as many output times."""
        kinds: dict[Hashable, list[int]] = {}
        begins, given = [], []
        for run, (signal, start) in enumerate(zip(signals, starts, strict=True)):
            check_inputs(signal, self.model.definition)
            times, _ = self.chosen.samples(signal)
            inputs = recorded_inputs(signal)[1] if times is None else signal.at(times)
            begin = self._begin(start, inputs[0])
            begins.append(begin)
            given.append(inputs)
            recorded = signal.duration, signal.samples, len(begin.excited[0])
            kinds.setdefault((*recorded, begin.until < signal.duration), []).append(run)
        shape = len(self.chosen.samples(signals[0])[1]), len(self.chosen.columns)
        whole = Found.empty(len(signals), shape, len(DYNAMIC_COUNTS))
        for kind, runs in kinds.items():
            parts = [[of[run] for run in runs] for of in (signals, begins, given)]
            found = self._of_kind(kind, *parts)
            if len(kinds) == 1:
                return found
            whole.write(runs, found)
        return whole

    def _begin(self, start: Start, inputs: np.ndarray) -> Begin:
        """Where a run from a start begins."""
        if self.reduced is None:
            return Begin(self.model.start(start), np.empty(0), NOTHING_EXCITED, 0.0)
        known = self.reduced.known(start)
        state = self.reduced.equations.begin(start, inputs)
        return Begin(state, known.state, known.excited, known.until)

    def _of_kind(
        self,
        kind: Hashable,
        signals: Sequence[Maneuver],
        begins: Sequence[Begin],
        given: Sequence[np.ndarray],
    ) -> Found:
        """Results of runs that are recorded alike."""
        space = self._spare.taken(kind, lambda: self._space(signals[0], begins[0], given[0]))
        runs, samples = len(signals), len(space.times)
        inputs = np.stack(given)
        starts = np.stack([begin.state for begin in begins])
        full = np.stack([begin.full for begin in begins])
        full = full if full.shape[1] else np.empty((0, 0))
        until = np.array([begin.until for begin in begins])
        excited = np.stack([begin.excited for begin in begins])
        held = [signal_of(signal) for signal in signals]
        end = float(space.times[-1])
        spans = [self.windows.spans(signal.bundle.edges, end) for signal in held]
        words = b"".join([s.words + p.words for s, p in zip(held, spans, strict=True)])
        table = np.frombuffer(words, dtype=np.int64).reshape(runs, -1)
        integrate, of_inputs = space.integrate, _addresses(inputs)
        places = [
            integrate.address("start"),
            integrate.address("output.given"),
            integrate.address("output.direct_until"),
            *range(first := integrate.address("signal.edges"), first + len(held[0].words) // WORD),
            *range(first := integrate.address("spans.edges"), first + len(spans[0].words) // WORD),
        ]
        columns = _addresses(starts), of_inputs, until.view(np.int64), table
        integration = _stage(integrate, places, columns)
        decay, lifting = self._lifting_stages(space, of_inputs, excited)
        told = self._told(runs, len(space.wanted.samples))
        loop = _loop().prepared(
            integration,
            decay,
            lifting,
            space.recorded,
            space.lifted,
            inputs,
            full,
            space.wanted,
            len(self.model.limits[0]),
            told,
        )
        _, seconds = timed(loop)
        self._spare.give_back(kind, space)
        return self._judged(told, signals, space.times, seconds / runs)

    def _lifting_stages(
        self, space: Space, of_inputs: np.ndarray, excited: np.ndarray
    ) -> tuple[Stage, Stage]:
        """Decay and lifting of runs; the first of them reads the inputs."""
        stages = []
        for k, (call, rows) in enumerate(space.stages):
            places, columns = [], []
            if not k and space.direct:
                places, columns = [call.address("inputs")], [of_inputs]
            if not k and len(space.stages) == 2:
                places += [call.address("rates"), call.address("amplitudes")]
                rates = _addresses(excited)
                columns += [rates, rates + excited[0, 0].nbytes]
            stages.append(_stage(call, places, columns, rows, len(of_inputs)))
        return (NO_STAGE, *stages)[-2:] if stages else (NO_STAGE, NO_STAGE)  # type: ignore[return-value]

    def _space(self, signal: Maneuver, begin: Begin, inputs: np.ndarray) -> Space:
        """Space for runs over signals with the same output times."""
        times, rows = self.chosen.samples(signal)
        how = Solver(self.solver, self.tolerance, times)
        loop, arguments = self.system.prepared(
            signal, begin.state, self.windows, how, begin.until
        )
        output = arguments.output
        direct = not len(output.places)
        moments = output.samples if direct else output.moments
        recorded = Recorded(
            output.counts, output.path, moments, output.places, arguments.buffer
        )
        points = np.empty((0, 0)) if direct else output.inputs
        lifted, stages = Lifted(output.path, points, np.empty(0), NOTHING), ()
        if self.reduced is not None:
            of_lift = self.reduced.lift.space(
                (moments, output.path, inputs if direct else output.inputs),
                begin.excited,
                len(output.samples),
            )
            stages = of_lift.calls
            lifted = Lifted(of_lift.states, points, of_lift.largest, of_lift.first)
        observer = self.model.observer(LANES if len(output.samples) >= LANES else 1).bundle
        width = -(-(observer.states + len(self.model.outputs)) // LANES) * LANES
        scratch = cache_lines(len(output.samples) + 1, width)[0].reshape(-1)
        wanted = Wanted(rows, self.chosen.columns, observer, width, scratch)
        call = loop.prepared(*arguments)
        return Space(call, stages, recorded, lifted, wanted, output.samples, direct)

    def _told(self, runs: int, times: int) -> Told:
        watched = len(self.reduced.lift.features.watched) if self.reduced else 0
        limits = len(self.model.limits[1])

        def integers(columns: int) -> np.ndarray:
            return np.empty((runs, columns), dtype=np.int64)

        return Told(
            integers(3),
            np.empty((runs, 2)),
            integers(len(DYNAMIC_COUNTS)),
            np.empty((runs, watched)),
            integers(watched),
            integers(limits),
            np.empty(runs),
            np.empty((runs, times, len(self.chosen.columns))),
        )

    def _judged(
        self, told: Told, signals: Sequence[Maneuver], times: np.ndarray, seconds: float
    ) -> Found:
        """What is told, in words, as of single runs."""
        definition, names = self.model.definition, self.model.limits[0]
        runs, samples = len(signals), len(times)
        found = Found.empty(runs, (0, 0), 0)._replace(
            values=told.result, counts=told.counts, seconds=np.full(runs, seconds)
        )
        ends, moments, until = told.ends.tolist(), told.moments.tolist(), told.moments[:, 1]
        firsts, largest = told.first.tolist(), told.largest.tolist()
        for run, (status, _, end) in enumerate(ends):
            message = ""
            if status:
                message = f"{REASONS[status]} at t = {moments[run][0]:.6g} s"
            elif end < samples:
                name = names[told.outside[run, : len(names)].tolist().index(end)]
                message = out_of_validity(definition, name, told.value[run], times[end])
            if message:
                found.status[run], found.message[run] = "diverged", message
            trust = None
            if self.reduced is not None:
                trust = self.reduced.lift.trust(largest[run], firsts[run], moments[run][1])
            if trust is not None:
                found.indicator[run] = trust.indicator
                if trust.reason and not message:
                    found.status[run], found.message[run] = "untrusted", trust.message
        found.until[:] = until
        for run in np.flatnonzero((told.outside[:, len(names) :] < samples).any(axis=1)).tolist():
            first = told.outside[run, len(names) :].tolist()
            found.remark[run] = lifted_wheels(definition.loads, first, times)
        for run, signal in enumerate(signals):
            if remark := cut_short(signal):
                found.remark[run] = "; ".join(part for part in (found.remark[run], remark) if part)
        return found


def _addresses(arrays: np.ndarray) -> np.ndarray:
    """Addresses (runs,) of the parts of an array along its first dimension."""
    return address_of_array(arrays) + np.arange(len(arrays)) * arrays[0].nbytes


def _stage(
    call: Prepared,
    places: Sequence[int],
    columns: Sequence[np.ndarray],
    rows: Sequence[int] = (),
    runs: int = 0,
) -> Stage:
    """A stage whose words at some places change from run to run."""
    by_run = np.column_stack(columns) if len(columns) else np.empty((runs, 0), dtype=np.int64)
    return Stage(
        np.array([call.entry], dtype=np.int64),
        np.frombuffer(call.words, dtype=np.int64),
        np.array(places, dtype=np.int64),
        np.ascontiguousarray(by_run),
        np.array(rows, dtype=np.int64),
    )


def _loop():
    return loops((*PATH_LOOPS, "online.batch_loops"), ("many_runs",))["many_runs"]
