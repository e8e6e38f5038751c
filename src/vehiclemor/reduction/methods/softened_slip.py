"""Softened slip: the full model with a lower slip stiffness of its tires.

The fastest decay of a rolling wheel goes with its longitudinal slip stiffness, and without driving
or braking nobody looks at slip: divided by a factor, the stiffness that limits explicit steps falls
as well.

To be expected: an explicit run gains up to the factor, with small errors, until hop or stabilised
constraints limit the steps; a W-method gains nothing, since stiffness is free for it.
"""

import time

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method, Offline
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_vehicle
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.projection_windows import whole_space

# Parameters that are proportional to the slip stiffness.  Magic Formula: K_x / F_z is
# (PKX1 + PKX2 d) exp(PKX3 d), d the relative change of the load; the peak stays.
SLIP_STIFFNESS = ("PKX1", "PKX2", "longitudinal_slip_stiffness")


class SoftenedSlipSettings(OnlineSettings):
    """Settings for a vehicle."""

    factor: float = Field(5.0, ge=1.0, description="slip stiffness is divided by it")
    solver: Solver = "dopri5"
    tolerance: Tolerance = 1e-4


def refusal(model: Model) -> str:
    """Vehicles whose tires have a slip stiffness of a known name are accepted."""
    if reason := no_vehicle(model):
        return reason
    missing = f"{model.name} has no parameter {' or '.join(SLIP_STIFFNESS)}"
    return "" if _stiffnesses(model) else missing


def softened(model: DynamicModel, factor: float) -> DynamicModel:
    """The same model with its slip stiffness divided by a factor."""
    # The model's own values: some may differ from those of the parameter file.
    values = {name: entry.value for name, entry in model.parameters.entries.items()}
    for name, stiffness in _stiffnesses(model).items():
        values[name] = stiffness / factor
    changed = build(model.name, overrides=values)
    assert isinstance(changed, DynamicModel)
    return changed


def fit(model: DynamicModel, training: Training, settings: SoftenedSlipSettings) -> ReducedSystem:
    """States of the softened vehicle, outputs of the original; no training run is looked at."""
    began = time.process_time()
    soft = softened(model, settings.factor)
    return ReducedSystem(
        model,
        soft.system,
        whole_space(2 * len(model.coordinates)),
        len(model.coordinates),
        Offline(time.process_time() - began),
        settings.solver,
        settings.tolerance,
        # The full space holds all states.
        project=every_state,
    )


def every_state(states: np.ndarray) -> np.ndarray:
    """States as they are."""
    return states


def _stiffnesses(model: Model) -> dict[str, float]:
    """Parameters of the slip stiffness that the model has."""
    known = model.parameters.entries
    return {name: float(model.parameters[name]) for name in SLIP_STIFFNESS if name in known}


METHOD = Method(
    name="softened_slip",
    summary="the full model with softer longitudinal slip of its tires, for longer explicit steps",
    settings=dict.fromkeys(("ode", "dae"), SoftenedSlipSettings),
    refusal=refusal,
    fit=fit,
    learns_from="inputs",
)
