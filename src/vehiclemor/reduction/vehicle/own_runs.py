"""A few runs of a car itself: they settle what a fit for many cars leaves open, and check it.

The coefficients that a box of cars predicts are a prior, as sure as runs of the training have made
them; Gauss-Newton on the car's own runs corrects them where these say otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.car_checks import CHECKING, Input, registered
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.trajectory_fit import (
    Free,
    Target,
    changed,
    normal_equations,
    run_errors,
    spread,
    targets,
)
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start

# Runs that correct a car's model, beside those that check it; steps of the correction.
CORRECTING, STEPS = 26, 2
# Their speeds lie apart by this part of how far training runs do.
APART = 0.8
# Weight of the prior, of one run of the training each.
PRIOR = 0.3
SPEED = "initial_speed"


def chosen_inputs(training: Training) -> tuple[Input, ...]:
    """Some inputs of the training, that are registered maneuvers."""
    given = [registered(run.maneuver) for run in training]
    known = [entry for entry in dict.fromkeys(given) if entry]
    return tuple(spread(known, (CORRECTING + CHECKING) / max(len(known), 1)))


def corrected(
    reduced: ReducedVehicle,
    plain: ReducedVehicle,
    inputs: Sequence[Input],
    free: Free,
    prior: np.ndarray,
    speeds: float,
) -> tuple[ReducedVehicle, np.ndarray]:
    """A reduced vehicle corrected by its car's own runs, and its errors on others.

    Parameters
    ----------
    plain
        The same, as states are encoded that are no starts.
    prior
        Normal matrix of a run of the training.
    speeds
        How far speeds of the training lie from the car's own in m/s.
    """
    model = reduced.model
    starts = [_start(model, APART * speeds * k) for k in (-1, 0, 1)]
    runs = [
        TrainingRun(model, entry.made, starts[i % len(starts)]) for i, entry in enumerate(inputs)
    ]
    if len(runs) <= CHECKING:
        return reduced, np.zeros(0)
    goals = targets(plain, runs, [run.recorded() for run in runs])
    every = len(goals) // CHECKING
    checking = goals[::every][:CHECKING]
    correcting = [goal for goal in goals if not any(goal is other for other in checking)]
    online = {"solver": reduced.solver, "tolerance": reduced.tolerance}
    fine = replace(reduced, solver=plain.solver, tolerance=plain.tolerance)
    for _ in range(STEPS):
        fine = _stepped(fine, correcting, free, prior)
    return replace(fine, **online), run_errors(fine, checking)


def _start(model: DynamicModel, faster: float) -> Start:
    """The first start, so much faster, of a model that has an initial speed."""
    if SPEED not in model.parameters.entries or not faster:
        return model.starts[0]
    return reparametrised(model, {SPEED: float(model.parameters[SPEED]) + faster}).start()


def _stepped(
    reduced: ReducedVehicle, goals: Sequence[Target], free: Free, prior: np.ndarray
) -> ReducedVehicle:
    paths = [reduced.path(goal.run.maneuver, goal.run.start) for goal in goals]
    if any(path is None for path in paths):
        return reduced
    normal, gradient = normal_equations(reduced, goals, [p for p in paths if p is not None], free)
    step = np.linalg.solve(normal + PRIOR * len(goals) * prior, gradient)
    found = changed(reduced, free, -step)
    before, after = (np.sum(run_errors(car, goals) ** 2) for car in (reduced, found))
    return found if after < before else reduced
