"""Jacobians of dynamic models and of their reductions, by differences of compiled kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.inputs.sample_loops import Pieces
from vehiclemor.simulation.checks import checked_array
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.integrators.loop import scratch_end
from vehiclemor.simulation.integrators.structures import Place
from vehiclemor.simulation.projection_windows import ProjectionWindows

if TYPE_CHECKING:
    from vehiclemor.simulation.dynamic import DynamicModel


def jacobian(model: DynamicModel, x: Any, u: Any) -> np.ndarray:
    """df/dx (2 n, 2 n) by central differences; columns of cyclic states are zero."""
    x = checked_array(x, 2 * len(model.coordinates), "x", model.name)
    u = checked_array(u, len(model.inputs), "u", model.name)
    return model.system.jacobian(x, u)


def reduced_jacobian(
    model: DynamicModel, windows: ProjectionWindows, window: int, y: np.ndarray
) -> np.ndarray:
    """Jacobian of one window's reduced system at y (dim,), all inputs zero."""
    dim, n = len(y), 2 * len(model.coordinates)
    nothing = np.zeros((1, len(model.inputs), 6))
    signal = Pieces(np.array([0.0, 1.0]), np.array([0, 1]), np.empty(0), nothing)
    loop = catalogue.rhs_loop(windows.formulation)
    equations = model.system.called(windows.formulation, "")
    buffer = np.empty(scratch_end(n, len(model.inputs)))
    place, columns = Place(0.0, 0, window), []
    for j in range(dim):
        step = 1e-6 * max(1.0, abs(y[j]))
        sides = []
        for sign in (1.0, -1.0):
            shifted, image = y.copy(), np.empty(dim)
            shifted[j] += sign * step
            loop(shifted, equations, signal, windows.subspaces, place, buffer, image)
            sides.append(image)
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    return np.column_stack(columns)


def speeds_per_rates(model: DynamicModel, x: Any) -> np.ndarray:
    """Matrix (n, n) that turns rates of the coordinates into speeds at the state x."""
    n = len(model.coordinates)
    place = np.concatenate([np.asarray(x, dtype=float)[:n], np.zeros(n)])
    columns = []
    for j in range(n):
        place[n:] = 0.0
        place[n + j] = 1.0
        columns.append(model.speeds_of_rates(place))
    return np.column_stack(columns)
