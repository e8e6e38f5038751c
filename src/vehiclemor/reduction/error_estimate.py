"""How far a reduced vehicle's run is from that of the full model, estimated after the run.

The estimate does not see the first tenth of a second after a start that is out of balance: hop of
the wheels passes before it matters, see `error_model`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.quantities import ErrorBound
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import check_positive
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust

# Longest time in s between nodes: a fifth of the period of wheel hop.
SPACING = 0.02
FEWEST_NODES = 8
# Passes that are made in any case, and at most; what they find in bounds is settled where it is
# small, or changes by no more than this part.
FIRST_PASSES, MOST_PASSES, SMALL, SETTLED = 3, 10, 0.3, 0.1


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated errors of a run's outputs: the run minus that of the full model.

    Attributes
    ----------
    times
        In s (nodes,).
    errors
        In the units of the outputs (nodes, outputs); infinite if they are too large to be known.
    names, units
        Of the outputs.
    bounds
        Output -> measure and bound, by which the run is judged.
    """

    times: np.ndarray
    errors: np.ndarray
    names: tuple[str, ...]
    units: tuple[str, ...]
    bounds: Mapping[str, ErrorBound]

    def __getitem__(self, name: str) -> np.ndarray:
        """Estimated error (nodes,) of an output."""
        return self.errors[:, self.names.index(name)]

    @cached_property
    def used(self) -> dict[str, np.ndarray]:
        """Part of its bound that the error of each bounded output has used up to each node."""
        used = {}
        for name, bound in self.bounds.items():
            size = np.abs(self[name]) / bound.bound
            peaks = np.maximum.accumulate(size)
            rms = np.sqrt(np.cumsum(size**2) / len(size))
            used[name] = peaks if bound.measure == "max" else rms
        return used

    @property
    def in_bounds(self) -> float:
        """Largest error of the run in multiples of its bound."""
        return max((float(used[-1]) for used in self.used.values()), default=0.0)

    def trust(self) -> Trust:
        """Trust of the run: its indicator is the estimated error in bounds."""
        if not self.in_bounds > 1.0:
            return Trust(self.in_bounds)
        since = {name: used.searchsorted(1.0, "right") for name, used in self.used.items()}
        first = min(since, key=lambda name: since[name])
        until, share = float(self.times[since[first]]), self.used[first][-1]
        size = "too large to be known" if np.isinf(share) else f"{share:.3g} times its bound"
        return Trust(self.in_bounds, until, f"the estimated error of {first} is {size}")


def checked_bounds(model: Model, bounds: Mapping[str, Any]) -> dict[str, ErrorBound]:
    """Bounds by output, see `ReducedOrderModel.simulate`; `InputError` if one is wrong."""
    if not isinstance(bounds, Mapping):
        raise InputError(f"bounds is {quoted(bounds)}, not bounds by output")
    checked = {}
    for name, value in bounds.items():
        pair = value if isinstance(value, tuple | list) and len(value) == 2 else ("max", value)
        choice("output of bounds", name, model.outputs)
        measure = choice(f"measure of {name}", pair[0], ("max", "rms"))
        check_positive(f"bound of {name}", pair[1])
        checked[name] = ErrorBound(measure, float(pair[1]))
    return checked


def judged_run(
    simulate: Callable[[Excitation, Start], Trajectory],
    reduced: Any,
    model: Model,
    maneuver: Excitation,
    start: Start,
    bounds: Mapping[str, ErrorBound] | None = None,
) -> Trajectory:
    """A run of a reduced model, judged by its estimated error in bounds, those of the model.

    Where its output times are too far apart for an estimate, it is run with more of them.  Full
    orders have no error, and a model with a fallback judges its runs itself.
    """
    known = model.definition.error_bounds if bounds is None else bounds
    if not (known and estimates(model)) or getattr(reduced, "judges", False):
        return simulate(maneuver, start)
    parts = math.ceil(maneuver.duration / (maneuver.samples - 1) / SPACING - 1e-6)
    if parts <= 1:
        return judged(simulate(maneuver, start), start, known)
    finer = judged(simulate(maneuver.subdivided(parts), start), start, known)
    return finer.chosen(times=maneuver.times)


def judged(run: Trajectory, start: Start, bounds: Mapping[str, ErrorBound]) -> Trajectory:
    """A run with its error estimate, and the trust that follows from it."""
    began = time.thread_time()
    estimate = error_estimate(run, run.model.start(start), bounds) if run.finished else None
    if estimate is None:
        return run
    seconds = run.seconds + time.thread_time() - began
    judged = run.judged(estimate.trust())
    return Trajectory.of(**judged.__dict__ | {"error_estimate": estimate, "seconds": seconds})


def error_estimate(
    run: Trajectory, start: np.ndarray, bounds: Mapping[str, ErrorBound]
) -> ErrorEstimate | None:
    """Estimated errors of a run that has states, from a state (n,) of the full model.

    None where the model is no vehicle on a plane road, or the run ends at once.
    """
    from vehiclemor.reduction.error_model import error_model

    model, rows = run.model, slice(0, run.samples_to_stop, nodes_apart(run.times))
    if not estimates(model) or len(run.times[rows]) < FEWEST_NODES:
        return None
    times = run.times[rows]
    states, inputs = (np.ascontiguousarray(part[rows]) for part in (run.states, run.inputs))
    own = model.outputs_at(states, inputs)
    units = tuple(q.unit for q in model.definition.outputs)
    found = ErrorEstimate(times, np.full(own.shape, np.inf), model.outputs, units, bounds)
    step, last = float(times[1] - times[0]), np.inf
    for number, corrected in enumerate(error_model(model).passes(step, states, inputs, start), 1):
        if number < FIRST_PASSES:
            continue
        found = replace(found, errors=own - model.outputs_at(corrected, inputs))
        size = found.in_bounds
        if size < SMALL or abs(size - last) < SETTLED * size or number >= MOST_PASSES:
            return found
        last = size
    return replace(found, errors=np.full(own.shape, np.inf))


def estimates(model: object) -> bool:
    """Whether errors of runs of a model can be estimated: it is a vehicle with a heading."""
    return isinstance(model, DynamicModel) and len(model.planar) == 3


def nodes_apart(times: np.ndarray) -> int:
    """How many output times (s) lie between nodes."""
    return max(int(SPACING / (times[1] - times[0]) + 1e-6), 1)
