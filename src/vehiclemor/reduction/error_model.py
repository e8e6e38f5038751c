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
from typing import Any, NamedTuple

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
WINDOW, MOST_PASSES, LEAST_RANGE = 9, 12, 1e-3
# Step of differences; magnitude of a mode's rate times the step below which weights are series.
DIFFERENCE, SERIES = 1e-6, 1e-3


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
        nodes, modes = len(states), self._modes
        n, count = modes.coordinates.shape
        widths = 2 * [states.shape[1]] + [len(self._free.correction), n, 3] + 3 * [count]
        rooms: list[Any] = [np.empty((nodes, columns)) for columns in widths]
        scratch = Scratch(*rooms, *(np.empty(size) for size in (count, n, n)))
        of_errors = ModesOfErrors(
            modes.coordinates,
            modes.shapes,
            self._weights(step),
            np.tile(np.abs(modes.rates) <= FASTEST_START, 2).astype(float),
            self._free.correction,
            np.ascontiguousarray(self.shape.linearised.velocity_a),
        )
        passes, result = Passes(WINDOW, MOST_PASSES, settled, LEAST_RANGE), np.empty_like(states)
        loop = loops(("reduction.error_loops",), ("corrected_run",))["corrected_run"]
        unsettled = loop(
            step, states, inputs, start, *self._bundles, of_errors, passes, scratch, result
        )
        return (None if unsettled < 0 else result), unsettled == 0

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
        found: Any = np.linalg.eig(self.shape.linearised.a[free.indices] @ free.shapes)
        rates, vectors = found
        inverse, upper = np.linalg.inv(vectors), rates.imag >= 0.0
        shapes = (free.shapes @ vectors[:, upper]) * np.where(rates[upper].imag > 0.0, 2.0, 1.0)
        left: Any = np.zeros((len(self.shape.indices), upper.sum()), dtype=complex)
        left[free.indices] = inverse[upper].T
        return Modes(
            rates[upper],
            np.ascontiguousarray(np.hstack([left.real, left.imag])),
            np.ascontiguousarray(np.vstack([shapes.real.T, -shapes.imag.T])),
        )

    @lru_cache(maxsize=4)  # noqa: B019
    def _weights(self, step: float) -> np.ndarray:
        """Weights of a step in s, see `error_loops`."""
        z: Any = self._modes.rates * step
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

    rates: Any
    coordinates: np.ndarray
    shapes: np.ndarray
