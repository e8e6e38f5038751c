"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

Nothing is trained.

Of a structure all modes up to a frequency are kept, linearised at the static state.
"""

import time
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
from vehiclemor.reduction.vehicle.lateral import (
    Lateral,
    lateral_modes,
    linear_vehicle,
    no_linear_model,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape


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
    shape = VehicleShape(model)
    static = settings.static_correction == "yes"
    lateral = truncated(lateral_modes(shape), settings.fastest, static)
    return linear_vehicle(shape, lateral, settings, began)


METHOD = Method(
    name="modal_truncation",
    summary="slow modes of the linearised model: lateral ones of a car, all of a structure",
    reference="10.1109/TAC.1966.1098264",
    settings={
        **dict.fromkeys(("ode", "dae"), ModalTruncationSettings),
        "structural": StructuralModesSettings,
    },
    refusal=no_linear_model,
    fit=fit,
    learns_from="inputs",
)
