"""Slow-manifold regression: the slow modes of a vehicle with a fitted nonlinear right-hand side.

Fast motion (hop, spins of the wheels, constraints) follows the slow one: trajectories soon lie on a
curved slow manifold (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98; P. Kokotovic, H. Khalil,
J. O'Reilly, Singular Perturbation Methods in Control, SIAM 1999).  Projection on a linear subspace
can't follow its curvature; here the rates of the slow coordinates are fitted on training runs,
which lie on it, and the lag of the fast modes is learnt with them:

    z' = Lambda z + b u + N(z, speed, u)

Lambda and b are exact at straight running.  N is odd in the lateral quantities (the vehicle is its
own mirror image): cubic, and in the axles' slip angles also quintic, terms; the speed and what is
symmetric have even terms.  What whole runs hardly need is eliminated again.  The heading is fitted
twice: as a rate, then as its integral along reduced runs, since a heading that is off is a lateral
position that is off.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method, Offline, offline_cost
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_steered_vehicle
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import PLANAR
from vehiclemor.reduction.vehicle.landing import landed, starts_still
from vehiclemor.reduction.vehicle.pruning import pruned
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import ShapeSamples, VehicleShape, shape_samples
from vehiclemor.reduction.vehicle.slow_features import FeatureTable, feature_table
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, slow_modes
from vehiclemor.reduction.vehicle.trajectory_fit import Target, finishes, improved, targets
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

# Accuracy of the reduced runs on which the heading is fitted.
REFIT_TOLERANCE = 1e-6
REFIT_RIDGE = 1e-9
# Sweeps with all terms, and the part of them that is left by each round of elimination.
FIRST_SWEEPS, SHRINKING = 2, 0.4


class SlowManifoldSettings(OnlineSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    nonlinearity: Literal["cubic", "quintic", "sliding", "rich"] = Field(
        "quintic",
        description="of the lateral terms: cubic; quintic in slip angles too; sliding: and |slip| "
        "slip terms; rich: and cubic terms that change with the speed",
    )
    ridge: float = Field(1e-10, ge=0.0, description="weight of the coefficients' size in the fit")
    refits: int = Field(2, ge=0, description="how often the heading is fitted on reduced runs")
    sweeps: int = Field(
        4, ge=0, description="Gauss-Newton steps of all coefficients on whole training runs"
    )
    terms: int = Field(
        20,
        ge=0,
        description="lateral nonlinear terms that the equations keep, those that whole runs need "
        "most, and a quarter as many symmetric ones; 0: all; only with sweeps, which are done "
        "again after it",
    )
    hull: float = Field(
        1.1,
        gt=0.0,
        description="arguments of nonlinear terms are held beyond this multiple of their training "
        "range",
    )
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 2e-3


def fit(model: DynamicModel, training: Training, settings: SlowManifoldSettings) -> ReducedVehicle:
    """Fit the slow dynamics and the manifold on the training runs."""
    began = time.process_time()
    everything = [(run, run.recorded()) for run in training]
    shape = VehicleShape(model)
    modes = slow_modes(shape, settings.fastest)
    still = [starts_still(modes.symmetric, shape, true) for _, true in everything]
    training = [run for (run, _), quiet in zip(everything, still, strict=True) if quiet]
    runs = [true for (_, true), quiet in zip(everything, still, strict=True) if quiet]
    samples = shape_samples(shape, runs)
    table = feature_table(shape, modes, samples, settings.hull, settings.nonlinearity)
    reduced = _fitted_on_rates(shape, modes, table, samples, settings.ridge)
    for _ in range(settings.refits):
        reduced = _with_heading(reduced, training, runs, table.odd, len(modes.rates) + 1)
    if settings.sweeps:
        goals = targets(reduced, training, runs)
        reduced = _fitted_on_runs(reduced, table, goals, settings)
    return replace(
        landed(reduced, [true for _, true in everything]),
        offline=offline_cost(began, model, [true for _, true in everything], len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def _fitted_on_rates(
    shape: VehicleShape, modes: SlowModes, table: FeatureTable, samples: ShapeSamples, ridge: float
) -> ReducedVehicle:
    """Equations fitted on the rates of the training runs, exact at straight running."""
    u, motion = samples.inputs, samples.motion
    z, speed = modes.coordinates(samples.deviations, u)
    k, inputs = len(modes.rates), u.shape[1]
    odd, even = table.odd, table.even
    odd_nonlinear, even_nonlinear = table.odd_nonlinear, table.even_nonlinear
    columns = feature_columns(table.features, np.column_stack([z, speed]), u, table.parameters)
    slow_rates = samples.rates @ modes.left.T - u[:, 1:] @ modes.feedthrough[:, : inputs - 1].T
    linear = z @ modes.rates.T + np.outer(u[:, 0], modes.drive)
    c = np.zeros((len(table.features.terms), k + 1 + PLANAR))
    c[odd_nonlinear, :k] = ridge_fit(columns[:, odd_nonlinear], slow_rates - linear, ridge)
    # Linear terms are scaled by the ranges of the training runs.
    c[odd[:k], :k] = modes.rates.T * largest(z)[:, None]
    c[odd[k], :k] = modes.drive * largest(u)[0]
    # Straight running at any speed is an equilibrium: the speed changes by even terms alone.
    even_columns = columns[:, even_nonlinear]
    c[even_nonlinear, k] = ridge_fit(even_columns, samples.rates @ modes.speed_left, ridge)
    c[odd, k + 1] = ridge_fit(columns[:, odd], motion[:, 0], ridge)
    c[even[0], k + 2], c[even[1], k + 2] = shape.speed, 1.0
    forward = motion[:, 1] - shape.speed - speed
    c[even_nonlinear, k + 2] = ridge_fit(even_columns, forward, ridge)
    c[odd, k + 3] = ridge_fit(columns[:, odd], motion[:, 2], ridge)
    return ReducedVehicle(
        shape.model,
        shape,
        table.features,
        table.parameters,
        c,
        ridge_fit(columns, samples.deviations, ridge),
        np.vstack([modes.left, modes.speed_left]),
        np.vstack([modes.feedthrough, np.zeros(inputs)]),
        np.concatenate([3.0 * largest(z), [10.0, 1.0, 10.0, 10.0]]),
        Offline(),
        "dopri5",
        REFIT_TOLERANCE,
        modes.symmetric,
    )


def _fitted_on_runs(
    reduced: ReducedVehicle,
    table: FeatureTable,
    goals: Sequence[Target],
    settings: SlowManifoldSettings,
) -> ReducedVehicle:
    """Coefficients improved on whole runs; then with as few terms as the settings allow."""
    if not finishes(reduced, goals):
        return reduced
    reduced = improved(reduced, goals, table.free, FIRST_SWEEPS)
    count = len(table.odd_nonlinear) + len(table.even_nonlinear)
    while settings.terms and count > settings.terms:
        count = max(settings.terms, round(SHRINKING * count))
        fewer, table = pruned(reduced, table, goals, count)
        fewer = improved(fewer, goals, table.free, 1)
        # With too few terms a training run may fail.
        if not finishes(fewer, goals):
            return reduced
        reduced = fewer
    return improved(reduced, goals, table.free, settings.sweeps)


def _with_heading(
    reduced: ReducedVehicle,
    training: Training,
    runs: Sequence[Trajectory],
    odd: Sequence[int],
    column: int,
) -> ReducedVehicle:
    """The heading's coefficients fitted on its integral along reduced training runs."""
    integrals, headings = [], []
    k, heading = reduced.features.states, reduced.model.planar[2]
    for run, true in zip(training, runs, strict=True):
        path = reduced.path(run.maneuver, run.start)
        if path is None:
            continue
        columns = feature_columns(reduced.features, path[:, :k], true.inputs, reduced.parameters)[
            :, odd
        ]
        steps = np.diff(true.time)[:, None]
        sums = np.cumsum(0.5 * steps * (columns[1:] + columns[:-1]), axis=0)
        integrals.append(np.vstack([np.zeros(len(odd)), sums]))
        headings.append(true.states[:, heading] - true.states[0, heading])
    if not integrals:
        return reduced
    along = np.concatenate(integrals)
    gap = np.concatenate(headings) - along @ reduced.coefficients[odd, column]
    coefficients = reduced.coefficients.copy()
    coefficients[odd, column] += ridge_fit(along, gap, REFIT_RIDGE)
    return replace(reduced, coefficients=coefficients)


METHOD = Method(
    name="slow_manifold",
    summary="slow modes with a right-hand side fitted on training runs, fast motion slaved",
    reference="10.1137/1.9781611971118",
    settings=dict.fromkeys(("ode", "dae"), SlowManifoldSettings),
    refusal=no_steered_vehicle,
    fit=fit,
)
