"""Errors of a path of a vehicle's states, by the full equations.

The path goes into the full equations d' = f(d, u) of the vehicle's shape d.  What they leave over
drives an error e,

    e' = f(d + e, u) - d' = A e + (f(d + e, u) - d' - A e),

in which A is their linearisation at straight running.  It is propagated exactly, mode by mode, and
the bracket is taken from the pass before, in windows of time one after another.  This is deferred
correction by an exponential integrator (A. Dutt, L. Greengard, V. Rokhlin, BIT 40, 2000, 241-266;
M. Hochbruck, A. Ostermann, Acta Numerica 19, 2010, 209-286).  Constraints are met by Newton's
method with a frozen Jacobian.  Heading and position of the corrected shape
are quadratures.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from vehiclemor.codegen.loops import loops
from vehiclemor.codegen.operations import LANES
from vehiclemor.reduction.error_loops import FullEquations, ModesOfErrors, Passes, Scratch, Shape
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import address_of, at_samples

# Modes faster than this (1/s) start without an error: their start passes before it matters.
FASTEST_START = 100.0
# Nodes in a window, and the most passes that it takes; least range of a coordinate of the shape, in
# which changes are measured (m, rad, m/s, rad/s).
WINDOW, MOST_PASSES, LEAST_RANGE = 17, 12, 1e-3
# Step of differences; magnitude of a mode's rate times the step below which weights are series.
DIFFERENCE, SERIES = 1e-6, 1e-3
# Derivatives on equidistant nodes of order 4, times 12 steps: inside, and at the first two nodes.
CENTRAL = np.array([1.0, -8.0, 0.0, 8.0, -1.0])
FIRST = np.array([[-25.0, 48.0, -36.0, 16.0, -3.0], [-3.0, -10.0, 18.0, -6.0, 1.0]])


@lru_cache(maxsize=64)
def error_model(model: DynamicModel) -> ErrorModel:
    """What corrects runs of a vehicle model."""
    return ErrorModel(VehicleShape(model))


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Modes of a vehicle's shape at straight running, in which errors are propagated."""

    shape: VehicleShape

    def corrected(
        self,
        step: float,
        states: np.ndarray,
        inputs: np.ndarray,
        start: np.ndarray,
        settled: float,
    ) -> tuple[np.ndarray | None, bool]:
        """States (nodes, n) of the full model along a run, none if they can't be followed.

        Given are states of the run and inputs (nodes, inputs) at nodes that are a step in s apart,
        and the start (n,) of the full model.  The truth value tells whether all changes were small
        enough in the end to be settled.
        """
        shape, nodes, modes = self.shape, len(states), self._modes
        path = np.ascontiguousarray(shape.of(states) - shape.reference)
        # A method may record the start itself, through which its own motion does not pass.
        path[0] = 4.0 * path[1] - 6.0 * path[2] + 4.0 * path[3] - path[4]
        path_rates = slopes(path, step) @ modes.coordinates
        first = (shape.of(start[None]) - shape.reference - path[:1]) @ modes.coordinates
        first[:, np.tile(np.abs(modes.rates) > FASTEST_START, 2)] = 0.0
        errors = np.zeros_like(path_rates)
        errors[0] = first
        scale = np.maximum(np.ptp(path, axis=0), LEAST_RANGE)
        scratch = Scratch(
            np.zeros_like(states),
            np.empty_like(states),
            np.empty((nodes, len(self._free.correction))),
            np.empty_like(errors),
            errors,
            np.empty(errors.shape[1]),
            np.empty(path.shape[1]),
        )
        bundles = (
            *self._bundles,
            ModesOfErrors(
                modes.coordinates,
                modes.shapes,
                self._weights(step),
                self._free.correction,
                np.ascontiguousarray(shape.linearised.velocity_a),
            ),
            Passes(WINDOW, MOST_PASSES, settled, scale),
            scratch,
        )
        motion = np.empty((nodes, 3))
        loop = loops(("reduction.error_loops",), ("corrected_run",))["corrected_run"]
        unsettled = loop(inputs, path_rates, *bundles, path, motion)
        if unsettled < 0:
            return None, False
        return self._states(path, motion, start, step), unsettled == 0

    @cached_property
    def _bundles(self) -> tuple[Shape, FullEquations]:
        """The shape and the full equations, as the loop takes them."""
        shape, model = self.shape, self.shape.model
        x, y, heading = model.planar
        pairs = np.array(shape.pairs, dtype=np.int64).reshape(-1, 2)
        names = "derivative", "violations"
        addresses = [
            address_of(model.kernels, n, LANES) if n in model.kernels else 0 for n in names
        ]
        return (
            Shape(shape.indices, np.array([heading, x, y]), pairs, shape.reference),
            FullEquations(np.array(addresses), model.constants),
        )

    def _states(
        self, corrected: np.ndarray, motion: np.ndarray, start: np.ndarray, step: float
    ) -> np.ndarray:
        """States (nodes, n) of corrected shapes, with the integrals of psi', U, V (nodes, 3)."""
        x, y, heading = self.shape.model.planar
        yaw = start[heading] + integrals(motion[:, :1], step)
        velocity = np.exp(1j * yaw[:, 0]) * (motion[:, 1] + 1j * motion[:, 2])
        moved = integrals(np.column_stack([velocity.real, velocity.imag]), step)
        planar = np.hstack([moved + start[[x, y]], yaw])
        return self.shape.states(corrected + self.shape.reference, planar)

    def _violations(self, deviations: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Violations of the constraints and their rates (samples, 2 c)."""
        shape, model = self.shape, self.shape.model
        states = shape.states(deviations + shape.reference, np.zeros((len(deviations), 3)))
        sizes = states.shape[1], inputs.shape[1], 2 * len(model.definition.constraints)
        return at_samples(model.kernels, "violations", model.constants, (states, inputs), sizes)

    @cached_property
    def _free(self) -> Free:
        """Coordinates of the shape that are free, those by which the others are known best."""
        shape, n = self.shape, len(self.shape.indices)
        if not shape.model.definition.constraints:
            return Free(np.arange(n), np.eye(n), np.zeros((0, n)))
        steps = DIFFERENCE * np.vstack([np.eye(n), -np.eye(n)])
        violations = self._violations(steps, np.zeros((2 * n, len(shape.model.inputs))))
        jacobian = (violations[:n] - violations[n:]).T / (2.0 * DIFFERENCE)
        kept = scipy.linalg.null_space(jacobian)
        *_, order = scipy.linalg.qr(kept.T, pivoting=True)
        free = np.sort(order[: kept.shape[1]])
        inverse = np.linalg.inv(np.vstack([np.eye(n)[free], jacobian]))
        return Free(free, inverse[:, : len(free)], np.ascontiguousarray(inverse[:, len(free) :].T))

    @cached_property
    def _modes(self) -> Modes:
        """Modes of the free coordinates; of a conjugate pair the upper one."""
        free = self._free
        rates, vectors = np.linalg.eig(self.shape.linearised.a[free.indices] @ free.shapes)
        inverse, upper = np.linalg.inv(vectors), rates.imag >= 0.0
        shapes = (free.shapes @ vectors[:, upper]) * np.where(rates[upper].imag > 0.0, 2.0, 1.0)
        left = np.zeros((len(self.shape.indices), upper.sum()), dtype=complex)
        left[free.indices] = inverse[upper].T
        return Modes(
            rates[upper],
            np.ascontiguousarray(np.hstack([left.real, left.imag])),
            np.ascontiguousarray(np.vstack([shapes.real.T, -shapes.imag.T])),
        )

    @lru_cache(maxsize=4)  # noqa: B019
    def _weights(self, step: float) -> np.ndarray:
        """Weights of a step in s, see `error_loops`."""
        z = self._modes.rates * step
        small = np.abs(z) < SERIES
        divisor = np.where(small, 1.0, z)
        decay = np.exp(z)
        mean = np.where(small, 1.0 + z / 2.0 + z**2 / 6.0, (decay - 1.0) / divisor)
        end = np.where(small, 0.5 + z / 6.0 + z**2 / 24.0, (mean - 1.0) / divisor)
        parts = decay, step * (mean - end), step * end
        parts = (*parts, self._modes.rates)
        return np.array([half for part in parts for half in (part.real, part.imag)])


class Free(NamedTuple):
    """Indices (free,) of free coordinates; shapes (n, free) that keep the constraints.

    The correction (2 c, n) is what meets violations.
    """

    indices: np.ndarray
    shapes: np.ndarray
    correction: np.ndarray


class Modes(NamedTuple):
    """Rates (modes,) in 1/s, coordinates of deviations (n, 2 modes), and back (2 modes, n)."""

    rates: np.ndarray
    coordinates: np.ndarray
    shapes: np.ndarray


def slopes(values: np.ndarray, step: float) -> np.ndarray:
    """Derivatives (nodes, columns) at nodes that are a step apart, of order 4."""
    result = np.empty_like(values)
    result[2:-2] = sum(w * values[i : len(values) - 4 + i] for i, w in enumerate(CENTRAL) if w)
    result[:2], result[-2:] = FIRST @ values[:5], -(FIRST @ values[:-6:-1])[::-1]
    return result / (12.0 * step)


def integrals(values: np.ndarray, step: float) -> np.ndarray:
    """Integrals (nodes, columns) from the first node on, of order 4: trapezoids, corrected."""
    areas = 0.5 * step * np.cumsum(values[1:] + values[:-1], axis=0)
    change = slopes(values, step)
    return np.vstack([0.0 * areas[:1], areas]) - step**2 / 12.0 * (change - change[:1])
