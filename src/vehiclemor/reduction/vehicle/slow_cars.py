"""Slow manifolds of a box of cars: one fit, and the model of each car in milliseconds.

What is exact at straight running is that of each car: its slow modes, how they are steered, slips
and roll by them, what a start excites.  What is fitted, the nonlinear coefficients and those of the
full states, are polynomials of the place in the box, found from runs of all cars together.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import NamedTuple, cast

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.cars import Cars, cars_of, difference
from vehiclemor.reduction.interface import offline_cost
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import Features
from vehiclemor.reduction.vehicle.landing import after_landing, landed
from vehiclemor.reduction.vehicle.own_runs import Input, chosen_inputs, corrected, doubt
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import ShapeSamples, VehicleShape, shape_samples
from vehiclemor.reduction.vehicle.slow_features import (
    FeatureTable,
    Ranges,
    feature_parameters,
    ranges_of,
)
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, as_of
from vehiclemor.reduction.vehicle.trajectory_fit import (
    changed,
    improved_together,
    normal_matrix,
    spread,
    targets,
)
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

# Gauss-Newton steps of the common fit.
SWEEPS = 6
# Share of the cars that tell how sure the coefficients are; tolerance of runs that correct them.
PRIOR_CARS, FINE = 0.15, 1e-6
# Time (s) before a car is steered, in which its starts are seen, and samples in it.
STILL, SAMPLES = 1.0, 101
RIDGE = 1e-10


class Member(NamedTuple):
    """A car of the training with some of its runs."""

    model: DynamicModel
    training: Sequence[TrainingRun]
    runs: Sequence[Trajectory]
    shape: VehicleShape
    modes: SlowModes

    samples: ShapeSamples

    @property
    def ranges(self) -> Ranges:
        """Ranges of its runs."""
        return ranges_of(self.shape, self.modes, self.samples.deviations, self.samples.inputs)

    def columns(self, features: Features, parameters: np.ndarray) -> np.ndarray:
        """Features (samples, terms) of its samples."""
        u = self.samples.inputs
        z = np.column_stack(self.modes.coordinates(self.samples.deviations, u))
        return feature_columns(features, z, u, parameters)

    @property
    def rates(self) -> np.ndarray:
        """Rates of the slow coordinates and the speed, then psi', U and V (samples, states + 3)."""
        samples, modes = self.samples, self.modes
        slow = samples.rates @ modes.left.T
        further = samples.inputs.shape[1] - 1
        slow -= samples.inputs[:, 1:] @ modes.feedthrough[:, :further].T
        return np.column_stack([slow, samples.rates @ modes.speed_left, samples.motion])


def own_and_others(model: DynamicModel, training: Training) -> tuple[Training, list[Training]]:
    """Training runs of a car, and those of each other one.

    Raises
    ------
    InputError
        If none is of the car.
    """
    own = [run for run in training if not difference(model, run.model)]
    if not own:
        raise InputError("a box of cars is learnt around one of them: no training run is of it")
    if len(own) == len(training):
        return own, []
    cars = cars_of(run.model for run in training)
    groups: dict[int, list[TrainingRun]] = {}
    for number, run in zip(cars.numbers(run.model for run in training), training, strict=True):
        groups.setdefault(number, []).append(run)
    known = cars.numbers([model])[0]
    return own, [runs for number, runs in groups.items() if number != known]


def member(training: Training, like: SlowModes) -> Member:
    """A car by its runs, in coordinates like those of the first one."""
    model = cast("DynamicModel", training[0].model)
    shape = VehicleShape(model)
    modes, runs = as_of(shape, like), [run.recorded() for run in training]
    samples = shape_samples(shape, [after_landing(modes.symmetric, shape, run) for run in runs])
    return Member(model, training, runs, shape, modes, samples)


@dataclass(frozen=True, eq=False)
class Box(ShortRepr):
    """What the reduced models of a box of cars have in common.

    Attributes
    ----------
    cars
        Those of the training.
    table, modes, turning, hull
        Features and slow modes of the first one, how it turns without lag, see
        `FeatureTable.turning`; part of the ranges at which arguments are held.
    degree
        Of the polynomials.
    coefficients
        Changes (monomials, terms, states + 3) of the coefficients.
    lifting
        Coefficients (monomials, terms, n) of the lifting.
    inputs, prior, errors
        Inputs of runs of each car itself, normal matrix of a run of the training, and errors of the
        first car on runs that check; see `own_runs`.
    """

    cars: Cars
    table: FeatureTable
    modes: SlowModes
    turning: np.ndarray
    hull: float
    degree: int
    coefficients: np.ndarray
    lifting: np.ndarray
    inputs: tuple[Input, ...]
    prior: np.ndarray
    errors: np.ndarray

    def monomials(self, model: DynamicModel) -> np.ndarray:
        """Monomials (m,) of the place of a car."""
        return _monomials(self.cars.place(model), self.degree)


@dataclass(frozen=True, eq=False)
class SlowVehicle(ReducedVehicle):
    """A reduced vehicle of a box of cars."""

    box: Box | None = None

    def for_car(self, model: DynamicModel) -> ReducedVehicle:
        """The reduced vehicle of another car."""
        assert self.box is not None
        began = time.process_time()
        box, shape = self.box, VehicleShape(model)
        modes, monomials = as_of(shape, box.modes), box.monomials(model)
        fitted = replace(
            self,
            coefficients=np.tensordot(monomials, box.coefficients, 1),
            lifting=np.tensordot(monomials, box.lifting, 1),
        )
        found = of_car(fitted, box.table, box.hull, box.turning, shape, modes)
        no_input = np.zeros((1, len(model.inputs)))
        left = []
        for name in model.starts:
            state = model.start(name)
            left.append(found.remainder(state[None], no_input, found.excited(state))[0])
        found = replace(found, reach=self.reach.with_starts(np.array(left)))
        plain = replace(_plain(found, modes), solver="dopri5", tolerance=FINE)
        known = box.table.ranges.speed
        found, errors = corrected(found, plain, box.inputs, box.table.free, box.prior, known)
        found = replace(found, offline=offline_cost(began, model))
        if not len(box.errors):
            return replace(found, box=replace(box, errors=errors))
        return replace(found, doubt=doubt(errors, box.errors))


def of_car(
    fitted: ReducedVehicle,
    table: FeatureTable,
    hull: float,
    turning: np.ndarray,
    shape: VehicleShape,
    modes: SlowModes,
) -> ReducedVehicle:
    """A fitted vehicle with all that is exact for another car."""
    c, k, n = fitted.coefficients.copy(), modes.lateral, len(modes.rates)
    table.set_linear(c, shape, modes)
    c[np.ix_(table.odd[: k + 1], [n + 1, n + 3])] += table.turning(shape, modes) - turning
    inputs = np.zeros(len(shape.model.inputs))
    found = replace(
        fitted,
        model=shape.model,
        shape=shape,
        parameters=feature_parameters(shape, modes, table.ranges, hull),
        coefficients=c,
        encoding=np.vstack([modes.left, modes.speed_left]),
        feedthrough=np.vstack([modes.feedthrough, inputs]),
        transient=modes.symmetric,
    )
    return landed(found, modes, _before_steering(shape.model))


def _plain(vehicle: ReducedVehicle, modes: SlowModes) -> ReducedVehicle:
    """The vehicle as it encodes states that are no starts."""
    return replace(vehicle, encoding=np.vstack([modes.left, modes.speed_left]))


def _before_steering(model: DynamicModel) -> list[Trajectory]:
    """Runs from all starts, before the model's own maneuver steers."""
    maneuver = component("maneuver", model.definition.maneuver)
    times = np.linspace(0.0, min(STILL, maneuver.duration), SAMPLES)
    return [model.simulate(maneuver, start, times) for start in model.starts]


def fitted_box(
    first: ReducedVehicle, table: FeatureTable, members: Sequence[Member], hull: float
) -> SlowVehicle:
    """The first car's reduced vehicle with what those of the others follow from.

    Parameters
    ----------
    first
        Fitted to the first car, which is the first of the members.
    table
        Its features.
    """
    cars = cars_of(m.model for m in members)
    places = cars.places(cars.values)
    degree = _degree(*places.shape)
    rows = np.array([_monomials(place, degree) for place in places])
    turning = table.turning(members[0].shape, members[0].modes)
    vehicles, goals = [], []
    for m in members:
        vehicle = of_car(first, table, hull, turning, m.shape, m.modes)
        goals.append(targets(_plain(vehicle, m.modes), m.training, m.runs))
        vehicles.append(vehicle)
    change = _by_rates(vehicles, members, rows, table)
    change = improved_together(vehicles, goals, rows, table.free, SWEEPS, change=change)
    coefficients = np.zeros((rows.shape[1], *first.coefficients.shape))
    coefficients[0] = first.coefficients
    place = 0
    for terms, column in table.free:
        coefficients[:, list(terms), column] += change[:, place : place + len(terms)]
        place += len(terms)
    lifting = _lifting(vehicles, members, rows)
    some = spread(list(zip(vehicles, goals, rows @ change, strict=True)), PRIOR_CARS)
    normals = [normal_matrix(changed(v, table.free, c), own, table.free) for v, own, c in some]
    prior = np.sum(normals, axis=0) / sum(len(own) for _, own, _ in some)
    inputs = chosen_inputs(members[0].training)
    common = table, members[0].modes, turning, hull, degree, coefficients, lifting
    box = Box(cars, *common, inputs, prior, np.zeros(0))
    return SlowVehicle(
        **{name: getattr(first, name) for name in first.__dataclass_fields__}, box=box
    )


def _by_rates(
    vehicles: Sequence[ReducedVehicle],
    members: Sequence[Member],
    rows: np.ndarray,
    table: FeatureTable,
) -> np.ndarray:
    """Change (monomials, free coefficients) with which the rates of all cars fit best."""
    m, terms = rows.shape[1], len(table.features.terms)
    squares = np.zeros((m, terms, m, terms))
    products = np.zeros((m, *vehicles[0].coefficients.shape))
    for vehicle, car, row in zip(vehicles, members, rows, strict=True):
        columns = car.columns(table.features, vehicle.parameters)
        rest = car.rates - columns @ vehicle.coefficients
        part = columns.T @ columns / len(columns)
        squares += np.einsum("i,j,kl->ikjl", row, row, part)
        products += np.einsum("i,kl->ikl", row, columns.T @ rest / len(columns))
    found = []
    for chosen, column in table.free:
        kept = np.ix_(range(m), chosen)
        square = squares[kept][:, :, :, chosen].reshape(m * len(chosen), -1)
        square = square + RIDGE * len(members) * np.eye(len(square))
        found.append(np.linalg.solve(square, products[kept][:, :, column].ravel()).reshape(m, -1))
    return np.hstack(found)


def _lifting(
    vehicles: Sequence[ReducedVehicle], members: Sequence[Member], rows: np.ndarray
) -> np.ndarray:
    """Coefficients (monomials, terms, n) of the lifting, by the runs of all cars."""
    features = vehicles[0].lifted_features or vehicles[0].features
    terms, m, n = len(features.terms), rows.shape[1], len(vehicles[0].shape.kept)
    normal, values = np.zeros((m * terms, m * terms)), np.zeros((m * terms, n))
    for vehicle, car, row in zip(vehicles, members, rows, strict=True):
        columns, deviations = car.columns(features, vehicle.parameters), car.samples.deviations
        normal += np.kron(np.outer(row, row), columns.T @ columns) / len(columns)
        values += np.kron(row[:, None], columns.T @ deviations) / len(columns)
    normal += RIDGE * len(members) * np.eye(len(normal))
    return np.linalg.solve(normal, values).reshape(m, terms, n)


def _degree(cars: int, varied: int) -> int:
    """Highest degree (2, 1 or 0) of a polynomial that so many cars determine."""
    if cars >= (varied + 1) * (varied + 2) // 2:
        return 2
    return 1 if cars > varied else 0


def _monomials(place: np.ndarray, degree: int) -> np.ndarray:
    """1, x_i, and products x_i x_j up to a degree."""
    found = [1.0]
    for power in range(1, degree + 1):
        found += [float(np.prod(part)) for part in combinations_with_replacement(place, power)]
    return np.array(found)
