"""Balanced truncation of a vehicle linearised at straight running.

B. C. Moore, IEEE Trans. Autom. Control 26 (1981), 17-32, by the square-root method: states that
steering hardly reaches, or that lateral speed, yaw rate and roll hardly show, are dropped.  The
error of the transfer function is at most twice the sum of the Hankel singular values dropped.

What is balanced are all modes that steering moves (see `linear_vehicle`): the system with only
the steering as its input, since derivatives of a prescribed rack are taken out as feedthrough
first; stabilised constraints, never excited, stay out.  The speed is kept beside; nothing is
trained.
"""

import time

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.balancing import Balanced, balancing, gramian_factor
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_steered_vehicle
from vehiclemor.reduction.vehicle.linear_vehicle import Lateral, lateral_modes, linear_vehicle
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel

# Sizes of the outputs (m/s, rad/s, rad) that count the same: cornering at 4 m/s^2 and 20 m/s.
OUTPUTS = {"lateral_speed": 0.5, "yaw_rate": 0.2, "roll": 0.03}


class BalancedTruncationSettings(OnlineSettings):
    """Settings for a vehicle."""

    rank: int = Field(4, ge=1, description="lateral states kept")


def balanced(a: np.ndarray, b: np.ndarray, c: np.ndarray, rank: int) -> Balanced:
    """Balance a stable system x' = a x + b u, y = c x of n states, of which `rank` are kept."""
    from scipy.linalg import solve_continuous_lyapunov

    reached = gramian_factor(solve_continuous_lyapunov(a, -b @ b.T))
    seen = gramian_factor(solve_continuous_lyapunov(a.T, -c.T @ c))
    return balancing(reached, seen, rank)


def lateral_system(
    shape: VehicleShape, lateral: Lateral
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices a, b, c from steering to the scaled outputs."""
    rows = [shape.model.outputs.index(name) for name in OUTPUTS]
    sizes = np.array(list(OUTPUTS.values()))[:, None]
    return lateral.a, lateral.b[:, None], shape.linearised.output_a[rows] @ lateral.right / sizes


def check(model: DynamicModel, settings: BalancedTruncationSettings) -> None:
    """The rank may not exceed the number of lateral modes."""
    modes = len(lateral_modes(VehicleShape(model)).b)
    if settings.rank > modes:
        raise InputError(f"rank is {settings.rank}, but steering moves {modes} states")


def fit(
    model: DynamicModel, training: Training, settings: BalancedTruncationSettings
) -> ReducedVehicle:
    """Linearise and balance; no training run is looked at."""
    began = time.process_time()
    shape = VehicleShape(model)
    lateral = projected(shape, lateral_modes(shape), settings.rank)
    return linear_vehicle(shape, lateral, settings, began)


def projected(shape: VehicleShape, lateral: Lateral, rank: int) -> Lateral:
    """The lateral dynamics in balanced states."""
    kept = balanced(*lateral_system(shape, lateral), rank)
    left = kept.left @ lateral.left
    return Lateral(
        kept.left @ lateral.a @ kept.right,
        kept.left @ lateral.b,
        left,
        lateral.right @ kept.right,
        lateral.follow,
        left @ lateral.follow,
    )


METHOD = Method(
    name="balanced_truncation",
    summary="linearised vehicle, balanced between steering and lateral outputs",
    reference="10.1109/TAC.1981.1102568",
    settings=dict.fromkeys(("ode", "dae"), BalancedTruncationSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
    learns_from="inputs",
)
