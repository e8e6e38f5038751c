"""Two-track models of a box of cars: terms as for the first one, coefficients of each car's runs.

A car drives inputs of the training in full.  Slips, loads, accelerations and the other states are
fitted to these runs, in closed form, and improved on the runs as a whole; other runs check it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.reduction.car_checks import Input, registered
from vehiclemor.reduction.cars import Cars, cars_of, difference
from vehiclemor.reduction.interface import offline_cost
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle import tire_features as tf
from vehiclemor.reduction.vehicle.own_runs import BELOW, SPEED, UNNAMED
from vehiclemor.reduction.vehicle.reach_of_runs import training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.trajectory_fit import Target, improved, planar_errors, targets
from vehiclemor.reduction.vehicle.two_track_fit import (
    SEEN,
    Chosen,
    Sizes,
    fitted_to,
    free_coefficients,
    lifted_anew,
)
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start, Trajectory

# How a car's own runs are solved.
SOLVER, FINE = "exponential_adams", 1e-6
# Every so many samples of them are fitted to; Gauss-Newton steps on whole runs, once and again.
STRIDE, SWEEPS = 6, 2
# Every so many runs one checks instead.
EVERY = 12
# How many times the error of the first car in the same run, or 1 in the units of `trajectory_fit`,
# that of another car may be.
TRUSTED = 2.0
# Runs are left out that slide sideways so many times as fast as any of the first car, or are so far
# off, in the units of `trajectory_fit`, before the fit to whole runs and after it.
SLIDING, LOST, NEAR = 1.2, 200.0, 20.0
SLIDES = "lateral_speed"
NAME = "two_track"
WRONG = "this car slides or is lost in all of the runs that it would be learnt from"
NOTHING = 1e-6


class Drive(NamedTuple):
    """What each car drives.

    Attributes
    ----------
    input
        Of the training.
    faster
        How much faster (m/s) than straight running it is driven.
    error
        Of heading and place by the first car's model, in the units of `trajectory_fit`.
    """

    input: Input
    faster: float
    error: float


class Driven(NamedTuple):
    """A run of a car, and the first car's error in it."""

    run: TrainingRun
    true: Trajectory
    error: float


@dataclass(frozen=True, eq=False)
class Box(ShortRepr):
    """What the models of a box of cars have in common.

    Attributes
    ----------
    cars
        Those of the training.
    sizes, chosen
        Settings of the fit, and terms of the first car's.
    drives
        Inputs of the training.
    sliding
        Lateral speed (m/s) beyond which a run is left out.
    left
        What the first car's lifting leaves of the states of the shape (n,).
    """

    cars: Cars
    sizes: Sizes
    chosen: Chosen
    drives: tuple[Drive, ...]
    sliding: float
    left: np.ndarray

    def driven(self, model: DynamicModel) -> list[Driven]:
        """The runs of a car, but for those in which it slides."""
        starts, found = {}, []
        for drive in self.drives:
            if drive.faster not in starts:
                starts[drive.faster] = start_of(model, drive.faster)
            run = TrainingRun(model, drive.input.made, starts[drive.faster])
            with suppress(ConvergenceError):
                true = model.simulate(run.maneuver, run.start, solver=SOLVER, tolerance=FINE)
                if sideways(model, [true]) <= self.sliding:
                    found.append(Driven(run, true, drive.error))
        return found


@dataclass(frozen=True, eq=False)
class TwoTrackVehicle(ReducedVehicle):
    """The two-track model of a car in a box.

    Attributes
    ----------
    box
        What the cars have in common.
    """

    box: Box | None = None

    def for_car(self, model: DynamicModel) -> ReducedVehicle:
        """The model of another car."""
        if not difference(model, self.model):
            return self
        began, box = time.process_time(), self.box
        assert box is not None
        driven = box.driven(model)
        first = min(EVERY, len(driven)) // 2
        fitting = [entry for i, entry in enumerate(driven) if i % EVERY != first]
        if not fitting:
            raise InputError(f"{NAME}: {WRONG}")
        training, runs = ([getattr(entry, n) for entry in fitting] for n in ("run", "true"))
        reduced, samples = fitted_to(model, runs, box.sizes, dict(box.chosen), STRIDE)
        goals = targets(reduced, training, runs)
        free = free_coefficients(reduced)
        some = within(reduced, goals, LOST)
        for power in (1.0, 2.0):
            reduced = improved(reduced, list(compress(goals, some)), free, SWEEPS, power)
        some = within(reduced, goals, NEAR)
        near, runs_near = (list(compress(of, some)) for of in (training, runs))
        rows = np.repeat(some, [len(run.time[::STRIDE]) for run in runs])
        reduced = lifted_anew(reduced, near, samples.at(rows), STRIDE)
        reduced = replace(
            reduced,
            reach=training_reach(reduced, near, runs_near),
            offline=offline_cost(began, model, runs, len(samples.inputs)),
            solver=self.solver,
            tolerance=self.tolerance,
        )
        reduced.parameters[0] = 1.0 / right(reduced, driven, box.left)
        return in_box(reduced, box)


def within(reduced: ReducedVehicle, goals: Sequence[Target], most: float) -> np.ndarray:
    """Which runs are no further off than that.

    Raises
    ------
    InputError
        If none is.
    """
    found = planar_errors(reduced, goals) < most
    if not found.any():
        raise InputError(f"{NAME}: {WRONG}")
    return found


def right(reduced: ReducedVehicle, driven: Sequence[Driven], left: np.ndarray) -> float:
    """Part of what a model knows up to which no run of its car is wrong, at most 1."""
    seen, own = [reduced.shape.names.index(name) for name in SEEN], reduced.reach.left
    if not len(own) or (own[seen] > TRUSTED * left[seen]).any():
        return NOTHING
    goals = targets(reduced, [entry.run for entry in driven], [entry.true for entry in driven])
    found = 1.0
    for entry, error in zip(driven, planar_errors(reduced, goals), strict=True):
        if error > TRUSTED * max(entry.error, 1.0):
            trust = reduced.simulate(entry.run.maneuver, entry.run.start).trust
            found = min(found, BELOW * trust.indicator) if trust else NOTHING
    return max(found, NOTHING)


def start_of(model: DynamicModel, faster: float) -> Start:
    """Straight running so much faster (m/s) than the model's own, if it has an initial speed."""
    if SPEED not in model.parameters.entries:
        return model.starts[0]
    return reparametrised(model, {SPEED: float(model.parameters[SPEED]) + faster}).start()


def sideways(model: DynamicModel, runs: Sequence[Trajectory]) -> float:
    """Largest lateral speed in runs in m/s."""
    column = model.outputs.index(SLIDES)
    return max(float(np.abs(run.outputs[:, column]).max()) for run in runs)


def in_box(reduced: ReducedVehicle, box: Box) -> TwoTrackVehicle:
    """A model as one of a box."""
    fields = ReducedVehicle.__dataclass_fields__
    return TwoTrackVehicle(**{name: getattr(reduced, name) for name in fields}, box=box)


def box_of(
    reduced: ReducedVehicle,
    training: Training,
    own: Sequence[TrainingRun],
    runs: Sequence[Trajectory],
    fit: tuple[Sizes, Chosen],
) -> Box:
    """What other cars need of the first one's fit to its own runs, among the training."""
    drives, errors = [], planar_errors(reduced, targets(reduced, own, runs))
    for run, true, error in zip(own, runs, errors, strict=True):
        if entry := registered(run.maneuver):
            faster = float(reduced.encoded(true.states[0], true.inputs[0])[tf.SPEED])
            drives.append(Drive(entry, round(faster, 6), float(error)))
    if not drives:
        raise InputError(UNNAMED)
    cars, sliding = cars_of(run.model for run in training), sideways(reduced.model, runs)
    return Box(cars, *fit, tuple(drives), SLIDING * sliding, reduced.reach.left)
