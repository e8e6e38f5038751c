"""Slow manifolds of a box of cars: terms chosen once, and each car fitted to runs of its own.

What is exact at straight running is that of each car: its slow modes, how they are steered, slips
and roll by them, what a start excites.  Nonlinear coefficients begin as linear functions of the
place in the box, found from runs of all cars together; a few runs of the car itself correct them.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.reduction.car_checks import Input
from vehiclemor.reduction.cars import Cars, cars_of, difference
from vehiclemor.reduction.interface import offline_cost
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.landing import after_landing, landed
from vehiclemor.reduction.vehicle.own_runs import chosen_inputs, corrected, own_runs
from vehiclemor.reduction.vehicle.reach_of_runs import training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_features import (
    FeatureTable,
    Ranges,
    arguments_of,
    feature_parameters,
    ranges_of,
)
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, as_of
from vehiclemor.reduction.vehicle.trajectory_fit import (
    Target,
    changed,
    finished,
    improved_together,
    targets,
)
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

# Gauss-Newton steps of the common fit.
SWEEPS = 6
# Part of the ranges up to which a car is trusted of which nothing is known.
NOTHING = 1e-6
# Solver and tolerance of runs of a car, and of their reduced ones; weight of its lifting's size.
ACCURATE = "exponential_adams", 1e-6
FINE, RIDGE = 1e-6, 1e-10
# Time (s) before a car is steered, in which its starts are seen, and samples in it.
STILL, SAMPLES = 1.0, 101


class Member(NamedTuple):
    """A car with some of its runs."""

    training: Sequence[TrainingRun]
    runs: Sequence[Trajectory]
    shape: VehicleShape
    modes: SlowModes

    @property
    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Deviations of the shape (samples, n) and inputs, after landing."""
        shape, runs = self.shape, self.runs
        later = [after_landing(self.modes.symmetric, shape, run) for run in runs]
        deviations = [shape.of(run.states) - shape.reference for run in later]
        return np.vstack(deviations), np.vstack([run.inputs for run in later])

    @property
    def ranges(self) -> Ranges:
        """Ranges of its runs."""
        return ranges_of(self.shape, self.modes, *self.samples)

    def within(self, table: FeatureTable) -> tuple[Member, np.ndarray]:
        """The car with its runs that stay within ranges, and the part of these that each uses.

        With the same steering a car may be near its limit where others are not.
        """
        training, runs, used = [], [], []
        for given, run in zip(self.training, self.runs, strict=True):
            deviations = self.shape.of(run.states) - self.shape.reference
            arguments = arguments_of(self.shape, self.modes, deviations, run.inputs)
            parts = np.abs(arguments).max(axis=0) / table.ranges.arguments
            if parts[:-1].max() <= 1.0:
                training.append(given)
                runs.append(run)
                used.append(parts.max())
        return self._replace(training=training, runs=runs), np.array(used)

    def goals(self, vehicle: ReducedVehicle) -> list[Target]:
        """Its runs as those of a reduced vehicle of it should be."""
        # States on the way are no starts.
        plain = replace(vehicle, encoding=np.vstack([self.modes.left, self.modes.speed_left]))
        return targets(plain, self.training, self.runs)

    def lifting(self, vehicle: ReducedVehicle) -> np.ndarray:
        """Coefficients (terms, n) with which the shape follows its runs best."""
        deviations, u = self.samples
        z = np.column_stack(self.modes.coordinates(deviations, u))
        features = vehicle.lifted_features or vehicle.features
        return ridge_fit(feature_columns(features, z, u, vehicle.parameters), deviations, RIDGE)


def own_and_others(model: DynamicModel, training: Training) -> tuple[Training, list[Training]]:
    """Training runs of a car, and those of each other one.

    Raises
    ------
    InputError
        If none is of the car.
    """
    own = [run for run in training if not difference(model, run.model)]
    if not own:
        raise InputError(
            "slow_manifold must be trained on the car it is tested on; no training run is of it "
            '(cars = "nominal" trains on the model\'s own car alone)'
        )
    if len(own) == len(training):
        return own, []
    cars = cars_of(run.model for run in training)
    groups: dict[int, list[TrainingRun]] = {}
    for number, run in zip(cars.numbers(run.model for run in training), training, strict=True):
        groups.setdefault(number, []).append(run)
    known = cars.numbers([model])[0]
    return own, [runs for number, runs in groups.items() if number != known]


def member(training: Training, like: SlowModes) -> Member:
    """A car by its runs, but those that fail, in coordinates like those of the first one."""
    model = cast("DynamicModel", training[0].model)
    shape, finished, runs = VehicleShape(model), [], []
    for run in training:
        with suppress(ConvergenceError):
            runs.append(model.simulate(run.maneuver, run.start, run.maneuver.times, *ACCURATE))
            finished.append(run)
    return Member(finished, runs, shape, as_of(shape, like))


@dataclass(frozen=True, eq=False)
class Box(ShortRepr):
    """What the reduced models of a box of cars have in common.

    Attributes
    ----------
    cars
        Those of the training.
    table, modes, turning
        Features and slow modes of the first one, how it turns without lag, see
        `FeatureTable.turning`.
    coefficients, changes
        Coefficients (terms, states + 3) of the first car, and their changes (1 + varied, free
        coefficients): for all cars, and for each unit of a car's place in the box.
    inputs
        Of runs of each car itself, see `own_runs`.
    """

    cars: Cars
    table: FeatureTable
    modes: SlowModes
    turning: np.ndarray
    coefficients: np.ndarray
    changes: np.ndarray
    inputs: tuple[Input, ...]


@dataclass(frozen=True, eq=False)
class SlowVehicle(ReducedVehicle):
    """A reduced vehicle of a box of cars."""

    box: Box | None = None

    def for_car(self, model: DynamicModel) -> ReducedVehicle:
        """The reduced vehicle of another car."""
        assert self.box is not None
        began, box = time.process_time(), self.box
        table = box.table
        own = member(own_runs(model, box.inputs, table.ranges.speed), box.modes)
        known, shares = own.within(table)
        fitted = replace(self, coefficients=box.coefficients, solver="dopri5", tolerance=FINE)
        found = of_car(fitted, table, box.turning, own)
        found = changed(found, table.free, _row(box.cars.place(model)) @ box.changes)
        right = 0.0
        if known.runs:
            found, right = corrected(found, known.goals(found), shares, table.free)
            found = replace(found, lifting=known.lifting(found))
            found = replace(found, reach=training_reach(found, known.training, known.runs))
        found.parameters[-1] = table.hull / np.clip(right, NOTHING, table.trusted)
        return replace(
            found,
            solver=self.solver,
            tolerance=self.tolerance,
            offline=offline_cost(began, model, own.runs),
        )


def of_car(
    fitted: ReducedVehicle, table: FeatureTable, turning: np.ndarray, car: Member
) -> ReducedVehicle:
    """A fitted vehicle with all that is exact for another car."""
    shape, modes = car.shape, car.modes
    c, k, n = fitted.coefficients.copy(), modes.lateral, len(modes.rates)
    table.set_linear(c, shape, modes)
    c[np.ix_(table.odd[: k + 1], [n + 1, n + 3])] += table.turning(shape, modes) - turning
    inputs = np.zeros(len(shape.model.inputs))
    found = replace(
        fitted,
        model=shape.model,
        shape=shape,
        parameters=feature_parameters(shape, modes, table.ranges, table.hull, table.trusted),
        coefficients=c,
        encoding=np.vstack([modes.left, modes.speed_left]),
        feedthrough=np.vstack([modes.feedthrough, inputs]),
        transient=modes.symmetric,
    )
    return landed(found, modes, _before_steering(shape.model))


def _before_steering(model: DynamicModel) -> list[Trajectory]:
    """Runs from all starts, before the model's own maneuver steers."""
    maneuver = component("maneuver", model.definition.maneuver)
    times = np.linspace(0.0, min(STILL, maneuver.duration), SAMPLES)
    return [model.simulate(maneuver, start, times) for start in model.starts]


def fitted_box(
    first: ReducedVehicle,
    table: FeatureTable,
    training: Training,
    members: Sequence[Member],
) -> SlowVehicle:
    """The first car's reduced vehicle with what those of the others begin from.

    Parameters
    ----------
    first
        Fitted to the first car, which is the first of the members.
    table
        Its features.
    training
        All runs of the first car.
    """
    cars = cars_of(m.shape.model for m in members)
    rows = np.array([_row(place) for place in cars.places(cars.values)])
    turning = table.turning(members[0].shape, members[0].modes)
    vehicles, goals = [], []
    for m in members:
        vehicle = of_car(first, table, turning, m)
        goals.append(finished(vehicle, m.within(table)[0].goals(vehicle)))
        vehicles.append(vehicle)
    some = [number for number, own in enumerate(goals) if own]
    vehicles, goals = ([part[i] for i in some] for part in (vehicles, goals))
    changes = improved_together(vehicles, goals, rows[some], table.free, SWEEPS, 1.0)
    inputs = chosen_inputs(training)
    common = table, members[0].modes, turning, first.coefficients, changes, inputs
    parts = {name: getattr(first, name) for name in first.__dataclass_fields__}
    return SlowVehicle(**parts, box=Box(cars, *common))


def _row(place: np.ndarray) -> np.ndarray:
    """Row (1 + varied,) of a linear function of a place."""
    return np.append(1.0, place)
