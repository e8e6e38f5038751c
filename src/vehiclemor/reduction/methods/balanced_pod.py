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

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.methods.balanced_truncation import balancing, gramian_factor
from vehiclemor.reduction.projection.dynamic import MOST_SNAPSHOTS
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.heading_frame import heading_frame
from vehiclemor.reduction.vehicle.projected_vehicle import (
    PROJECTED_SETTINGS,
    ProjectedVehicle,
    one_window,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape, is_vehicle
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

SUMMARY = "balanced POD: one Petrov-Galerkin basis, heading and place as quadratures"
REFERENCE = "10.1142/S0218127405012429"
OUTPUTS = (
    *("lateral_speed", "yaw_rate", "roll", "pitch"),
    *("longitudinal_speed", "vertical_speed"),
)
# Balanced directions below this share of the first one are rounding.
SMALLEST = 1e-12
_SETTINGS = {
    # With 6 a slow lateral pair of the 14-DOF vehicle is off: half of the modes are symmetric ones.
    "rank": Setting("integer", 8, "number of balanced modes, the speed not counted", minimum=1),
    "snapshots": Setting("integer", 500, "snapshots in each training run", minimum=2),
    **PROJECTED_SETTINGS,
}


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """Vehicles with the outputs that modes are weighed by."""
    accepted, reason = is_vehicle(model)
    if not accepted:
        return accepted, reason
    missing = [name for name in OUTPUTS if name not in model.outputs]
    return not missing, f"{model.name} has no output {', '.join(missing)}"


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    assert isinstance(model, DynamicModel)
    rank, snapshots = int(settings["rank"]), int(settings["snapshots"])
    most = len(VehicleShape(model).kept) - 1
    if rank > most:
        raise InputError(f"rank {rank} is above the {most} states of {model.name} that decay")
    if snapshots > MOST_SNAPSHOTS:
        raise InputError(f"snapshots is {snapshots}; it must be at most {MOST_SNAPSHOTS}")


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedVehicle:
    """Balance the gramians of the training runs and of the linearisation."""
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape, count = VehicleShape(model), int(settings["snapshots"])
    runs = [
        run.at(np.linspace(0.0, run.maneuver.duration, count)) for run in with_mirrored(training)
    ]
    # Gramians are integrals in time: a snapshot counts for as long as it stands for.
    parts = [
        (shape.of(run.states) - shape.reference) * np.sqrt(run.time[-1] / count) for run in runs
    ]
    places = [model.outputs.index(name) for name in OUTPUTS]
    ranges = np.ptp(np.concatenate([run.outputs[:, places] for run in runs]), axis=0)
    weights = 1.0 / np.where(ranges > 0.0, ranges, 1.0)
    linear = shape.linearised
    speed = speed_mode(linear.a)
    lift, drop, _ = balanced(
        linear.a,
        speed,
        np.concatenate(parts).T,
        weights[:, None] * linear.output_a[places],
        int(settings["rank"]),
    )
    n = len(model.coordinates)
    outside = np.setdiff1d(np.arange(2 * n), shape.kept)
    rows = len(outside) + 1 + len(lift)
    lifts, drops, mean = np.zeros((rows, 2 * n)), np.zeros((rows, 2 * n)), np.zeros(2 * n)
    mean[shape.kept] = shape.reference
    for bases, of_speed, of_others in ((lifts, speed[0], lift), (drops, speed[1], drop)):
        # Quadratures: what the shape does not feel is integrated as it is.
        bases[:, outside] = np.eye(rows)[:, : len(outside)]
        bases[len(outside) :, shape.kept] = np.vstack([of_speed, of_others])
    system = heading_frame(shape)
    evaluations = sum(run.counts[model.evaluations] for run in runs)
    return ProjectedVehicle(
        shape,
        system,
        one_window(mean, lifts, drops),
        # Quadratures are no modes.
        len(lift) + 1,
        Offline(time.perf_counter() - began, evaluations),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )


def with_mirrored(training: Sequence[TrainingRun]) -> list[TrainingRun]:
    """Training runs, and the same with steering to the other side.

    The vehicle is its own mirror image.  Without these runs modes mix what is symmetric with what
    is lateral, and a car that is dropped leaves its lane.
    """
    others = []
    for run in training:
        factors = run.maneuver.frequency_factor, -run.maneuver.amplitude_factor
        others.append(replace(run, maneuver=run.maneuver.perturbed(*factors)))
    return [*training, *others]


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
    right, left = still
    apart = np.eye(len(a)) - np.outer(right, left)
    # The mode that is left out decays at any rate: the outputs don't see it.
    stable = a @ apart - np.outer(right, left)
    seen = c @ apart
    observability = solve_continuous_lyapunov(stable.T, -seen.T @ seen)
    left, right, hankel = balancing(
        apart @ snapshots, gramian_factor(observability), rank, SMALLEST
    )
    return right.T, left @ apart, hankel
