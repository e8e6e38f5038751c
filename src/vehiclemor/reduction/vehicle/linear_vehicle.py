"""Reduced vehicles with linear lateral dynamics, by whatever choice of modes or states.

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.

Speed, heading and place are kept as in every reduced vehicle: the speed stays that of the start,
and the dynamics are those of the model's own speed.
"""

from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.reduction.interface import Offline, offline_cost
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.vehicle.features import linear_features
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_modes import (
    APART,
    apart,
    real_modes,
    slow_modes,
    without_derivatives,
)

# Modes that steering moves by less than this part of the most moved one are symmetric.
MOVED = 1e-8
# Lateral acceleration (m/s^2) of steady cornering that gives states their typical size (ISO 7401).
CORNERING = 4.0
# Error scales: a multiple of steady cornering; of the speed (m/s), heading (rad), place (m).
MARGIN = 3.0
SPEED, HEADING, PLACE = 10.0, 1.0, 10.0


@dataclass(frozen=True, eq=False)
class Lateral:
    """Linear lateral dynamics z' = a z + b s of a shape left + right z + follow (s, s', ...).

    Attributes
    ----------
    a, b
        Matrix (k, k) and column (k,) of the steering.
    left, right
        z per deviation of the shape (k, n), less `feedthrough` of the inputs, and back (n, k).
    follow
        Deviation (n, inputs) of the shape that follows the inputs without delay.
    feedthrough
        What of the inputs (k, inputs) is not in z.
    """

    a: np.ndarray
    b: np.ndarray
    left: np.ndarray
    right: np.ndarray
    follow: np.ndarray
    feedthrough: np.ndarray


def lateral_modes(shape: VehicleShape) -> Lateral:
    """All modes that steering moves, slow ones first, in real form (blocks of two for pairs)."""
    linear = shape.linearised
    follow, drive = without_derivatives(linear.a, linear.b)
    values, vectors = np.linalg.eig(linear.a.T)
    w = vectors.T
    v = np.linalg.inv(w)
    motion = apart(values) & (np.abs(values) > APART)
    moved = np.abs(w @ drive) * np.linalg.norm(v, axis=0) / np.maximum(np.abs(values), APART)
    moved[~motion] = 0.0
    left, right = real_modes(values, w, v, moved > MOVED * moved.max())
    return Lateral(left @ linear.a @ right, left @ drive, left, right, follow, left @ follow)


def linear_vehicle(
    shape: VehicleShape, lateral: Lateral, settings: OnlineSettings, began: float
) -> ReducedVehicle:
    """A reduced vehicle of linear lateral dynamics at the speed of the start."""
    linear, modes = shape.linearised, slow_modes(shape, np.inf)
    k, inputs = len(lateral.a), linear.b.shape[1]
    features = linear_features(k + 1, inputs)
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle is its own mirror image: the speed moves nothing sideways, steering changes no U.
    features = replace(
        features, groups=((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    )
    lifting = np.zeros((len(features.terms), len(linear.a)))
    lifting[odd] = np.vstack([lateral.right.T, lateral.follow.T])
    lifting[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([lateral.a.T, lateral.b])
    for column, row in ((k + 1, 0), (k + 3, 2)):
        c[odd, column] = lifting[odd] @ linear.motion_a[row]
        c[odd[k:], column] += linear.motion_b[row]
    c[even, k + 2] = shape.speed, 1.0
    return ReducedVehicle(
        shape.model,
        shape,
        features,
        np.zeros(0),
        c,
        lifting,
        np.vstack([lateral.left, modes.speed_left]),
        np.vstack([lateral.feedthrough, np.zeros(inputs)]),
        np.concatenate([error_scale(shape, lateral), [SPEED, HEADING, PLACE, PLACE]]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
        modes.symmetric,
    )


def error_scale(shape: VehicleShape, lateral: Lateral) -> np.ndarray:
    """Magnitudes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(lateral.a, lateral.b)
    turn = shape.linearised.motion_a[0] @ (lateral.right @ steady + lateral.follow[:, 0])
    # At least a thousandth of the largest one, for coordinates that steady cornering leaves alone.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


def linearisation_cost(shape: VehicleShape, began: float) -> Offline:
    """Seconds since `began`; two evaluations for every state and input."""
    return offline_cost(began, shape.model, further=2 * sum(shape.linearised.b.shape))
