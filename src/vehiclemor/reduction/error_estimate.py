"""How far a reduced run is from that of the full model, estimated after the run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.quantities import ErrorBound
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.checks import check_positive
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import WITHOUT_COMPLAINT, Start, Trajectory, Trust

# Of looks: time in s between nodes, at last a twentieth of the period of wheel hop; the most
# passes, and how far corrections are settled.  The last one is that which finds a small error by
# settled corrections, or one that has changed little since the look before, beside the room that it
# leaves to the bounds.
FINER = 15, 1e-5
LOOKS = (0.04, (12, 3e-4)), (0.02, FINER), (0.01, FINER), (0.005, FINER)
SMALL, ROOM = 0.4, 0.2
FEWEST_NODES = 8
# What the estimate is multiplied by for its own error before a run is judged.
RESERVE = 1.25
# Of times between nodes.
ROUNDING = 1e-8
# Of bounds in SI units: squares of errors in bounds are numbers.
SMALLEST = 1e-100
# Of mechanisms: largest last step (rad or m) of Newton's method, after which its error is far
# smaller.
LAST_STEP = 1e-6
NOT_ESTIMATED = "its error was not estimated"


@dataclass(frozen=True, eq=False)
class ErrorEstimate(ShortRepr):
    """Estimated errors of a run's outputs: the run minus that of the full model.

    Attributes
    ----------
    times
        In s (nodes,).
    model
        The full model.
    errors_of
        Names of outputs -> their errors (nodes, names), see `errors`.
    bounds
        Output -> measure and bound, by which the run is judged.
    in_bounds
        Largest error of the run in multiples of its bound.
    settled
        Whether all corrections were small in the end.
    """

    repr_fields = ("in_bounds", "settled")

    times: np.ndarray
    model: Model
    errors_of: Callable[[tuple[str, ...]], np.ndarray]
    bounds: Mapping[str, ErrorBound]
    in_bounds: float
    settled: bool

    def __getitem__(self, name: str) -> np.ndarray:
        """Estimated error (nodes,) of an output."""
        return self.errors_of((name,))[:, 0]

    @property
    def errors(self) -> np.ndarray:
        """In the units of the outputs (nodes, outputs); infinite if too large to be known."""
        return self.errors_of(self.model.outputs)

    @property
    def used(self) -> dict[str, np.ndarray]:
        """Part of its bound that the error of each bounded output has used up to each node."""
        return used_parts(self.errors_of(tuple(self.bounds)), self.bounds)

    def trust(self) -> Trust:
        """Trust of the run: its indicator is the estimated error in bounds, with a reserve."""
        indicator = RESERVE * self.in_bounds
        if not indicator > 1.0:
            return Trust(indicator)
        used = self.used
        # Used parts may differ from the largest error by rounding.
        first = min(part.searchsorted(1.0 / RESERVE, "right") for part in used.values())
        until = float(self.times[min(first, len(self.times) - 1)])
        worst = max(used, key=lambda name: used[name][-1])
        bound, outputs = self.bounds[worst], self.model.definition.outputs
        unit = outputs[self.model.outputs.index(worst)].unit
        error, rms = used[worst][-1] * bound.bound, " RMS" if bound.measure == "rms" else ""
        size = "too large to be known" if np.isinf(error) else f"{error:.3g} {unit}{rms}"
        reason = (
            f"the estimated error of {worst} is {size}, its bound {bound.bound:.3g} {unit}{rms}; "
            f"errors pass the limit, {1.0 / RESERVE:g} of a bound"
        )
        return Trust(indicator, until, reason)


def used_parts(errors: np.ndarray, bounds: Mapping[str, ErrorBound]) -> dict[str, np.ndarray]:
    """Parts of bounds that errors (nodes, bounds) of outputs have used up to each node."""
    used = {}
    for (name, bound), column in zip(bounds.items(), errors.T, strict=True):
        share = np.abs(column) / bound.bound
        peaks = np.maximum.accumulate(share)
        rms = np.sqrt(np.cumsum(share**2) / len(share))
        used[name] = peaks if bound.measure == "max" else rms
    return used


def checked_bounds(model: Model, bounds: Mapping[str, Any]) -> dict[str, ErrorBound]:
    """Bounds by output, see `ReducedOrderModel.simulate`; `InputError` if one is wrong."""
    if not isinstance(bounds, Mapping) or not bounds:
        raise InputError(f"bounds is {quoted(bounds)}, not bounds by output")
    if not estimates(model):
        raise InputError(f"bounds: errors of {model.name} are not estimated")
    checked = {}
    for name, value in bounds.items():
        pair: Any = value if isinstance(value, tuple | list) else ("max", value)
        if len(pair) != 2:
            raise InputError(f"bound of {name} is {quoted(value)}, not a measure and a number")
        choice("output of bounds", name, model.outputs)
        measure = choice(f"measure of {name}", pair[0], ("max", "rms"))
        check_positive(f"bound of {name}", pair[1], SMALLEST)
        checked[name] = ErrorBound(measure, float(pair[1]))
    return checked


def judged(
    run: Trajectory,
    simulate: Callable[[Excitation, Start], Trajectory],
    given: tuple[Excitation, Start],
    bounds: Mapping[str, ErrorBound] | None = None,
) -> Trajectory:
    """A run from what was given, judged by its estimated error in bounds, those of its model.

    One that its model has judged, or that comes with a complaint, stays as it is.  Where output
    times are too far apart for an estimate, it is made of the same run with more of them.
    """
    (maneuver, start), model = given, run.model
    if run.trust or not estimates(model):
        return run
    known = model.definition.error_bounds if bounds is None else bounds
    if not known or run.status not in WITHOUT_COMPLAINT:
        return run
    began, loops = time.thread_time(), run.seconds
    if isinstance(model, AlgebraicModel):
        errors_of, is_reached = constraint_errors(run, maneuver)
        used = used_parts(errors_of(tuple(known)), known).values()
        largest = float(max(part[-1] for part in used))
        estimate = ErrorEstimate(run.times, model, errors_of, known, largest, is_reached)
    else:
        estimate = _looked(run, simulate, (maneuver, start), known)
    if estimate is None:
        return run
    judged = run.judged(estimate.trust())
    seconds = loops + time.thread_time() - began
    return Trajectory.of(**judged.__dict__ | {"error_estimate": estimate, "seconds": seconds})


def constraint_errors(
    run: Trajectory, maneuver: Excitation
) -> tuple[Callable[[tuple[str, ...]], np.ndarray], bool]:
    """Errors (samples, names) of a run by names of outputs, and whether all samples are in reach.

    The constraint equations say at each sample where the mechanism is.  Newton's method in vector
    lanes goes there from extrapolated positions in little more than one step a sample: a correction
    of the decoded coordinates takes as many, and can't tell on which branch they are.  Errors are
    infinite from the first sample on that the mechanism can't reach on the branch of its design
    position.
    """
    model = run.model
    full = model.solved_as_far(model.sampled(maneuver), "newton_lanes", LAST_STEP)
    return partial(_errors_of_mechanism, run, full), full.status == "ok"


def _errors_of_mechanism(run: Trajectory, full: Trajectory, names: tuple[str, ...]) -> np.ndarray:
    columns = [full.names.index(name) for name in names]
    errors = run.outputs[:, columns] - full.outputs[:, columns]
    return np.where(np.isfinite(errors), errors, np.inf)


def _looked(
    run: Trajectory,
    simulate: Callable[[Excitation, Start], Trajectory],
    given: tuple[Excitation, Start],
    bounds: Mapping[str, ErrorBound],
) -> ErrorEstimate | None:
    """Estimate for a vehicle's run by the first look that is fine enough, none if there is none."""
    (maneuver, start), estimate, error = given, None, math.nan
    apart = maneuver.duration / (maneuver.samples - 1)
    rises = checked_maneuver(maneuver, run.model.definition).jumps.lengths
    # Half a steep change, so that a look sees it; one at once is seen by none.
    coarsest = max(0.5 * rises.min(where=rises > 0.0, initial=math.inf), LOOKS[-1][0])
    for spacing, passes in LOOKS:
        if spacing > coarsest:
            continue
        parts = math.ceil(apart / spacing - 1e-6)
        finer = simulate(maneuver.subdivided(parts), start) if parts > 1 else run
        every = max(int(parts * spacing / apart + 1e-6), 1)
        nodes = np.arange(0, finer.samples_to_stop, every)
        if len(nodes) < FEWEST_NODES:
            continue
        estimate = error_estimate(finer, nodes, given, bounds, passes)
        before, error = error, estimate.in_bounds
        is_within = abs(error - before) < ROOM * (1.0 / RESERVE - error)
        if is_within or (error < SMALL and estimate.settled):
            break
    return estimate


def error_estimate(
    run: Trajectory,
    nodes: np.ndarray,
    given: tuple[Excitation, Start],
    bounds: Mapping[str, ErrorBound],
    passes: tuple[int, float],
) -> ErrorEstimate:
    """Errors of a run that has states, at some of its output times, equidistant ones.

    The maneuver and the start are given; of passes see `LOOKS`.
    """
    from vehiclemor.reduction.error_model import LOST, error_model

    model, (maneuver, start) = run.model, given
    times = run.times[nodes]
    complete = checked_maneuver(maneuver, model.definition)
    inputs = _averaged_jumps(complete, times, run.inputs[nodes])
    states = run.states_at(nodes)
    corrected = LOST
    if np.isfinite(states[-1]).all():
        of_errors, step = error_model(model, states, float(times[-1])), float(times[1] - times[0])
        first = model.start(start)
        corrected = of_errors.corrected(step, states, inputs, first, passes, bounds)
    corrected_states, in_bounds, is_settled = corrected
    errors = partial(_errors_of_states, model, inputs, states, corrected_states)
    return ErrorEstimate(times, model, errors, bounds, in_bounds, is_settled)


def _averaged_jumps(maneuver: Excitation, times: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Inputs (nodes, inputs) at times; nodes next to a jump have the means over their intervals.

    So sums over nodes are integrals, wherever inputs jump.
    """
    begins, lengths, sizes = maneuver.jumps
    step = times[1] - times[0]
    short = lengths < 2.0 * step
    if not short.any():
        return inputs
    begins, lengths = begins[short, None] / step, lengths[short, None] / step
    node = np.rint(begins + 0.5 * lengths).astype(int) + np.arange(-1, 2)
    since = node - begins
    # Times that differ by rounding are one.
    passed = np.where(lengths > 0.0, since / np.maximum(lengths, ROUNDING), since > -ROUNDING)
    mean = _passed_until(since + 0.5, lengths) - _passed_until(since - 0.5, lengths)
    jump, column = np.nonzero((node > 0) & (node < len(times) - 1))
    more = mean - passed.clip(0.0, 1.0)
    averaged = inputs.copy()
    np.add.at(averaged, node[jump, column], more[jump, column, None] * sizes[short][jump])
    return averaged


def _passed_until(since: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Integral of the part of a steady change that has passed, from its beginning on."""
    during = since.clip(0.0, lengths)
    return 0.5 * during**2 / np.maximum(lengths, ROUNDING) + (since - lengths).clip(0.0)


def _errors_of_states(
    model: DynamicModel,
    inputs: np.ndarray,
    states: np.ndarray,
    corrected: np.ndarray | None,
    names: tuple[str, ...],
) -> np.ndarray:
    """Errors (nodes, names) of outputs at states (nodes, n), infinite without corrected ones."""
    if corrected is None:
        return np.full((len(states), len(names)), np.inf)
    both = np.concatenate((states, corrected)), np.concatenate((inputs, inputs))
    own, full = np.split(model.histories_at(names, *both), 2)
    return own - full


def estimates(model: object) -> bool:
    """Whether errors of a model's runs are estimated: a mechanism, or a vehicle with a heading."""
    if isinstance(model, AlgebraicModel):
        return True
    return isinstance(model, DynamicModel) and len(model.planar) == 3
