"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

    z' = Lambda z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.  Speed, heading and place are kept as in every reduced vehicle: the speed
stays that of the start, and the dynamics are those of the model's own speed.  Nothing is trained.

Of a structure all modes up to a frequency are kept, linearised at the static state.
"""

import time
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.modes import free_modes
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    reduced,
)
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
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
from vehiclemor.simulation.model import Model

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


class ModalTruncationSettings(OnlineSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    static_correction: Literal["yes", "no"] = Field(
        "yes", description="dropped modes follow the steering without delay"
    )


def truncated(lateral: Lateral, fastest: float, static: bool) -> Lateral:
    """The modes with |lambda| up to `fastest` (1/s), the others static or dropped."""
    # In real form, rows of a block have the length |lambda|.
    kept = np.linalg.norm(lateral.a, axis=1) <= fastest
    if not kept.any():
        raise InputError(f"fastest is {fastest:g} 1/s: no mode that steering moves is that slow")
    follow = lateral.follow.copy()
    if static and not kept.all():
        rest = np.linalg.solve(lateral.a[~kept][:, ~kept], lateral.b[~kept])
        follow[:, 0] -= lateral.right[:, ~kept] @ rest
    return Lateral(
        lateral.a[kept][:, kept],
        lateral.b[kept],
        lateral.left[kept],
        lateral.right[:, kept],
        follow,
        lateral.feedthrough[kept],
    )


class StructuralModesSettings(StructuralSettings):
    """Settings for a structure."""

    highest: float = Field(100.0, gt=0.0, le=1e5, description="modes of up to so many Hz are kept")


def fit(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Linearise and truncate; no training run is looked at.  `InputError` if no mode is kept."""
    began = time.process_time()
    if model.kind == "structural":
        return reduced(model, [free_modes(model, settings.highest)], settings, began)
    return steered_modes(model, settings, began)


def steered_modes(
    model: DynamicModel, settings: ModalTruncationSettings, began: float
) -> ReducedVehicle:
    """Slow lateral modes of a vehicle; offline cost from `began` (`time.process_time()`) on."""
    shape = VehicleShape(model)
    static = settings.static_correction == "yes"
    lateral = truncated(lateral_modes(shape), settings.fastest, static)
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


def refusal(model: Model) -> str:
    """Why a model is no vehicle whose lateral modes steering moves; structures have all modes."""
    return "" if model.kind == "structural" else no_steered_vehicle(model)


METHOD = Method(
    name="modal_truncation",
    summary="slow modes of the linearised model: lateral ones of a car, all of a structure",
    reference="10.1109/TAC.1966.1098264",
    settings={
        **dict.fromkeys(("ode", "dae"), ModalTruncationSettings),
        "structural": StructuralModesSettings,
    },
    refusal=refusal,
    fit=fit,
    learns_from="inputs",
)
