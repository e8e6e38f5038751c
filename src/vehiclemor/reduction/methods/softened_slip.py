"""Softened slip: the full model with a lower slip stiffness of its tires.

The fastest decay of a rolling wheel goes with its longitudinal slip stiffness, and without driving
or braking nobody looks at slip: divided by a factor, the stiffness that limits explicit steps falls
as well.

To be expected: an explicit run gains up to the factor, with small errors, until hop or stabilised
constraints limit the steps; a W-method gains nothing, since stiffness is free for it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import online_settings
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.shape import is_vehicle
from vehiclemor.simulation.build import build
from vehiclemor.simulation.checks import check_inputs
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.spaces import full_space
from vehiclemor.simulation.trajectory import Start, Trajectory

SUMMARY = "the full model with softer longitudinal slip of its tires, for longer explicit steps"
REFERENCE = ""
# Parameters that are proportional to the slip stiffness.  Magic Formula: K_x / F_z is
# (PKX1 + PKX2 d) exp(PKX3 d), d the relative change of the load; the peak stays.
SLIP_STIFFNESS = ("PKX1", "PKX2", "longitudinal_slip_stiffness")
_SETTINGS = {
    "factor": Setting("number", 5.0, "slip stiffness is divided by it", minimum=1.0),
    **online_settings("explicit", 1e-4, "as of full_order"),
}


@dataclass(frozen=True, eq=False)
class SoftenedVehicle:
    """A vehicle on softer tires, seen through the outputs of the original.

    Attributes
    ----------
    model, softened
        The full-order model, and the one that is integrated.
    """

    model: DynamicModel
    softened: DynamicModel
    offline: Offline
    solver: str
    tolerance: float

    @property
    def effective_rank(self) -> int:
        """Number of coordinates: all are kept."""
        return len(self.model.coordinates)

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """States of the softened vehicle from the original's start, outputs of the original."""
        model = self.model
        check_inputs(maneuver, model.name, model.inputs)
        space = full_space(len(model.coordinates))
        run = self.softened.system.run(
            maneuver, model.start(start), space, self.solver, self.tolerance
        )
        return model.recorded(maneuver, run, maneuver.at(run.times), run.path)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """The states themselves: the full space holds them."""
        return states


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """Vehicles whose tires have a slip stiffness of a known name."""
    accepted, reason = is_vehicle(model)
    if accepted and not _stiffnesses(model):
        return False, f"{model.name} has no parameter {' or '.join(SLIP_STIFFNESS)}"
    return accepted, reason


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every such vehicle."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> SoftenedVehicle:
    """The same model with changed parameters; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    # All values, not the file's: some may have been overridden.
    values = {name: entry.value for name, entry in model.parameters.entries.items()}
    for name, stiffness in _stiffnesses(model).items():
        values[name] = stiffness / float(settings["factor"])
    softened = build(model.name, overrides=values)
    assert isinstance(softened, DynamicModel)
    return SoftenedVehicle(
        model,
        softened,
        Offline(time.perf_counter() - began, 0),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )


def _stiffnesses(model: Model) -> dict[str, float]:
    """Parameters of the slip stiffness that the model has."""
    known = model.parameters.entries
    return {name: float(model.parameters[name]) for name in SLIP_STIFFNESS if name in known}
