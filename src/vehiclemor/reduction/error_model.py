"""Errors of a path of a vehicle's states, by the full equations.

The path goes into the full equations d' = f(d, u) of the vehicle's shape d.  What they leave over
drives an error e,

    e' = f(d + e, u) - d' = A e + (f(d + e, u) - d' - A e),

in which A is their linearisation at straight running.  It is propagated exactly, mode by mode, and
the bracket is taken from the pass before: deferred correction by an exponential integrator
(A. Dutt, L. Greengard, V. Rokhlin, BIT 40, 2000, 241-266; M. Hochbruck, A. Ostermann, Acta
Numerica 19, 2010, 209-286).  Constraints are met by Newton's method with a frozen Jacobian.
Heading and position of the corrected shape are quadratures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from vehiclemor.codegen.loops import loops
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import at_samples

# Modes faster than this (1/s) start without an error: their start passes before it matters.
FASTEST_START = 100.0
# A corrected shape that is larger (m, rad) has gone to infinity.
LARGEST = 1e6
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

    def passes(
        self, step: float, states: np.ndarray, inputs: np.ndarray, start: np.ndarray
    ) -> Iterator[np.ndarray]:
        """States (nodes, n) of the full model as each pass corrects them; none once they diverge.

        A path of states and inputs (nodes, inputs) at nodes that are a step in s apart; the start
        (n,) is that of the full model.
        """
        shape = self.shape
        path = shape.of(states) - shape.reference
        # A method may record the start itself, through which its own motion does not pass.
        path[0] = 4.0 * path[1] - 6.0 * path[2] + 4.0 * path[3] - path[4]
        path_rates, weights = self._modal(slopes(path, step)), self._weights(step)
        first = self._modal(shape.of(start[None]) - shape.reference - path[:1])[0]
        first[np.tile(np.abs(self._modes.rates) > FASTEST_START, 2)] = 0.0
        corrected, errors = path.copy(), np.zeros_like(path_rates)
        while True:
            rates, motion = shape.rates(corrected + shape.reference, inputs)
            found = np.empty_like(errors)
            sources = self._modal(rates) - path_rates - self._times_rates(errors)
            propagate = loops(("reduction.error_loops",), ("propagated",))["propagated"]
            propagate(sources, weights, first, found)
            change = (found - errors) @ self._modes.shapes
            if self._free.correction.size:
                change -= self._violations(corrected, inputs) @ self._free.correction
            corrected, errors = corrected + change, found
            if not np.abs(corrected).max() < LARGEST:
                return
            motion += change @ shape.linearised.velocity_a.T
            yield self._states(corrected, motion, start, step)

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
        return Free(free, inverse[:, : len(free)], inverse[:, len(free) :].T)

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
            np.hstack([left.real, left.imag]),
            np.vstack([shapes.real.T, -shapes.imag.T]),
        )

    def _modal(self, deviations: np.ndarray) -> np.ndarray:
        """Modal coordinates (samples, 2 modes) of deviations: real parts, then imaginary ones."""
        return deviations @ self._modes.coordinates

    def _times_rates(self, modal: np.ndarray) -> np.ndarray:
        """Modal coordinates times the rates of their modes."""
        real, imaginary = np.hsplit(modal, 2)
        rates = self._modes.rates
        return np.hstack(
            [real * rates.real - imaginary * rates.imag, real * rates.imag + imaginary * rates.real]
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
