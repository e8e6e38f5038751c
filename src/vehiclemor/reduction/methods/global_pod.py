"""Global POD: one energy-weighted basis of the coordinates for all times and inputs.

L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987),
561-571, in a Galerkin projection of the equations of motion, V^T M V qh'' = V^T F.  Place, heading
and the common rolling of the wheels are basis vectors of their own, and snapshots are taken without
them: they grow without bound, and would use up the modes.

To be expected: it predicts unseen inputs where it has most of the modes, since the energy of a
coordinate says little of what it does to the path: wheels' spins are kept before pitch, and stay as
stiff as they were.  A dense projected mass matrix costs more than the full model's elimination.
"""

import time

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.projection.bases import Basis, check_snapshots, pod_basis
from vehiclemor.reduction.projection.dynamic import DynamicProjection, projected_equations
from vehiclemor.reduction.projection.inner_products import coordinate_weight
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_vehicle
from vehiclemor.reduction.vehicle.mirror import with_mirrored
from vehiclemor.reduction.vehicle.shape import spin_angles
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import ProjectionWindows


class GlobalPodSettings(ProjectedSettings):
    """Settings for a vehicle."""

    rank: int = Field(
        8, ge=1, description="POD modes beside place, heading and common rolling of the wheels"
    )
    snapshots: int = Field(500, ge=2, description="snapshots in each training run")


def refusal(model: DynamicModel) -> str:
    """Vehicles with equations of motion that can be projected are accepted."""
    if reason := no_vehicle(model):
        return reason
    missing = {"second_order", "speeds"} - set(model.equations.shapes)
    return f"{model.name} has no {min(missing)} to project" if missing else ""


def check(model: DynamicModel, settings: GlobalPodSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    rank, most = settings.rank, len(model.coordinates) - len(kept_apart(model))
    if rank > most:
        raise InputError(f"rank {rank} is above the {most} coordinates of {model.name} to reduce")
    check_snapshots(settings.snapshots, rank)


def fit(model: DynamicModel, training: Training, settings: GlobalPodSettings) -> DynamicProjection:
    """One POD subspace of all training runs, each over its own duration."""
    from scipy.linalg import null_space

    began = time.process_time()
    n, count = len(model.coordinates), settings.snapshots
    both = with_mirrored(training)
    runs = [run.snapshots(count) for run in both]
    start = model.start()
    # Deviations from each car's straight running, so that straight running lies in the subspace.
    moved = np.concatenate(
        [run.coordinates - given.model.start()[:n] for run, given in zip(runs, both, strict=True)]
    )
    apart = kept_apart(model)
    # Orthonormal basis of the complement of the vectors kept apart.
    others = null_space(apart)
    weight = others.T @ coordinate_weight(model, "energy", moved) @ others
    root = np.linalg.cholesky(weight)
    snapshots = (moved @ others @ root).T
    # With both signs of each snapshot the mean is zero, and none is subtracted.
    scaled = pod_basis(np.hstack([snapshots, -snapshots]), settings.rank)
    modes = np.linalg.solve(root.T, scaled.vectors)
    mean = np.concatenate([others @ (others.T @ start[:n]), start[n:]])
    vectors = np.vstack([apart, (others @ modes).T])
    r = len(vectors)
    trial_basis, test_basis = np.zeros((1, 2 * r, 2 * n)), np.zeros((1, 2 * r, 2 * n))
    trial_basis[0, :r, :n] = vectors
    test_basis[0, :r, :n] = np.vstack([apart, modes.T @ weight @ others.T])
    # The window ends with the longest run; a longer maneuver stays in it.
    edges = np.array([0.0, max(run.maneuver.duration for run in training)])
    ranks = np.array([2 * r], dtype=np.int64)
    spaces = ProjectionWindows("coordinates", edges, mean[None], trial_basis, test_basis, ranks)
    basis = Basis(mean[:n], vectors.T, scaled.singular_values)
    return projected_equations(model, spaces, [basis], offline_cost(began, model, runs), settings)


def kept_apart(model: DynamicModel) -> np.ndarray:
    """Orthonormal rows (4, n): place, heading, and the wheels rolling as in straight running."""
    n, spins = len(model.coordinates), spin_angles(model)
    rows = np.zeros((4 if len(spins) else 3, n))
    rows[range(3), model.planar] = 1.0
    if len(spins):
        rolling = model.derivative(model.start(), np.zeros(len(model.inputs)))[spins]
        rows[3, spins] = rolling / np.linalg.norm(rolling)
    return rows


METHOD = Method(
    name="global_pod",
    summary="POD with one energy-weighted basis for all inputs, place and heading kept apart",
    reference="10.1090/qam/910462",
    settings=dict.fromkeys(("ode", "dae"), GlobalPodSettings),
    refusal=refusal,
    check=check,
    fit=fit,
)
