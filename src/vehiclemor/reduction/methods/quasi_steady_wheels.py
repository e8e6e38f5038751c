"""Quasi-steady wheels: the spins follow the other states without delay (singular perturbation).

P. Kokotovic, H. Khalil, J. O'Reilly, Singular Perturbation Methods in Control (SIAM 1999);
residualisation after Y. Liu, B. Anderson, Int. J. Control 50 (1989), 1379-1405.  About straight
running the spins x_f follow the other states x_s linearly, the equations of x_s stay as they are:

    x_f = x_f0 - A_ff^-1 A_fs (x_s - x_s0)

Spins in straight runs are proportional to the speed, so that these are exact at every speed.

To be expected: explicit steps become longer, since the fastest decay (160 to 520 1/s) is gone, but
hop and stabilised constraints limit them next, the right-hand side costs what it did, and for a
W-method stiffness is free: slower than the best full-order integrator.  In a bend the slaved wheels
brake: what a steered wheel rolls less than the car moves is of second order, and a slip of 1e-3 is
already a force.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.heading_frame import heading_frame
from vehiclemor.reduction.vehicle.projected_vehicle import (
    PROJECTED_SETTINGS,
    ProjectedVehicle,
    one_window,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape, is_vehicle, spin_angles
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

SUMMARY = "spins of the wheels slaved to the other states (singular perturbation)"
REFERENCE = "10.1137/1.9781611971118"


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return PROJECTED_SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """Vehicles whose wheels spin."""
    accepted, reason = is_vehicle(model)
    if accepted and isinstance(model, DynamicModel) and not len(spin_angles(model)):
        return False, f"{model.name} has no wheels that spin"
    return accepted, reason


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every vehicle."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedVehicle:
    """Slave the spins by the linearisation; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape, n = VehicleShape(model), len(model.coordinates)
    spins = spin_angles(model) + n
    fast, slow = np.isin(shape.kept, spins), ~np.isin(shape.kept, spins)
    a = shape.linearised.a
    slaved = -np.linalg.solve(a[np.ix_(fast, fast)], a[np.ix_(fast, slow)])
    left = np.setdiff1d(np.arange(2 * n), spins)
    lift, drop, mean = np.eye(2 * n)[left], np.eye(2 * n)[left], np.zeros(2 * n)
    rows = np.searchsorted(left, shape.kept[slow])
    lift[np.ix_(rows, shape.kept[fast])] = slaved.T
    # Reduced coordinates are the states themselves: only the spins have a constant part.
    mean[shape.kept[fast]] = shape.reference[fast] - slaved @ shape.reference[slow]
    system = heading_frame(shape)
    evaluations = 2 * (len(shape.kept) + len(model.inputs))
    return ProjectedVehicle(
        shape,
        system,
        one_window(mean, lift, drop),
        # The wheels' coordinates stay; their speeds are no states.
        n,
        Offline(time.perf_counter() - began, evaluations),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )
