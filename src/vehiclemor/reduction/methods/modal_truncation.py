"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

    z' = Lambda z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

See `linear_vehicle` for inputs that contain derivatives of the steering.  Nothing is trained.
"""

import time
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.linear_vehicle import Lateral, lateral_modes, linear_vehicle
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.dynamic import DynamicModel


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


def check(model: DynamicModel, settings: ModalTruncationSettings) -> None:
    """At least one mode must be kept."""
    truncated(lateral_modes(VehicleShape(model)), settings.fastest, static=False)


def fit(
    model: DynamicModel, training: Training, settings: ModalTruncationSettings
) -> ReducedVehicle:
    """Linearise and truncate; no training run is looked at."""
    began = time.process_time()
    shape = VehicleShape(model)
    static = settings.static_correction == "yes"
    lateral = truncated(lateral_modes(shape), settings.fastest, static)
    return linear_vehicle(shape, lateral, settings, began)


METHOD = Method(
    name="modal_truncation",
    summary="slow lateral modes of the linearised vehicle, the others static",
    reference="10.1109/TAC.1966.1098264",
    settings=dict.fromkeys(("ode", "dae"), ModalTruncationSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
    learns_from="inputs",
)
