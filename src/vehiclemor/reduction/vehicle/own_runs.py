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

# Runs that correct a car's model, and further ones that check it; steps of the correction.
CORRECTING, CHECKING, STEPS = 5, 3, 2
# Weight of the prior, of one run of the training each.
PRIOR = 0.3
# Error of a checking run, in the units of `trajectory_fit`, above which the car's model is not
# trusted.
TRUSTED = 1.0


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
) -> ReducedVehicle:
    """A reduced vehicle corrected by its car's own runs, and not trusted if others say so.

    Parameters
    ----------
    plain
        The same, as states are encoded that are no starts.
    prior
        Normal matrix of a run of the training.
    """
    model = reduced.model
    runs = [TrainingRun(model, entry.made, model.starts[0]) for entry in inputs]
    if len(runs) <= CHECKING:
        return reduced
    goals = targets(plain, runs, [run.recorded() for run in runs])
    # The first ones check: they are no others than the next.
    checking, correcting = goals[::2][:CHECKING], [*goals[1::2], *goals[::2][CHECKING:]]
    online = {"solver": reduced.solver, "tolerance": reduced.tolerance}
    fine = replace(reduced, solver=plain.solver, tolerance=plain.tolerance)
    for _ in range(STEPS):
        fine = _stepped(fine, correcting, free, prior)
    worst = float(np.max(run_errors(fine, checking)))
    doubt = ""
    if not worst <= TRUSTED:
        doubt = f"checked on runs of this car it is off by {worst:.2g} times what is trusted"
    return replace(fine, doubt=doubt, **online)


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
