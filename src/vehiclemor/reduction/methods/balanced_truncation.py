"""Balanced truncation of a vehicle linearised at straight running.

B. C. Moore, IEEE Trans. Autom. Control 26 (1981), 17-32, by the square-root method (A. C. Antoulas,
Approximation of Large-Scale Dynamical Systems, SIAM 2005, section 7.3): states that steering hardly
reaches, or that lateral speed, yaw rate and roll hardly show, are dropped.  The error of the
transfer function is at most twice the sum of the Hankel singular values dropped.

What is balanced are all modes that steering moves (see `linear_vehicle`): the system with only
the steering as its input, since derivatives of a prescribed rack are taken out as feedthrough
first; stabilised constraints, never excited, stay out.  The speed is kept beside; nothing is
trained.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from vehiclemor.errors import InputError
from vehiclemor.reduction.methods.slow_manifold import accepts
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.linear_vehicle import Lateral, lateral_modes, linear_vehicle
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

__all__ = ["REFERENCE", "SUMMARY", "accepts", "check", "fit", "presets", "settings"]
SUMMARY = "linearised vehicle, balanced between steering and lateral outputs"
REFERENCE = "10.1109/TAC.1981.1102568"
# Sizes of the outputs (m/s, rad/s, rad) that count the same: cornering at 4 m/s^2 and 20 m/s.
OUTPUTS = {"lateral_speed": 0.5, "yaw_rate": 0.2, "roll": 0.03}
_SETTINGS = {
    "rank": Setting("integer", 4, "lateral states kept", minimum=1),
    **ONLINE_SETTINGS,
}


@dataclass(frozen=True, eq=False)
class Balanced:
    """Projection of a linear system on its balanced states.

    Attributes
    ----------
    left, right
        Reduced states per state (r, n) and back (n, r); left right = 1.
    hankel
        All Hankel singular values (n,).
    """

    left: np.ndarray
    right: np.ndarray
    hankel: np.ndarray


def balanced(a: np.ndarray, b: np.ndarray, c: np.ndarray, rank: int) -> Balanced:
    """Balance a stable system x' = a x + b u, y = c x.

    Parameters
    ----------
    a, b, c
        Matrices (n, n), (n, inputs), (outputs, n).
    rank
        Number of states to keep.
    """
    reached = gramian_factor(solve_continuous_lyapunov(a, -b @ b.T))
    seen = gramian_factor(solve_continuous_lyapunov(a.T, -c.T @ c))
    return Balanced(*balancing(reached, seen, rank))


def balancing(
    reached: np.ndarray, seen: np.ndarray, rank: int, smallest: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Square-root balancing.

    Parameters
    ----------
    reached, seen
        F (n, m) with F F^T the gramian of controllability, of observability.
    rank
        Number of states to keep.
    smallest
        Part of the largest singular value below which a state is left out all the same.

    Returns
    -------
    tuple of numpy.ndarray
        Reduced states per state (r, n), back (n, r), and all Hankel singular values.
    """
    u, hankel, vt = np.linalg.svd(seen.T @ reached, full_matrices=False)
    kept = min(rank, int(np.count_nonzero(hankel > smallest * hankel[0])))
    scale = 1.0 / np.sqrt(hankel[:kept])
    left = scale[:, None] * (u[:, :kept].T @ seen.T)
    return left, reached @ vt[:kept].T * scale, hankel


def gramian_factor(gramian: np.ndarray) -> np.ndarray:
    """F (n, n) with F F^T the gramian, without the negative eigenvalues of rounding."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def lateral_system(
    shape: VehicleShape, lateral: Lateral
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices a, b, c from steering to the scaled outputs."""
    rows = [shape.model.outputs.index(name) for name in OUTPUTS]
    sizes = np.array(list(OUTPUTS.values()))[:, None]
    return lateral.a, lateral.b[:, None], shape.linearised.output_a[rows] @ lateral.right / sizes


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """The rank may not exceed the number of lateral modes."""
    assert isinstance(model, DynamicModel)
    _check_rank(lateral_modes(VehicleShape(model)), int(settings["rank"]))


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedVehicle:
    """Linearise and balance; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape = VehicleShape(model)
    lateral = lateral_modes(shape)
    rank = int(settings["rank"])
    _check_rank(lateral, rank)
    return linear_vehicle(shape, projected(shape, lateral, rank), settings, began)


def projected(shape: VehicleShape, lateral: Lateral, rank: int) -> Lateral:
    """The lateral dynamics in balanced states."""
    kept = balanced(*lateral_system(shape, lateral), rank)
    left = kept.left @ lateral.left
    return Lateral(
        kept.left @ lateral.a @ kept.right,
        kept.left @ lateral.b,
        left,
        lateral.right @ kept.right,
        lateral.follow,
        left @ lateral.follow,
    )


def _check_rank(lateral: Lateral, rank: int) -> None:
    if rank > len(lateral.b):
        raise InputError(f"rank is {rank}, but steering moves {len(lateral.b)} states")
