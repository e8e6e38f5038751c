"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

    z' = Lambda z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

See `linear_vehicle` for inputs that contain derivatives of the steering.  Nothing is trained.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.methods.slow_manifold import accepts
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.linear_vehicle import Lateral, lateral_modes, linear_vehicle
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

__all__ = ["REFERENCE", "SUMMARY", "accepts", "check", "fit", "presets", "settings"]
SUMMARY = "slow lateral modes of the linearised vehicle, the others static"
REFERENCE = "10.1109/TAC.1966.1098264"
_SETTINGS = {
    "fastest": Setting(
        "number", 45.0, "modes of up to this |lambda| in 1/s are kept", minimum=0.0, above=True
    ),
    "static_correction": Setting(
        "text", "yes", "dropped modes follow the steering without delay", choices=("yes", "no")
    ),
    **ONLINE_SETTINGS,
}


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


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """At least one mode must be kept."""
    assert isinstance(model, DynamicModel)
    truncated(lateral_modes(VehicleShape(model)), float(settings["fastest"]), False)


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedVehicle:
    """Linearise and truncate; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape = VehicleShape(model)
    static = settings["static_correction"] == "yes"
    lateral = truncated(lateral_modes(shape), float(settings["fastest"]), static)
    return linear_vehicle(shape, lateral, settings, began)
