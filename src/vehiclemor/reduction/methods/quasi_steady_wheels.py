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

import time

import numpy as np

from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_vehicle
from vehiclemor.reduction.vehicle.projected_vehicle import one_window, projected_vehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape, spin_angles
from vehiclemor.simulation.dynamic import DynamicModel


def refusal(model: DynamicModel) -> str:
    """Vehicles whose wheels spin are accepted."""
    reason = no_vehicle(model)
    return reason or ("" if len(spin_angles(model)) else f"{model.name} has no wheels that spin")


def fit(model: DynamicModel, training: Training, settings: ProjectedSettings) -> ReducedSystem:
    """Slave the spins by the linearisation; no training run is looked at."""
    began = time.process_time()
    shape, n = VehicleShape(model), len(model.coordinates)
    spins = spin_angles(model) + n
    fast, slow = np.isin(shape.kept, spins), ~np.isin(shape.kept, spins)
    a = shape.linearised.a
    slaved = -np.linalg.solve(a[np.ix_(fast, fast)], a[np.ix_(fast, slow)])
    left = np.setdiff1d(np.arange(2 * n), spins)
    trial_basis, test_basis = np.eye(2 * n)[left], np.eye(2 * n)[left]
    rows = np.searchsorted(left, shape.kept[slow])
    trial_basis[np.ix_(rows, shape.kept[fast])] = slaved.T
    # Reduced coordinates are the states themselves: only the spins have a constant part.
    mean = np.zeros(2 * n)
    mean[shape.kept[fast]] = shape.reference[fast] - slaved @ shape.reference[slow]
    spaces = one_window(mean, trial_basis, test_basis)
    further = 2 * (len(shape.kept) + len(model.inputs))
    # All n coordinates are kept, the wheels' angles among them; only their speeds are eliminated.
    cost = offline_cost(began, model, further=further)
    return projected_vehicle(shape, spaces, n, cost, settings)


METHOD = Method(
    name="quasi_steady_wheels",
    summary="spins of the wheels slaved to the other states (singular perturbation)",
    reference="10.1137/1.9781611971118",
    settings=dict.fromkeys(("ode", "dae"), ProjectedSettings),
    refusal=refusal,
    fit=fit,
    learns_from="inputs",
)
