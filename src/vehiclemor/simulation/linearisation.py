"""Jacobians of dynamic models and of their reductions, by differences of compiled kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.simulation.checks import checked_array, loop_array
from vehiclemor.simulation.rosenbrock_methods import ROS34PW2
from vehiclemor.simulation.spaces import Spaces

if TYPE_CHECKING:
    from vehiclemor.simulation.dynamic import DynamicModel

# Step sizes (s) for which inverses are stored.
LADDER = 2.0 ** (0.5 * np.arange(-32, 7))


def jacobian(model: DynamicModel, x: Any, u: Any) -> np.ndarray:
    """df/dx (2 n, 2 n) by central differences; columns of cyclic states are zero."""
    x = checked_array(x, 2 * len(model.coordinates), "x", model.name)
    u = checked_array(np.atleast_1d(u), len(model.inputs), "u", model.name)
    result = np.empty((len(x), len(x)))
    model.loops.jacobian_at(x, u, model.machine, model.active, result)
    return result


def frozen_inverses(model: DynamicModel) -> np.ndarray:
    """Transposed active columns of (I - gamma h J)^-1 on the ladder of step sizes.

    J belongs to the first start with all inputs zero: straight running.
    """
    x = model.start()
    straight = jacobian(model, x, np.zeros(len(model.inputs)))
    identity = np.eye(len(x))
    inverses = [np.linalg.inv(identity - ROS34PW2.gamma * h * straight) for h in LADDER]
    return loop_array(np.stack([inverse[:, model.active].T for inverse in inverses]))


def reduced_jacobian(model: DynamicModel, spaces: Spaces, window: int, y: np.ndarray) -> np.ndarray:
    """Jacobian of one window's reduced system at y (dim,), all inputs zero."""
    dim = len(y)
    nothing = np.zeros((1, len(model.inputs), 6))
    signal = (np.array([0.0, 1.0]), np.array([0, 1]), nothing)
    space = tuple(loop_array(part[window]) for part in spaces.arrays[:3])
    columns = []
    for j in range(dim):
        step = 1e-6 * max(1.0, abs(y[j]))
        sides = []
        for sign in (1.0, -1.0):
            shifted, image = y.copy(), np.empty(dim)
            shifted[j] += sign * step
            model.loops.reduced_slope(
                spaces.form, 0.0, 0, shifted, dim, signal, *space, model.machine, image
            )
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
