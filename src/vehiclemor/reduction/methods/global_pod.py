"""Global POD: one energy-weighted basis of the coordinates for all times and inputs.

L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987),
561-571, in a Galerkin projection of the equations of motion, V^T M V qh'' = V^T F.  Place, heading
and the common rolling of the wheels are basis vectors of their own, and snapshots are taken without
them: they grow without bound, and would use up the modes.

To be expected: it predicts unseen inputs where it has most of the modes, since the energy of a
coordinate says little of what it does to the path: wheels' spins are kept before pitch, and stay as
stiff as they were.  A dense projected mass matrix costs more than the full model's elimination.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import null_space

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.methods.balanced_pod import with_mirrored
from vehiclemor.reduction.projection.bases import Basis, pod_basis
from vehiclemor.reduction.projection.dynamic import MOST_SNAPSHOTS, ReducedDynamicModel
from vehiclemor.reduction.projection.inner_products import coordinate_weight
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.projected_vehicle import PROJECTED_SETTINGS
from vehiclemor.reduction.vehicle.shape import is_vehicle, spin_angles
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.spaces import Spaces
from vehiclemor.simulation.system_loops import COORDINATES

SUMMARY = "POD with one energy-weighted basis for all inputs, place and heading kept apart"
REFERENCE = "10.1090/qam/910462"
_SETTINGS = {
    "rank": Setting(
        "integer", 8, "POD modes beside place, heading and common rolling of the wheels", minimum=1
    ),
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
    """Vehicles with equations of motion that can be projected."""
    accepted, reason = is_vehicle(model)
    if accepted and isinstance(model, DynamicModel):
        missing = {"second_order", "speeds"} - set(model.equations.shapes)
        if missing:
            return False, f"{model.name} has no {min(missing)} to project"
    return accepted, reason


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    assert isinstance(model, DynamicModel)
    rank, snapshots = int(settings["rank"]), int(settings["snapshots"])
    most = len(model.coordinates) - len(kept_apart(model))
    if rank > most:
        raise InputError(f"rank {rank} is above the {most} coordinates of {model.name} to reduce")
    if snapshots > MOST_SNAPSHOTS:
        raise InputError(f"snapshots is {snapshots}; it must be at most {MOST_SNAPSHOTS}")
    if rank > snapshots:
        raise InputError(f"rank {rank} is above the number of snapshots {snapshots}")


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedDynamicModel:
    """One POD subspace of all training runs, each over its own duration."""
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    n, count = len(model.coordinates), int(settings["snapshots"])
    runs = [
        run.at(np.linspace(0.0, run.maneuver.duration, count)) for run in with_mirrored(training)
    ]
    start = model.start()
    # Deviations from straight running, which so lies in the subspace: it stays what it is.
    moved = np.concatenate([run.coordinates for run in runs]) - start[:n]
    apart = kept_apart(model)
    # What is left of a coordinate without the vectors kept apart, in an orthonormal basis.
    others = null_space(apart)
    weight = others.T @ coordinate_weight(model, "energy", moved) @ others
    root = np.linalg.cholesky(weight)
    snapshots = (moved @ others @ root).T
    # Both signs: no mean is subtracted.
    scaled = pod_basis(np.hstack([snapshots, -snapshots]), int(settings["rank"]))
    modes = np.linalg.solve(root.T, scaled.vectors)
    mean = np.concatenate([others @ (others.T @ start[:n]), start[n:]])
    vectors = np.vstack([apart, (others @ modes).T])
    projection = np.vstack([apart, modes.T @ weight @ others.T])
    r = len(vectors)
    lift, drop = np.zeros((1, 2 * r, 2 * n)), np.zeros((1, 2 * r, 2 * n))
    lift[0, :r, :n], drop[0, :r, :n] = vectors, projection
    # The window ends with the longest run, but holds beyond it.
    edges = np.array([0.0, max(run.maneuver.duration for run in training)])
    spaces = Spaces(COORDINATES, edges, mean[None], lift, drop, np.array([2 * r], dtype=np.int64))
    evaluations = sum(run.counts[model.evaluations] for run in runs)
    return ReducedDynamicModel(
        model,
        "coordinates",
        (Basis(mean[:n], vectors.T, scaled.singular_values),),
        spaces,
        Offline(time.perf_counter() - began, evaluations),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )


def kept_apart(model: DynamicModel) -> np.ndarray:
    """Orthonormal rows (4, n): place, heading, and the wheels rolling as in straight running."""
    n, spins = len(model.coordinates), spin_angles(model)
    rows = np.zeros((4 if len(spins) else 3, n))
    rows[range(3), model.planar] = 1.0
    if len(spins):
        rolling = model.derivative(model.start(), np.zeros(len(model.inputs)))[spins]
        rows[3, spins] = rolling / np.linalg.norm(rolling)
    return rows
