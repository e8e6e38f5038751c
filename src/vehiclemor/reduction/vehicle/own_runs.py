"""A few runs of a car itself: they settle what a fit for many cars leaves open, and check it.

The coefficients that a box of cars predicts are a prior, as sure as runs of the training have made
them; Gauss-Newton on the car's own runs corrects them where these say otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
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
from vehiclemor.registry import component
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start

# Runs that correct a car's model, and further ones that check it; steps of the correction.
CORRECTING, CHECKING, STEPS = 26, 4, 2
# Their speeds lie apart by this part of how far training runs do.
APART = 0.8
# Weight of the prior, of one run of the training each.
PRIOR = 0.3
# How many times the first car's error on the same run, or 1 in the units of `trajectory_fit`, that
# of another car may be.
TRUSTED = 2.0


SPEED = "initial_speed"


class Input(NamedTuple):
    """A registered maneuver with its factors."""

    maneuver: str
    frequency: float
    amplitude: float

    @property
    def made(self) -> Maneuver:
        """The maneuver itself."""
        return component("maneuver", self.maneuver).perturbed(self.frequency, self.amplitude)


def chosen_inputs(training: Training) -> tuple[Input, ...]:
    """Some inputs of the training, that are registered maneuvers."""
    given = [
        Input(m.name, m.frequency_factor, m.amplitude_factor)
        for m in (run.maneuver for run in training)
    ]
    known = [entry for entry in dict.fromkeys(given) if _registered(entry)]
    return tuple(spread(known, (CORRECTING + CHECKING) / max(len(known), 1)))


def _registered(entry: Input) -> bool:
    try:
        return bool(entry.made.samples)
    except InputError:
        return False


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


def doubt(errors: np.ndarray, first: np.ndarray) -> str:
    """Why a car is not trusted, by its errors on the checking runs and those of the first car."""
    worst = float(np.max(errors / np.maximum(first, 1.0), initial=0.0))
    if worst <= TRUSTED:
        return ""
    return f"errors in runs that check this car, {worst:.2g} times those of the first car"


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
