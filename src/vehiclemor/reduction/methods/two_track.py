"""Two-track model with roll: exact tires at quasi-static slips and wheel loads, fitted to runs.

Lateral speed, yaw rate, roll and speed are the slow motion of a vehicle; hop, spins and linkages
follow it (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98).  So the slip and the load of every wheel
are functions of the slow motion and of the steering, and the tires' own law makes forces of them
(two-track model with load transfer: M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 5th
ed., Springer 2014).  The accelerations are linear in these forces, in the coordinates and the
steering, and in a few products that are chosen one after the other; their coefficients are fitted
to the accelerations of training runs, then to whole runs.
"""

import time
from dataclasses import replace

from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.reach_of_runs import training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import no_steered_vehicle
from vehiclemor.reduction.vehicle.trajectory_fit import improved, targets
from vehiclemor.reduction.vehicle.two_track_fit import (
    COORDINATES,
    TwoTrackSettings,
    fitted_to,
    free_coefficients,
    lifted_anew,
    straight,
)
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model


def refusal(model: Model) -> str:
    """Why a model has not the coordinates or the tires."""
    if reason := no_steered_vehicle(model):
        return reason
    known = (*model.coordinates, *model.speeds, *model.parameters.entries)
    missing = [name for name in (*COORDINATES, *FIALA) if name not in known]
    return f"{model.name} has no {', '.join(missing)}" if missing else ""


def fit(model: DynamicModel, training: Training, settings: TwoTrackSettings) -> ReducedVehicle:
    """Fit slips, loads, accelerations and the other states to the training runs."""
    began = time.process_time()
    own = straight(model, training)
    runs = [run.recorded() for run in own]
    reduced, samples = fitted_to(model, runs, settings)
    if settings.sweeps:
        goals = targets(reduced, own, runs, stride=1)
        free = free_coefficients(reduced)
        reduced = improved(reduced, goals, free, settings.sweeps, power=1.0)
        reduced = improved(reduced, goals, free, settings.sweeps)
        reduced = lifted_anew(reduced, own, samples)
    return replace(
        reduced,
        reach=training_reach(reduced, own, runs),
        offline=offline_cost(began, model, runs, len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


METHOD = Method(
    name="two_track",
    summary="two-track model with roll: exact tires at fitted slips and wheel loads",
    reference="10.1007/978-3-658-05068-9",
    settings=dict.fromkeys(("ode", "dae"), TwoTrackSettings),
    refusal=refusal,
    fit=fit,
)
