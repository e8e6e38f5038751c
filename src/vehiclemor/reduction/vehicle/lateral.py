"""Lateral dynamics of a vehicle linearised at straight running, and reduced vehicles of it.

    z' = a z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.  Speed, heading and place are kept as in every reduced vehicle: the speed
stays that of the start, and the dynamics are those of the model's own speed.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.vehicle.features import FeatureListing
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import (
    CORNERING,
    HEADING,
    MARGIN,
    PLACE,
    SPEED,
    VehicleShape,
    linearisation_cost,
    no_steered_vehicle,
)
from vehiclemor.reduction.vehicle.slow_modes import (
    APART,
    apart,
    real_modes,
    slow_modes,
    without_derivatives,
)
from vehiclemor.simulation.dynamic import DynamicModel

# Modes that steering moves by less than this part of the most moved one are symmetric.
MOVED = 1e-8


@dataclass(frozen=True, eq=False)
class Lateral:
    """Linear lateral dynamics z' = a z + b s of a shape left + right z + follow (s, s', ...).

    z is `left` (k, n) times the deviation of the shape, less `feedthrough` (k, inputs) of the
    inputs; `follow` (n, inputs) is what follows these without delay.
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


def error_scale(shape: VehicleShape, lateral: Lateral) -> np.ndarray:
    """Magnitudes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(lateral.a, lateral.b)
    turn = shape.linearised.motion_a[0] @ (lateral.right @ steady + lateral.follow[:, 0])
    # At least a thousandth of the largest one, for coordinates that steady cornering leaves alone.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


class LinearVehicleSettings(OnlineSettings):
    """Settings of what pyMOR reduces."""

    rank: int = Field(4, ge=1, description="coordinates of the lateral dynamics")


def no_linear_model(model: Any) -> str:
    """Why a model is no vehicle whose lateral modes steering moves; every structure is linear."""
    return "" if model.kind == "structural" else no_steered_vehicle(model)


def linear_reduction(
    reductor: Any, model: DynamicModel, settings: LinearVehicleSettings, began: float
) -> ReducedVehicle:
    """A vehicle whose lateral dynamics stand in the bases that a reductor of pyMOR finds.

    Its outputs are the yaw rate and the lateral speed; `InputError` if the rank is too high.  The
    cost is counted from `began` (`time.process_time()`) on.
    """
    from pymor.core.logger import log_levels
    from pymor.models.iosys import LTIModel

    shape = VehicleShape(model)
    lateral = lateral_modes(shape)
    if settings.rank >= (most := len(lateral.a)):
        raise InputError(f"rank is {settings.rank}; {model.name} allows at most {most - 1}")
    c = shape.linearised.motion_a[[0, 2]] @ lateral.right
    with log_levels({"pymor": "ERROR"}):
        made = reductor(LTIModel.from_matrices(lateral.a, lateral.b[:, None], c))
        made.reduce(settings.rank)
    trial, test = (part.to_numpy() for part in (made.V, made.W))
    left = np.linalg.solve(test.T @ trial, test.T)
    found = Lateral(
        *(left @ lateral.a @ trial, left @ lateral.b, left @ lateral.left),
        *(lateral.right @ trial, lateral.follow, left @ lateral.feedthrough),
    )
    return linear_vehicle(shape, found, settings, began)


def linear_vehicle(
    shape: VehicleShape, lateral: Lateral, settings: OnlineSettings, began: float
) -> ReducedVehicle:
    """The reduced vehicle of linear dynamics; cost from `began` (`time.process_time()`) on."""
    linear, modes = shape.linearised, slow_modes(shape, np.inf)
    k, inputs = len(lateral.a), linear.b.shape[1]
    listing = FeatureListing(k + 1, inputs)
    terms = [(value,) for value in (listing.number(1.0), *listing.z, *listing.u)]
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle is its own mirror image: the speed moves nothing sideways, steering changes no U.
    groups = ((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    features = listing.features(terms, groups)
    decoding = np.zeros((len(features.terms), len(linear.a)))
    decoding[odd] = np.vstack([lateral.right.T, lateral.follow.T])
    decoding[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([lateral.a.T, lateral.b])
    for column, row in ((k + 1, 0), (k + 3, 2)):
        c[odd, column] = decoding[odd] @ linear.motion_a[row]
        c[odd[k:], column] += linear.motion_b[row]
    c[even, k + 2] = shape.speed, 1.0
    return ReducedVehicle(
        shape.model,
        shape,
        features,
        np.zeros(0),
        c,
        decoding,
        np.vstack([lateral.left, modes.speed_left]),
        np.vstack([lateral.feedthrough, np.zeros(inputs)]),
        np.concatenate([error_scale(shape, lateral), [SPEED, HEADING, PLACE, PLACE]]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
        modes.symmetric,
    )
