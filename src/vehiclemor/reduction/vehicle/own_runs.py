"""A few runs of a car itself: they settle what a fit for many cars leaves open, and check it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.car_checks import Input, registered
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.trajectory_fit import (
    Free,
    Target,
    finished,
    improved,
    planar_errors,
    spread,
)
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start

# Runs of a car; one of so many only checks, the others correct too; Gauss-Newton steps of that.
RUNS, CHECKED, STEPS = 64, 4, 2
# Their speeds, in parts of how far those of training runs lie from the car's own; the last of them
# goes with the other starts.
SPEEDS = (-0.8, 0.0, 0.8, -0.4, 0.4)
# Error of heading and place from which on a run is wrong, in the units of `trajectory_fit`.
TRUSTED = 1.0
# Part of what a wrong run uses that is right.
BELOW = 0.95


SPEED = "initial_speed"
UNNAMED = "cars: each drives inputs of the training, but none of them is a registered maneuver"


def chosen_inputs(training: Training) -> tuple[Input, ...]:
    """Some inputs of the training, that are registered maneuvers.

    Raises
    ------
    InputError
        If none is.
    """
    known = list(dict.fromkeys(filter(None, (registered(run.maneuver) for run in training))))
    if not known:
        raise InputError(UNNAMED)
    return tuple(spread(known, RUNS / max(len(known), 1)))


def own_runs(model: DynamicModel, inputs: Sequence[Input], speeds: float) -> list[TrainingRun]:
    """Runs of a car by these inputs, at several speeds and from all starts.

    Parameters
    ----------
    speeds
        How far speeds of the training lie from the car's own in m/s.
    """
    others, last, found = model.starts[1:] or model.starts, len(SPEEDS) - 1, []
    for number, entry in enumerate(inputs):
        turn, kind = divmod(number, len(SPEEDS))
        name = others[turn % len(others)] if kind == last else model.starts[0]
        start = _start(model, name, SPEEDS[kind] * speeds)
        found.append(TrainingRun(model, entry.made, start))
    return found


def corrected(
    reduced: ReducedVehicle, goals: Sequence[Target], shares: np.ndarray, free: Free
) -> tuple[ReducedVehicle, float]:
    """A reduced vehicle corrected by its car's own runs, and how far it is right.

    Parameters
    ----------
    shares
        Largest part of the ranges of the training that each run uses (goals,).  It is right up to
        what the wrong ones use; infinite if none is.
    """
    others = [goal for number, goal in enumerate(goals) if (number + 1) % CHECKED]
    if correcting := finished(reduced, others):
        reduced = improved(reduced, correcting, free, STEPS, 1.0)
    wrong = planar_errors(reduced, goals) > TRUSTED
    return reduced, BELOW * float(shares[wrong].min(initial=np.inf))


def _start(model: DynamicModel, name: str, faster: float) -> Start:
    """A start, so much faster, of a model that has an initial speed."""
    if SPEED not in model.parameters.entries:
        return model.start(name)
    return reparametrised(model, {SPEED: float(model.parameters[SPEED]) + faster}).start(name)
