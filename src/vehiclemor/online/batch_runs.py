"""Batches of runs of a dynamic model, full or reduced: one compiled loop does all runs of a chunk.

Arguments of its loops are packed once; from run to run only words of them change.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.loops import Prepared, cache_lines, ready
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.online.batch_loops import Lifted, Recorded, Stage, Stages, Told, Wanted
from vehiclemor.online.batch_result import Found, Selection
from vehiclemor.online.batch_signals import Given, Signals, given_of
from vehiclemor.online.batch_stages import NO_STAGE, NOTHING, addresses, batch_loop, stage
from vehiclemor.online.watched_outputs import WatchedOutputs
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.checks import lifted_wheels, out_of_validity
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.input_polynomials import Extent, signal_of
from vehiclemor.simulation.integrators.structures import NODES
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.projection_windows import smooth_spans, whole_space
from vehiclemor.simulation.run_plans import Solver
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.spare_spaces import SpareSpaces
from vehiclemor.simulation.system import REASONS
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS, Start


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
    told
        Of the start and the inputs, see `lifting_loops.Known`.
    """

    state: np.ndarray
    full: np.ndarray
    excited: np.ndarray
    until: float
    told: tuple[float, ...] = ()


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
        self._watched = WatchedOutputs(self.model)
        self._columns = self._watched.columns(chosen.columns)
        self.windows = whole_space(len(self.system.error_scale))
        self.solver, self.tolerance = fitted.solver, fitted.tolerance

    def found(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of some runs, in their order, none of which is lost by another's failure."""
        alike: dict[Hashable, list[int]] = {(): [*range(len(signals))]}
        if not isinstance(signals, Signals):
            alike = _by([(signal.duration, signal.samples) for signal in signals])
        if len(alike) == 1:
            return self._recorded_alike(signals, starts)
        shape = len(self.chosen.samples(signals[0])[1]), len(self.chosen.columns)
        whole = Found.empty(len(signals), shape, len(DYNAMIC_COUNTS))
        for runs in alike.values():
            own = [signals[run] for run in runs], [starts[run] for run in runs]
            whole.write(runs, self._recorded_alike(*own))
        return whole

    def _recorded_alike(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of runs with the same output times."""
        first = signals.first if isinstance(signals, Signals) else signals[0]
        times, rows = self.chosen.samples(first)
        given, refused = self._given(signals, times)
        shape = len(rows), len(self.chosen.columns)
        found = Found.empty(len(signals), shape, len(DYNAMIC_COUNTS))
        found.refuse(refused)
        if given is None:
            return found
        runs = [run for run in range(len(signals)) if run not in refused]
        first = first if isinstance(signals, Signals) else signals[runs[0]]
        begins = [self._begin(starts[run], given.inputs[k, 0]) for k, run in enumerate(runs)]
        begins = self._driven(begins, given, signals, runs)
        kinds = _by([(begin.excited.shape[1], begin.until < first.duration) for begin in begins])
        for kind, numbers in kinds.items():
            of_kind = given if len(kinds) == 1 else given.part(numbers)
            key = first.duration, first.samples, *kind
            part = self._of_kind(key, first, of_kind, [begins[k] for k in numbers])
            if len(numbers) == len(signals):
                return part
            found.write([runs[k] for k in numbers], part)
        return found

    def _given(
        self, signals: Sequence[Maneuver], times: np.ndarray | None
    ) -> tuple[Given | None, dict[int, str]]:
        """Inputs of the runs that can be begun, if any, and why the others can't."""
        names = self.model.inputs
        if isinstance(signals, Signals):
            given = signals.given(names, times)
            outside = outside_of_bounds(self.model.definition, given.extent)
            refused = {run: refusal(signals[run], self.model) for run in outside}
            runs = [run for run in range(len(signals)) if run not in refused]
            if refused:
                given = given.part(runs) if runs else None
            return given, refused
        refused = {run: m for run, s in enumerate(signals) if (m := refusal(s, self.model))}
        complete = [s.for_inputs(names) for run, s in enumerate(signals) if run not in refused]
        return given_of(complete, times) if complete else None, refused

    def _begin(self, start: Start, inputs: np.ndarray) -> Begin:
        """Where a run from a start begins."""
        if self.reduced is None:
            return Begin(self.model.start(start), np.empty(0), NOTHING_EXCITED, 0.0)
        known = self.reduced.known(start, inputs)
        state = self.reduced.equations.begin(start, inputs)
        return Begin(state, known.state, known.excited, known.until, known.told)

    def _driven(
        self, begins: list[Begin], given: Given, signals: Sequence[Maneuver], runs: Sequence[int]
    ) -> list[Begin]:
        """The same with what is told of the inputs."""
        if self.reduced is None or not self.reduced.reach.inputs.size:
            return [begin._replace(told=(*begin.told, 0.0, np.inf)) for begin in begins]
        reach = self.reduced.reach
        used = (given.extent.largest / reach.inputs).max(axis=(1, 2)).tolist()
        since = [
            np.inf if size <= 1.0 else reach.driven(signals[run].for_inputs(self.model.inputs))[1]
            for size, run in zip(used, runs, strict=True)
        ]
        return [
            begin._replace(told=(*begin.told, *driven))
            for begin, *driven in zip(begins, used, since, strict=True)
        ]

    def _of_kind(
        self, kind: Hashable, signal: Maneuver, given: Given, begins: Sequence[Begin]
    ) -> Found:
        """Results of runs that are recorded alike and excite as many modes.

        Parameters
        ----------
        signal
            One with their output times.
        """
        whole = signal.for_inputs(self.model.inputs)
        space = self._spare.taken(kind, lambda: self._space(whole, begins[0], given.inputs[0]))
        starts = np.stack([begin.state for begin in begins])
        full = np.stack([begin.full for begin in begins])
        excited = np.stack([begin.excited for begin in begins])
        of_start = np.array([begin.told for begin in begins])
        until = np.array([begin.until for begin in begins])
        # Ends of segments -> spans between them.
        ends = {edges.tobytes(): edges for edges in given.edges}
        cut = {
            key: ready(smooth_spans(edges, self.windows.edges, float(space.times[-1])))
            for key, edges in ends.items()
        }
        words = b"".join([cut[edges.tobytes()].words for edges in given.edges])
        spans = np.frombuffer(words, dtype=np.int64).reshape(len(begins), -1)
        call, of_inputs = space.integrate, addresses(given.inputs)
        signal_at, spans_at = call.address("signal.edges"), call.address("spans.edges")
        places = [
            call.address("start"),
            call.address("output.given"),
            call.address("output.direct_until"),
            *range(signal_at, signal_at + given.words.shape[1]),
            *range(spans_at, spans_at + spans.shape[1]),
        ]
        columns = addresses(starts), of_inputs, until.view(np.int64), given.words, spans
        told = self._told(len(begins), len(space.wanted.samples))
        loop = batch_loop("many_runs").prepared(
            Stages(
                stage(call, places, columns),
                *self._lifting_stages(space, of_inputs, excited, of_start),
            ),
            space.recorded,
            space.lifted,
            given.inputs,
            full if full.shape[1] else np.empty((0, 0)),
            space.wanted,
            told,
        )
        _, seconds = timed(loop)
        self._spare.give_back(kind, space)
        return self._judged(told, given.remarks, space.times, seconds / len(begins))

    def _lifting_stages(
        self, space: Space, of_inputs: np.ndarray, excited: np.ndarray, of_start: np.ndarray
    ) -> tuple[Stage, Stage]:
        """Decay and lifting of runs; the first of them reads the inputs."""
        stages = []
        for k, (call, rows) in enumerate(space.stages):
            places, columns = [], []
            if not k and space.direct:
                places, columns = [call.address("inputs")], [of_inputs]
            if not k and len(space.stages) == 2:
                places += [call.address("rates"), call.address("amplitudes")]
                rates = addresses(excited)
                columns += [rates, rates + excited[0, 0].nbytes]
            if k == len(space.stages) - 1:
                places += [call.address("known.start")]
                columns += [addresses(of_start)]
            stages.append(stage(call, places, columns, rows, len(of_inputs)))
        return (NO_STAGE, *stages)[-2:] if stages else (NO_STAGE, NO_STAGE)  # type: ignore[return-value]

    def _space(self, signal: Maneuver, begin: Begin, inputs: np.ndarray) -> Space:
        """Space for runs over signals with the same output times."""
        times, rows = self.chosen.samples(signal)
        how = Solver(self.solver, self.tolerance, times)
        loop, arguments = self.system.prepared(signal, begin.state, self.windows, how, begin.until)
        output = arguments.output
        direct = not len(output.places)
        moments = output.samples if direct else output.moments
        recorded = Recorded(output.counts, output.path, moments, output.places, arguments.buffer)
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
        wanted = self._wanted(rows, lifted.states, inputs.shape[1])
        call = loop.prepared(*arguments)
        return Space(call, stages, recorded, lifted, wanted, output.samples, direct)

    def _wanted(self, rows: np.ndarray, states: np.ndarray, inputs: int) -> Wanted:
        """What is delivered of runs with these states, and room for it."""
        samples, lanes = len(states), LANES if len(states) >= LANES else 1
        observer = self.model.observer(lanes).bundle
        width = -(-(observer.states + len(self.model.outputs)) // LANES) * LANES
        watch, kept = NOTHING, 0
        made = bool((self._columns >= observer.states).any())
        if len(rows) < samples or not made:
            watch = self._watched.kernel(lanes)
            kept = made * (min(len(rows) * NODES, samples) + LANES)
        points, chosen = (cache_lines(size, width)[0].reshape(-1) for size in (samples + 1, kept))
        # What is watched are few of the columns.
        points.fill(0.0)
        return Wanted(
            rows,
            self._columns,
            observer,
            len(self.model.limits[0]),
            watch,
            width,
            points,
            chosen,
            np.empty((kept, observer.states)),
            np.empty((kept, inputs)),
        )

    def _told(self, runs: int, times: int) -> Told:
        watched = self.reduced.lift.told if self.reduced else 0
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
        self, told: Told, remarks: Sequence[str], times: np.ndarray, seconds: float
    ) -> Found:
        """What is told, in words, as of single runs."""
        definition, names = self.model.definition, self.model.limits[0]
        runs, samples = len(told.ends), len(times)
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
                message = out_of_validity(definition, name, told.value[run], times.item(end))
            if message:
                found.status[run], found.message[run] = "diverged", message
            trust = None
            if self.reduced is not None:
                trust = self.reduced.lift.trust(largest[run], firsts[run], moments[run][1])
            if trust is not None:
                found.indicator[run], found.reason[run] = trust.indicator, trust.reason
                if trust.reason and not message:
                    found.status[run], found.message[run] = "untrusted", trust.message
        found.until[:] = until
        for run in np.flatnonzero((told.outside[:, len(names) :] < samples).any(axis=1)).tolist():
            first = told.outside[run, len(names) :].tolist()
            found.remark[run] = lifted_wheels(definition.loads, first, times)
        for run, remark in enumerate(remarks):
            if remark:
                found.remark[run] = "; ".join(part for part in (found.remark[run], remark) if part)
        return found


def _by(keys: Sequence[Hashable]) -> dict[Any, list[int]]:
    """Numbers of equal keys."""
    found: dict[Any, list[int]] = {}
    for k, key in enumerate(keys):
        found.setdefault(key, []).append(k)
    return found


def outside_of_bounds(definition: ModelDefinition, extent: Extent) -> list[int]:
    """Runs whose inputs leave the bounds that a model declares."""
    outside = np.zeros(len(extent.low), dtype=bool)
    for column, quantity in enumerate(definition.inputs):
        if quantity.name in definition.validity:
            low, high = definition.validity[quantity.name]
            outside |= (extent.low[:, column] < low) | (extent.high[:, column] > high)
    return np.flatnonzero(outside).tolist()


def refusal(signal: Maneuver, model: DynamicModel) -> str:
    """Why a maneuver can't be run, empty if it can."""
    try:
        signal_of(checked_maneuver(signal, model.definition))
    except InputError as error:
        return str(error)
    return ""
