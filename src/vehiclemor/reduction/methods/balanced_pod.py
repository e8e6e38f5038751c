"""Balanced POD of a vehicle: one Petrov-Galerkin subspace that weighs motion by what it does.

C. Rowley, Model reduction for fluids, using balanced proper orthogonal decomposition, Int. J.
Bifurcation Chaos 15 (2005), 997-1013; S. Lall, J. Marsden, S. Glavaski, A subspace approach to
balanced truncation for model reduction of nonlinear control systems, Int. J. Robust Nonlinear
Control 12 (2002), 519-535.  The controllability gramian is that of training runs, the observability
gramian that of the linearisation at straight running; the equations stay nonlinear.

Outside of the balanced subspace stand the place, the heading and the angles of the wheels as
quadratures, and the speed: the mode of straight runs, which has no gramian since it does not decay.

To be expected: it predicts unseen inputs, and explicit steps become long, but a linear subspace
holds fast modes only as far as they follow the slow ones linearly, and the right-hand side is that
of the full model: no faster than the best full-order integrator.
"""

import time
from typing import cast

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.projection.balancing import balancing, gramian_factor
from vehiclemor.reduction.projection.bases import check_snapshots
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import lacking, no_vehicle
from vehiclemor.reduction.vehicle.mirror import with_mirrored
from vehiclemor.reduction.vehicle.projected_vehicle import one_window, projected_vehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

OUTPUTS = (
    *("lateral_speed", "yaw_rate", "roll", "pitch"),
    *("longitudinal_speed", "vertical_speed"),
)
# Balanced directions below this share of the first one are rounding.
SMALLEST = 1e-12


class BalancedPodSettings(ProjectedSettings):
    """Settings for a vehicle."""

    # With 6 a slow lateral pair of the 14-DOF vehicle is off: half of the modes are symmetric ones.
    rank: int = Field(8, ge=1, description="number of balanced modes, the speed not counted")
    snapshots: int = Field(500, ge=2, description="snapshots in each training run")


def refusal(model: Model) -> str:
    """Vehicles with the outputs that modes are weighed by are accepted."""
    return no_vehicle(model) or lacking(model, OUTPUTS)


def check(model: DynamicModel, settings: BalancedPodSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    most = len(VehicleShape(model).kept) - 1
    if settings.rank > most:
        raise InputError(
            f"rank {settings.rank} is above the {most} states of {model.name} that decay"
        )
    check_snapshots(settings.snapshots)


def fit(model: DynamicModel, training: Training, settings: BalancedPodSettings) -> ReducedSystem:
    """Balance the gramians of the training runs and of the linearisation."""
    began = time.process_time()
    shape, count = VehicleShape(model), settings.snapshots
    both = with_mirrored(training)
    runs = [run.snapshots(count) for run in both]
    cars = {id(run.model): VehicleShape(cast("DynamicModel", run.model)) for run in both}
    # Gramians are integrals in time: each snapshot is weighted by its time step.
    parts = [
        (shape.of(run.states) - cars[id(given.model)].reference) * np.sqrt(run.time[-1] / count)
        for run, given in zip(runs, both, strict=True)
    ]
    places = [model.outputs.index(name) for name in OUTPUTS]
    ranges = np.ptp(np.concatenate([run.outputs[:, places] for run in runs]), axis=0)
    weights = 1.0 / np.where(ranges > 0.0, ranges, 1.0)
    linear = shape.linearised
    speed = speed_mode(linear.a)
    modes, projection, _ = balanced(
        linear.a,
        speed,
        np.concatenate(parts).T,
        weights[:, None] * linear.output_a[places],
        settings.rank,
    )
    n = len(model.coordinates)
    outside = np.setdiff1d(np.arange(2 * n), shape.kept)
    rows = len(outside) + 1 + len(modes)
    trial_basis, test_basis = np.zeros((rows, 2 * n)), np.zeros((rows, 2 * n))
    mean = np.zeros(2 * n)
    mean[shape.kept] = shape.reference
    both = ((trial_basis, speed[0], modes), (test_basis, speed[1], projection))
    for basis, of_speed, of_others in both:
        # States that the shape does not depend on are integrated unreduced (quadratures).
        basis[:, outside] = np.eye(rows)[:, : len(outside)]
        basis[len(outside) :, shape.kept] = np.vstack([of_speed, of_others])
    spaces = one_window(mean, trial_basis, test_basis)
    # Quadratures do not count as modes.
    rank = len(modes) + 1
    return projected_vehicle(shape, spaces, rank, offline_cost(began, model, runs), settings)


def speed_mode(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Right and left eigenvector (n,) of eigenvalue zero of A (n, n), their product 1."""
    u, _, vt = np.linalg.svd(a)
    right, left = vt[-1], u[:, -1]
    return right, left / (left @ right)


def balanced(
    a: np.ndarray,
    still: tuple[np.ndarray, np.ndarray],
    snapshots: np.ndarray,
    c: np.ndarray,
    rank: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Balanced modes of a linear system x' = A x, y = C x from snapshots of its states.

    Parameters
    ----------
    a, c
        (n, n) and (outputs, n).
    still
        Right and left eigenvector of the one eigenvalue zero, which is left out.
    snapshots
        Columns (n, m), scaled so that X X^T is the controllability gramian.

    Returns
    -------
    tuple of numpy.ndarray
        Modes by rows (r, n), their projection (r, n), all Hankel-like values, decreasing; r is
        smaller than `rank` where further values are rounding.
    """
    from scipy.linalg import solve_continuous_lyapunov

    right, left = still
    apart = np.eye(len(a)) - np.outer(right, left)
    # The mode that is left out gets the eigenvalue -1: the outputs don't see it.
    stable = a @ apart - np.outer(right, left)
    seen = c @ apart
    observability = solve_continuous_lyapunov(stable.T, -seen.T @ seen)
    left, right, hankel = balancing(
        apart @ snapshots, gramian_factor(observability), rank, SMALLEST
    )
    return right.T, left @ apart, hankel


METHOD = Method(
    name="balanced_pod",
    summary="balanced POD: one Petrov-Galerkin basis, heading and place as quadratures",
    reference="10.1142/S0218127405012429",
    settings=dict.fromkeys(("ode", "dae"), BalancedPodSettings),
    refusal=refusal,
    check=check,
    fit=fit,
)
