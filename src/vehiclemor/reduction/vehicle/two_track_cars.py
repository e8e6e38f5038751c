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
from vehiclemor.reduction.cars import Cars, cars_of, difference
from vehiclemor.reduction.interface import offline_cost
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle import tire_features as tf
from vehiclemor.reduction.vehicle.own_runs import SPEED, Input, doubt
from vehiclemor.reduction.vehicle.reach_of_runs import training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.trajectory_fit import improved, run_errors, targets
from vehiclemor.reduction.vehicle.two_track_fit import (
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
SOLVER, FINE = "exponential_adams", 1e-7
# Every so many samples of them are fitted to; Gauss-Newton steps on whole runs.
STRIDE, SWEEPS = 4, 4
# Every so many runs one checks instead.
EVERY = 12
# Runs that slide sideways so many times as fast as any of the first car are left out, and those of
# which the first guess is so far off, in the units of `trajectory_fit`.
SLIDING, LOST = 1.2, 200.0
SLIDES = "lateral_speed"


class Drive(NamedTuple):
    """An input of the training, and how much faster (m/s) than straight running it is driven."""

    input: Input
    faster: float


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
        What each car drives.
    sliding
        Lateral speed (m/s) beyond which a run is left out.
    """

    cars: Cars
    sizes: Sizes
    chosen: Chosen
    drives: tuple[Drive, ...]
    sliding: float

    def driven(self, model: DynamicModel) -> list[tuple[TrainingRun, Trajectory]]:
        """The runs of a car, but for those in which it slides."""
        starts, found = {}, []
        for drive in self.drives:
            if drive.faster not in starts:
                starts[drive.faster] = start_of(model, drive.faster)
            run = TrainingRun(model, drive.input.made, starts[drive.faster])
            with suppress(ConvergenceError):
                true = model.simulate(run.maneuver, run.start, solver=SOLVER, tolerance=FINE)
                if sideways(model, [true]) <= self.sliding:
                    found.append((run, true))
        return found


@dataclass(frozen=True, eq=False)
class TwoTrackVehicle(ReducedVehicle):
    """The two-track model of a car in a box."""

    box: Box | None = None

    def for_car(self, model: DynamicModel) -> ReducedVehicle:
        """The model of another car."""
        if not difference(model, self.model):
            return self
        began, box = time.process_time(), self.box
        assert box is not None
        found = box.driven(model)
        first = min(EVERY, len(found)) // 2
        checking = found[first::EVERY]
        fitting = [entry for i, entry in enumerate(found) if i % EVERY != first]
        if not fitting:
            raise InputError(f"this {model.name} slides in the runs that it would be learnt from")
        training, runs = zip(*fitting, strict=True)
        reduced, samples = fitted_to(model, runs, box.sizes, dict(box.chosen), STRIDE)
        free = free_coefficients(reduced)
        goals = targets(reduced, training, runs)
        some = list(compress(goals, run_errors(reduced, goals) < LOST))
        reduced = improved(reduced, some, free, SWEEPS, power=1.0)
        reduced = lifted_anew(reduced, training, samples, STRIDE)
        near = run_errors(reduced, goals) < LOST
        reduced = replace(
            reduced,
            reach=training_reach(reduced, *(list(compress(of, near)) for of in (training, runs))),
            offline=offline_cost(began, model, runs, len(samples.inputs)),
            solver=self.solver,
            tolerance=self.tolerance,
        )
        errors = errors_where_trusted(reduced, *zip(*checking, strict=True))
        return in_box(replace(reduced, doubt=doubt(errors, np.ones(len(errors)))), box)


def errors_where_trusted(
    reduced: ReducedVehicle, training: Training, runs: Sequence[Trajectory]
) -> np.ndarray:
    """Errors of runs, in the units of `trajectory_fit`; zero where the model warns itself."""
    told = [reduced.simulate(run.maneuver, run.start).status == "ok" for run in training]
    return np.where(told, run_errors(reduced, targets(reduced, training, runs)), 0.0)


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
    drives = []
    for run, true in zip(own, runs, strict=True):
        m = run.maneuver
        entry = Input(m.name, m.frequency_factor, m.amplitude_factor)
        with suppress(InputError):
            if entry.made.samples:
                faster = float(reduced.encoded(true.states[0], true.inputs[0])[tf.SPEED])
                drives.append(Drive(entry, round(faster, 6)))
    cars = cars_of(run.model for run in training)
    return Box(cars, *fit, tuple(dict.fromkeys(drives)), SLIDING * sideways(reduced.model, runs))
