"""Reduced vehicles of linear dynamics: slow modes at straight running, in fewer coordinates.

A vehicle is linearised at straight running:

    z' = a z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.  Speed, heading and place are kept as in every reduced vehicle: the speed
stays that of the start, and the dynamics are those of the model's own speed.
"""

from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import OfflineCost, offline_cost
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.vehicle.features import FeatureListing
from vehiclemor.reduction.vehicle.linear_modes import SlowModes, lateral_modes, within
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.dynamic import DynamicModel

# Lateral acceleration (m/s^2) of steady cornering that gives states their typical size (ISO 7401).
CORNERING = 4.0
# Error scales: a multiple of steady cornering; of the speed (m/s), heading (rad), place (m).
MARGIN = 3.0
SPEED, HEADING, PLACE = 10.0, 1.0, 10.0


def linearisation_cost(shape: VehicleShape, began: float) -> OfflineCost:
    """Seconds since `began`; two evaluations for every state and input."""
    return offline_cost(began, shape.model, further=2 * sum(shape.linearised.b.shape))


def error_scale(shape: VehicleShape, modes: SlowModes, follow: np.ndarray) -> np.ndarray:
    """Magnitudes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(modes.rates, modes.input_matrix)
    turn = shape.linearised.motion_a[0] @ (modes.right @ steady + follow[:, 0])
    # At least a thousandth of the largest one, for coordinates that steady cornering leaves alone.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


def linear_vehicle(
    shape: VehicleShape,
    modes: SlowModes,
    follow: np.ndarray,
    settings: OnlineSettings,
    began: float,
) -> ReducedVehicle:
    """The reduced vehicle of linear dynamics; cost from `began` (`time.process_time()`) on."""
    linear = shape.linearised
    k, inputs = len(modes.rates), linear.b.shape[1]
    listing = FeatureListing(k + 1, inputs)
    terms = [(value,) for value in (listing.number(1.0), *listing.z, *listing.u)]
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle is its own mirror image: the speed moves nothing sideways, steering changes no U.
    groups = ((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    features = listing.features(terms, groups)
    decoding = np.zeros((len(features.terms), len(linear.a)))
    decoding[odd] = np.vstack([modes.right.T, follow.T])
    decoding[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([modes.rates.T, modes.input_matrix])
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
        modes.encoding,
        modes.input_shift,
        np.concatenate([error_scale(shape, modes, follow), [SPEED, HEADING, PLACE, PLACE]]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
        modes.symmetric,
    )


def no_linear_model(model: Any) -> str:
    """Why a model is no vehicle whose lateral modes steering moves; every structure is linear."""
    return "" if model.kind == "structural" else no_steered_vehicle(model)


class LinearVehicleSettings(OnlineSettings):
    """Settings of what pyMOR reduces."""

    rank: int = Field(4, ge=1, description="coordinates of the lateral dynamics")


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
    modes, follow = lateral_modes(shape)
    if settings.rank >= (most := len(modes.rates)):
        raise InputError(f"rank is {settings.rank}; {model.name} allows at most {most - 1}")
    c = shape.linearised.motion_a[[0, 2]] @ modes.right
    with log_levels({"pymor": "ERROR"}):
        made = reductor(LTIModel.from_matrices(modes.rates, modes.input_matrix[:, None], c))
        made.reduce(settings.rank)
    trial, test = (part.to_numpy() for part in (made.V, made.W))
    found = within(modes, np.linalg.solve(test.T @ trial, test.T), trial)
    return linear_vehicle(shape, found, follow, settings, began)
