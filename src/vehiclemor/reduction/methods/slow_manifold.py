"""Slow-manifold regression: the slow modes of a vehicle with a fitted nonlinear right-hand side.

Fast motion (hop, spins of the wheels, constraints) follows the slow one: trajectories soon lie on a
curved slow manifold (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98; P. Kokotovic, H. Khalil,
J. O'Reilly, Singular Perturbation Methods in Control, SIAM 1999).  Projection on a linear subspace
can't follow its curvature; here the rates of the slow coordinates are fitted on training runs,
which lie on it, and the lag of the fast modes is learnt with them:

    z' = Lambda z + b u + N(z, speed, u)

Lambda and b are exact at straight running.  N is odd in the lateral quantities (the vehicle is its
own mirror image): cubic, and in the axles' slip angles also quintic and |slip| slip, terms; the
speed and what is symmetric have even terms.  Heave and pitch, as slow as the lateral modes, are
coordinates too: corners and a drop move them, and they move the wheel loads.  The coefficients are
improved on whole runs, since a heading that is off is a lateral position that is off; what whole
runs hardly need is eliminated.
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.features import PLANAR, feature_columns
from vehiclemor.reduction.vehicle.reach_of_runs import after_landing, landed, training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import ridge_fit
from vehiclemor.reduction.vehicle.shape import (
    ShapeSamples,
    VehicleShape,
    no_steered_vehicle,
    shape_samples,
)
from vehiclemor.reduction.vehicle.slow_features import (
    FeatureTable,
    feature_table,
    fitted_lifting,
    ranges_of,
)
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, slow_modes
from vehiclemor.reduction.vehicle.trajectory_fit import (
    Target,
    finishes,
    improved,
    pruned,
    targets,
)
from vehiclemor.simulation.dynamic import DynamicModel

# Heading (rad) below which its error counts absolutely.
HEADING = 0.03
# The part of the terms that is left by each round of elimination, and for how many of them all
# training runs are looked at; with more terms it is fewer runs, but so many at least.
SHRINKING, WANTED, FEW = 0.4, 60, 20
GOLDEN = 0.5 * (5.0**0.5 - 1.0)


class SlowManifoldSettings(OnlineSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    ridge: float = Field(1e-10, ge=0.0, description="weight of the coefficients' size in the fit")
    symmetric: int = Field(
        2, ge=0, description="symmetric modes (or pairs) that are integrated with them"
    )
    sweeps: int = Field(
        4, ge=0, description="Gauss-Newton steps of all coefficients on whole training runs"
    )
    terms: int = Field(
        24,
        ge=0,
        description="nonlinear terms that the equations keep, those that whole runs need most; "
        "0: all; only with sweeps",
    )
    hull: float = Field(
        1.1,
        gt=0.0,
        description="arguments of nonlinear terms are held beyond this multiple of their training "
        "range",
    )
    trusted: float = Field(
        0.93,
        gt=0.0,
        description="a run whose arguments leave this multiple of their training range isn't "
        "trusted",
    )
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 2e-3


def fit(model: DynamicModel, training: Training, settings: SlowManifoldSettings) -> ReducedVehicle:
    """Fit the slow dynamics and the manifold on the training runs."""
    began = time.process_time()
    runs = [run.recorded() for run in training]
    shape = VehicleShape(model)
    modes = slow_modes(shape, settings.fastest, settings.symmetric)
    samples = shape_samples(shape, [after_landing(modes.symmetric, shape, run) for run in runs])
    ranges = ranges_of(shape, modes, samples.deviations, samples.inputs)
    table = feature_table(shape, modes, ranges, settings.hull, settings.trusted)
    reduced = _fitted_on_rates(shape, modes, table, samples, settings)
    if settings.sweeps:
        goals = targets(reduced, training, runs)
        reduced = landed(reduced, modes, runs)
        reduced = _fitted_on_runs(reduced, table, goals, settings)
    return replace(
        reduced,
        reach=training_reach(reduced, training, runs),
        offline=offline_cost(began, model, runs, len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def _fitted_on_rates(
    shape: VehicleShape,
    modes: SlowModes,
    table: FeatureTable,
    samples: ShapeSamples,
    settings: SlowManifoldSettings,
) -> ReducedVehicle:
    """Equations fitted on the rates of the training runs, exact at straight running."""
    u, motion, ridge = samples.inputs, samples.motion, settings.ridge
    z, speed = modes.coordinates(samples.deviations, u)
    k, n, inputs = modes.lateral, len(modes.rates), u.shape[1]
    odd = table.odd
    odd_nonlinear, even_nonlinear = table.odd_nonlinear, table.even_nonlinear
    columns = feature_columns(table.features, np.column_stack([z, speed]), u, table.parameters)
    slow_rates = samples.rates @ modes.left.T - u[:, 1:] @ modes.feedthrough[:, : inputs - 1].T
    slow_rates -= z @ modes.rates.T + np.outer(u[:, 0], modes.drive)
    c = np.zeros((len(table.features.terms), n + 1 + PLANAR))
    c[odd_nonlinear, :k] = ridge_fit(columns[:, odd_nonlinear], slow_rates[:, :k], ridge)
    table.set_linear(c, shape, modes)
    forward = shape.linearised.motion_a[1] @ modes.right[:, k:]
    even_columns, ahead = columns[:, even_nonlinear], motion[:, 1] - shape.speed - speed
    c[even_nonlinear, k:n] = ridge_fit(even_columns, slow_rates[:, k:], ridge)
    c[even_nonlinear, n] = ridge_fit(even_columns, samples.rates @ modes.speed_left, ridge)
    c[even_nonlinear, n + 2] = ridge_fit(even_columns, ahead - z[:, k:] @ forward, ridge)
    c[odd, n + 1] = ridge_fit(columns[:, odd], motion[:, 0], ridge)
    c[odd, n + 3] = ridge_fit(columns[:, odd], motion[:, 2], ridge)
    lifting, lifted = fitted_lifting(shape, table, columns, samples.deviations, ridge)
    return ReducedVehicle(
        shape.model,
        shape,
        table.features,
        table.parameters,
        c,
        lifting,
        np.vstack([modes.left, modes.speed_left]),
        np.vstack([modes.feedthrough, np.zeros(inputs)]),
        np.concatenate([3.0 * table.ranges.states, [10.0, HEADING, 10.0, 10.0]]),
        transient=modes.symmetric,
        lifted_features=lifted,
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
    count = len(table.odd_nonlinear) + len(table.even_nonlinear)
    while settings.terms and count > settings.terms:
        share = max(WANTED / count, FEW / len(goals))
        # Spread without a period.
        some = [goal for i, goal in enumerate(goals) if i * GOLDEN % 1.0 < share]
        reduced = improved(reduced, some, table.free, 1)
        count = max(settings.terms, round(SHRINKING * count))
        fewer, table = pruned(reduced, table, some, count)
        # With too few terms a training run may fail.
        if not finishes(fewer, goals):
            return reduced
        reduced = fewer
    return improved(reduced, goals, table.free, settings.sweeps)


METHOD = Method(
    name="slow_manifold",
    summary="slow modes with a right-hand side fitted on training runs, fast motion slaved",
    reference="10.1137/1.9781611971118",
    settings=dict.fromkeys(("ode", "dae"), SlowManifoldSettings),
    refusal=no_steered_vehicle,
    fit=fit,
)
