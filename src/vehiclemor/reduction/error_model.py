"""Errors of a path of a vehicle's states, by the full equations.

The path goes into the full equations d' = f(d, u) of the vehicle's shape d.  What they leave over
drives an error e,

    e' = f(d + e, u) - d' = A e + (f(d + e, u) - d' - A e),

in which A is their linearisation at straight running.  It is propagated exactly, mode by mode, and
the bracket is taken from the pass before, in windows of time one after another.  This is deferred
correction by an exponential integrator (A. Dutt, L. Greengard, V. Rokhlin, BIT 40, 2000, 241-266;
M. Hochbruck, A. Ostermann, Acta Numerica 19, 2010, 209-286).  Constraints are met by Newton's
method with a frozen Jacobian.  Heading and position of the corrected shape are quadratures.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.loops import Prepared, Ready, loops, ready
from vehiclemor.codegen.operations import LANES, padded
from vehiclemor.multibody.quantities import ErrorBound
from vehiclemor.reduction.error_arguments import (
    Bounded,
    ModesOfErrors,
    Path,
    Scratch,
    Shape,
    Violated,
)
from vehiclemor.reduction.vehicle.features import filled
from vehiclemor.reduction.vehicle.shape import RANK, Linearisation, VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import address_of, at_samples
from vehiclemor.simulation.workspaces import Pool

LOOPS = (
    *("simulation.loop_arguments", "simulation.path_loops"),
    *("reduction.error_arguments", "reduction.error_loops"),
)
# Speeds (m/s) of linearisations are multiples of this one.
SPEEDS = 2.5
# Every how manyth node tells the way.
APART = 8
# Modes start with an error whose rate times the time between nodes is no larger; the others have
# decayed before it matters.
FOLLOWED = 8.0
# Violations of constraints and their rates that are none (m, m/s); time in s in which those of a
# start decay, ten time constants of their stabilisation.
HELD, SETTLED = 1e-6, 0.2
# Step of differences; magnitude of a mode's rate times the step below which weights are series.
DIFFERENCE, SERIES = 1e-6, 1e-3
# States (nodes, n) of a corrected run, none if it can't be known; the largest error of the bounded
# outputs in bounds; whether all changes were small in the end.
Corrected = tuple[np.ndarray | None, float, bool]
LOST: Corrected = None, math.inf, False


def error_model(model: DynamicModel, states: np.ndarray, duration: float) -> ErrorModel:
    """What corrects a run of a vehicle model, with states (nodes, n) over so many s."""
    places = states[::APART, model.planar[:2]].tolist()
    way = sum(map(math.dist, places, places[1:]))
    return _at_speed(_alike(model), SPEEDS * max(round(way / duration / SPEEDS), 1))


@dataclass(frozen=True)
class Alike:
    """A model that stands for all with the same equations and constants."""

    key: tuple[str, tuple[str, ...], bytes]
    model: DynamicModel = field(compare=False)


@lru_cache(maxsize=64)
def _alike(model: DynamicModel) -> Alike:
    return Alike((model.kernel_hash, model.inputs, model.constants.tobytes()), model)


@lru_cache(maxsize=256)
def _at_speed(alike: Alike, speed: float) -> ErrorModel:
    return ErrorModel(_shape(alike), speed)


# Its derivatives serve all speeds.
@lru_cache(maxsize=64)
def _shape(alike: Alike) -> VehicleShape:
    return VehicleShape(alike.model)


@cache
def _spaces() -> Pool[Space]:
    """Arrays of runs that have ended."""
    return Pool()


@lru_cache(maxsize=256)
def _modes_of_errors(errors: ErrorModel, step: float) -> Ready:
    """What the loop needs of the modes at nodes that are a step in s apart."""
    modes, (slow, settling) = errors.modes, errors.starts(step)
    changes = np.vstack([-errors.free.correction, modes.shapes])
    motions = changes @ errors.linearised.velocity_a.T
    return ready(
        ModesOfErrors(
            filled(errors.in_states(modes.coordinates.T).T, LANES),
            filled(np.hstack([errors.in_states(changes), motions]), LANES),
            errors.weights(step),
            slow,
            np.ascontiguousarray(errors.in_states(settling.T).T),
        )
    )


@lru_cache(maxsize=64)
def _decay_of_violations(errors: ErrorModel, step: float) -> np.ndarray:
    """Violations and their rates (2 c, 2 c) a step in s later."""
    import scipy.linalg

    return scipy.linalg.expm(step * errors._violating[0])


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Modes of a vehicle's shape at straight running, in which errors are propagated."""

    shape: VehicleShape
    speed: float  # Of straight running in m/s.

    def corrected(
        self,
        step: float,
        states: np.ndarray,
        inputs: np.ndarray,
        start: np.ndarray,
        passes: tuple[int, float],
        bounds: Mapping[str, ErrorBound],
    ) -> Corrected:
        """A run with states (nodes, n), corrected to be that of the full model.

        Given are also inputs (nodes, inputs) at nodes that are a step in s apart, and the start
        (n,) of the full model; the most passes, and the change that ends them, in ranges of the
        coordinates; bounds of outputs.
        """
        model, kind = self.shape.model, (step, len(states), passes, tuple(bounds))
        # All constants of the same equations share arrays.
        shared = model.kernel_hash, model.inputs, len(self.modes.shapes), kind
        space = _spaces().taken(shared, lambda: self._space(*kind))
        path, bounded, call = space.path, space.bounded, space.call
        call.give("shape", self._of_shape)
        call.give("modes", _modes_of_errors(self, step))
        call.words[call.address("bounded.outputs.constants")] = model.constants.ctypes.data
        np.copyto(path.run, states)
        np.copyto(path.inputs, inputs)
        np.copyto(path.start, start)
        bounded.bounds[:] = [bound.bound for bound in bounds.values()]
        bounded.is_peak[:] = [bound.measure == "max" for bound in bounds.values()]
        self._write_violated(start, inputs[0], step, space.violated)
        unsettled = call()
        known = path.corrected.copy(), float(bounded.errors.max()), unsettled == 0
        _spaces().give_back(shared, space)
        return known if unsettled >= 0 else LOST

    def _space(
        self, step: float, nodes: int, passes: tuple[int, float], names: tuple[str, ...]
    ) -> Space:
        """Arrays of a run with bounds of outputs of these names, and the loop that uses them."""
        model, modes = self.shape.model, len(self.modes.shapes)
        n, violations = len(model.definition.states), len(self.free.correction)
        rows, of_modes, of_shape = (padded(size, LANES) for size in (nodes, modes, n + 3))
        widths = n, len(model.inputs), n, n, n, 3, of_modes, of_modes, violations + modes
        arrays: list[Any] = [np.empty((rows, columns)) for columns in widths]
        arrays += map(np.empty, ((LANES, n), (LANES, of_shape), n, n, 3))
        scratch = Scratch(*arrays)
        run, corrected = np.empty((2, nodes, n))
        path = Path(step, run, corrected, np.empty((nodes, len(model.inputs))), np.empty(n))
        first = min(max(int(SETTLED / step) + 1, 5), nodes)
        violated = Violated(*map(np.zeros, ((first, violations), (first, n), (first, n), 3)))
        outputs, results = model.recorder.packed(names, nodes)
        own, full = np.empty((2, nodes, results))
        bounded = Bounded(outputs.bundle, own, full, *np.empty((3, len(names))))
        call = loops(LOOPS, ("corrected_run",))["corrected_run"].prepared(
            path,
            violated,
            self._of_shape,
            _modes_of_errors(self, step),
            *passes,
            scratch,
            bounded,
        )
        return Space(path, violated, bounded, call)

    def _write_violated(
        self, start: np.ndarray, inputs: np.ndarray, step: float, violated: Violated
    ) -> None:
        """What a start (n,) violates, at nodes that are a step in s apart, see `Violated`.

        Violations decay as the stabilised constraints tell, whatever the motion.
        """
        model, count = self.shape.model, len(self.free.correction)
        if not count:
            return
        at_first = model.evaluated("violations", start, inputs).ravel()
        if np.abs(at_first).max() < HELD:
            for array in violated:
                array[:] = 0.0
            return
        (rates, shapes), decay = self._violating, _decay_of_violations(self, step)
        violations = violated.violations
        violations[0] = at_first
        for before, after in pairwise(violations):
            after[:] = decay @ before
        violated.shapes[:] = self.in_states(violations @ shapes.T)
        violated.slopes[:] = self.in_states(violations @ (shapes @ rates).T)
        # What the quadrature of the loop, see `integral` there, misses by its nodes.
        ends = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 144.0
        ends[0] -= 0.5
        by_nodes = step * (violations.sum(axis=0) + ends @ violations[: len(ends)])
        missed = -np.linalg.solve(rates, at_first) - by_nodes
        violated.motion[:] = self.linearised.velocity_a @ shapes @ missed

    @cached_property
    def _violating(self) -> tuple[np.ndarray, np.ndarray]:
        """Rates (2 c, 2 c) of violations and their rates; shapes (n, 2 c) that move with them."""
        import scipy.linalg

        free, a = self.free, self.linearised.a
        rates = free.jacobian @ a @ free.correction.T
        moved = a[free.indices]
        along = scipy.linalg.solve_sylvester(
            moved @ free.shapes, -rates, -moved @ free.correction.T
        )
        return rates, free.correction.T + free.shapes @ along

    def in_states(self, shapes: np.ndarray) -> np.ndarray:
        """Rows of shapes (rows, n) with a column for each state."""
        columns = np.zeros((len(shapes), len(self.shape.model.definition.states)))
        columns[:, self.shape.indices] = shapes
        return columns

    @cached_property
    def linearised(self) -> Linearisation:
        """Derivatives at straight running at the speed, which all states of that motion follow."""
        linear = self.shape.linearised
        # Straight running at another speed: the mode of eigenvalue zero.
        still = np.linalg.svd(linear.a)[2][-1]
        faster = still / (linear.velocity_a[1] @ still)
        return self.shape.linearised_at((self.speed - self.shape.speed) * faster)

    def starts(self, step: float) -> tuple[np.ndarray, np.ndarray]:
        """One (2 modes,) for modes that start with an error, which nodes so far apart follow.

        And what of a start's deviation (n, 3) goes to heading and place while the others decay.
        """
        linear, modes = self.linearised, self.modes
        follow = (np.abs(modes.rates) * step <= FOLLOWED).astype(float)
        slow = np.append(follow, follow[: len(modes.coordinates.T) - len(follow)])
        kept = (modes.coordinates * slow) @ modes.shapes
        decayed = -np.linalg.pinv(linear.a, rcond=RANK).T @ linear.velocity_a.T
        # What violates constraints is not part of it.
        settling, free = np.zeros_like(decayed), self.free
        settling[free.indices] = free.shapes.T @ (np.eye(len(kept)) - kept) @ decayed
        return slow, settling

    @cached_property
    def _of_shape(self) -> Ready:
        """The shape and the full equations, as the loop takes them."""
        shape, model, kernels = self.shape, self.shape.model, self.shape.model.kernels
        pairs = np.array(shape.pairs, dtype=np.int64).reshape(-1, 2)
        names = "derivative", "violations"
        addresses = [address_of(kernels, n, LANES) if n in kernels else 0 for n in names]
        reference = self.in_states(shape.reference[None])[0]
        places = shape.indices, model.planar[[2, 0, 1]], pairs, reference
        return ready(Shape(*places, np.array(addresses), model.constants))

    @cached_property
    def free(self) -> Free:
        """Coordinates of the shape that are free, those by which the others are known best."""
        shape, model, n = self.shape, self.shape.model, len(self.shape.indices)
        count = 2 * len(model.definition.constraints)
        if not count:
            return Free(np.arange(n), np.eye(n), np.zeros((0, n)), np.zeros((0, n)))
        steps = DIFFERENCE * np.vstack([np.eye(n), -np.eye(n)])
        states = shape.states(steps + shape.reference, np.zeros((2 * n, 3)))
        paths = states, np.zeros((2 * n, len(model.inputs)))
        sizes = len(model.definition.states), len(model.inputs), count
        violations = at_samples(model.kernels, "violations", model.constants, paths, sizes)
        jacobian = (violations[:n] - violations[n:]).T / (2.0 * DIFFERENCE)
        # Its import takes longer than thousands of estimates.
        import scipy.linalg

        kept = scipy.linalg.null_space(jacobian)
        *_, order = scipy.linalg.qr(kept.T, pivoting=True)
        free = np.sort(order[: kept.shape[1]])
        inverse = np.linalg.inv(np.vstack([np.eye(n)[free], jacobian]))
        correction = np.ascontiguousarray(inverse[:, len(free) :].T)
        return Free(free, inverse[:, : len(free)], jacobian, correction)

    @cached_property
    def modes(self) -> Modes:
        """Modes of the free coordinates; of a conjugate pair the upper one."""
        free = self.free
        found: Any = np.linalg.eig(self.linearised.a[free.indices] @ free.shapes)
        rates, vectors = found
        # Pairs first.
        order = np.argsort(rates.imag <= 0.0, kind="stable")
        order = order[rates.imag[order] >= 0.0]
        pairs = int((rates.imag > 0.0).sum())
        rates = rates[order]
        left: Any = np.zeros((len(order), len(self.shape.indices)), dtype=complex)
        left[:, free.indices] = np.linalg.inv(vectors)[order]
        right = (free.shapes @ vectors[:, order]).T
        right[:pairs] *= 2.0
        coordinates = np.vstack([left.real, left.imag[:pairs]]).T
        return Modes(rates, coordinates, np.vstack([right.real, -right.imag[:pairs]]))

    def weights(self, step: float) -> np.ndarray:
        """Weights of a step in s, see `error_loops`."""
        z: Any = self.modes.rates * step
        small = np.abs(z) < SERIES
        divisor = np.where(small, 1.0, z)
        decay = np.exp(z)
        mean = np.where(small, 1.0 + z / 2.0 + z**2 / 6.0, (decay - 1.0) / divisor)
        end = np.where(small, 0.5 + z / 6.0 + z**2 / 24.0, (mean - 1.0) / divisor)
        parts = decay, step * (mean - end), step * end, self.modes.rates
        return np.array([half for part in parts for half in (part.real, part.imag)])


class Space(NamedTuple):
    """Arrays of a run, what its start violates, bounded outputs, and the loop."""

    path: Path
    violated: Violated
    bounded: Bounded
    call: Prepared


class Free(NamedTuple):
    """Indices (free,) of free coordinates; shapes (n, free) that keep the constraints.

    The Jacobian (2 c, n) is of violations and their rates; the correction (2 c, n) meets these.
    """

    indices: np.ndarray
    shapes: np.ndarray
    jacobian: np.ndarray
    correction: np.ndarray


class Modes(NamedTuple):
    """Rates (modes,) in 1/s, pairs first; coordinates of deviations (n, k), and back (k, n).

    The coordinates are real parts of all modes, then imaginary ones of pairs.
    """

    rates: Any
    coordinates: np.ndarray
    shapes: np.ndarray
