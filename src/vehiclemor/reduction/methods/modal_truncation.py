"""Modal truncation: slow modes of the linearised model, without training.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of a vehicle's modes that steering
moves those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

Of a structure all modes up to a frequency are kept, linearised at the static state.
"""

import time
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    free_modes,
    reduced,
)
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.linear_modes import SlowModes, lateral_modes, within
from vehiclemor.reduction.vehicle.linear_vehicle import linear_vehicle, no_linear_model
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape


class ModalTruncationSettings(OnlineSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    static_correction: Literal["yes", "no"] = Field(
        "yes", description="dropped modes follow the steering without delay"
    )


class StructuralModesSettings(StructuralSettings):
    """Settings for a structure."""

    highest: float = Field(100.0, gt=0.0, le=1e5, description="modes of up to so many Hz are kept")


def truncated(
    modes: SlowModes, follow: np.ndarray, fastest: float, static: bool
) -> tuple[SlowModes, np.ndarray]:
    """The modes with |lambda| up to `fastest` (1/s), the others static or dropped."""
    # In real form, rows of a block have the length |lambda|.
    kept = np.linalg.norm(modes.rates, axis=1) <= fastest
    if not kept.any():
        raise InputError(f"fastest is {fastest:g} 1/s: no mode that steering moves is that slow")
    if static and not kept.all():
        rest = np.linalg.solve(modes.rates[~kept][:, ~kept], modes.input_matrix[~kept])
        follow = follow.copy()
        follow[:, 0] -= modes.right[:, ~kept] @ rest
    chosen = np.eye(len(kept))[kept]
    return within(modes, chosen, chosen.T), follow


def fit(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Linearise and truncate; no training run is looked at.  `InputError` if no mode is kept."""
    began = time.process_time()
    if model.kind == "structural":
        return reduced(model, [free_modes(model, settings.highest)], settings, began)
    shape = VehicleShape(model)
    static = settings.static_correction == "yes"
    modes, follow = truncated(*lateral_modes(shape), settings.fastest, static)
    return linear_vehicle(shape, modes, follow, settings, began)


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
    learns_from="nothing",
    band="highest",
)
