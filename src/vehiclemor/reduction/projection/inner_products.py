"""Inner products in which snapshots are compared, as weight matrices W: <a, b> = a^T W b."""

import numpy as np

from vehiclemor.simulation import linearisation
from vehiclemor.simulation.dynamic import DynamicModel

# A state whose range is below this share of the largest one is noise, not motion.
SMALLEST_RANGE = 1e-6


def coordinate_weight(
    model: DynamicModel, inner_product: str, coordinates: np.ndarray
) -> np.ndarray:
    """Weight (n, n) of coordinates.

    Parameters
    ----------
    inner_product
        `euclidean`: the identity.  `energy`: the mass matrix M at the first start.  `range`: one
        over the square of each coordinate's range.
    coordinates
        Training histories (samples, n), for the ranges.
    """
    n = len(model.coordinates)
    if inner_product == "euclidean":
        return np.eye(n)
    if inner_product == "energy":
        return mass_weight(model)
    return _by_range(coordinates)


def state_weight(
    model: DynamicModel, inner_product: str, states: np.ndarray, time_scale: float
) -> np.ndarray:
    """Weight (2 n, 2 n) of states; for `energy` blkdiag(M / tau^2, M), tau the time scale in s.

    The mass matrix of the speeds follows from that of the coordinates and from the map of rates to
    speeds at the first start.
    """
    n = len(model.coordinates)
    if inner_product == "euclidean":
        return np.eye(2 * n)
    if inner_product == "range":
        return _by_range(states)
    return mass_weight(model, time_scale)


def mass_weight(model: DynamicModel, time_scale: float | None = None) -> np.ndarray:
    """Weight `energy` of the coordinates; with a time scale in s of all states."""
    n, mass = len(model.coordinates), model.mass_matrix(model.start())
    if time_scale is None:
        return mass
    weight = np.zeros((2 * n, 2 * n))
    weight[:n, :n] = mass / time_scale**2
    inverse = np.linalg.inv(linearisation.speeds_per_rates(model, model.start()))
    weight[n:, n:] = inverse.T @ mass @ inverse
    return weight


def _by_range(histories: np.ndarray) -> np.ndarray:
    ranges = np.ptp(histories, axis=0)
    return np.diag(1.0 / np.maximum(ranges, SMALLEST_RANGE * ranges.max()) ** 2)
