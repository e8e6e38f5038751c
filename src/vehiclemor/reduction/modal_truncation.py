"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering without
delay (static correction: residualisation), so that steady cornering is that of the linearisation.

    z' = Lambda z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), d' = A d + B0 s +
B1 s' + B2 s'' has no derivative left for d - K0 s - K1 s' with K1 = B2, K0 = B1 + A B2.  What is
left drives no stabilised constraint: the eigenvalues at which those cluster are no motion.

Speed, heading and place are kept as in every reduced vehicle: the speed stays that of the start, and
the dynamics are those of the model's own speed.  Nothing is trained.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.features import Features, polynomial_features
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.reduced_vehicle import NO_TRANSIENT, ReducedVehicle
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.slow_manifold import accepts
from vehiclemor.reduction.slow_modes import slow_modes
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle_shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

__all__ = ["REFERENCE", "SUMMARY", "accepts", "check", "fit", "presets", "settings"]
SUMMARY = "slow lateral modes of the linearised vehicle, the others static"
REFERENCE = "10.1109/TAC.1966.1098264"
# Eigenvalues (1/s) nearer to each other belong to the cluster of stabilised constraints.
APART = 1e-2
# Modes that steering moves by less than this part of the most moved one are symmetric.
MOVED = 1e-8
# Lateral acceleration (m/s^2) of steady cornering that gives states their typical size (ISO 7401).
CORNERING = 4.0
# How many times that is typical, and the same for speed (m/s), heading (rad), place (m).
MARGIN = 3.0
SPEED, HEADING, PLACE = 10.0, 1.0, 10.0
_SETTINGS = {
    "fastest": Setting(
        "number", 45.0, "modes of up to this |lambda| in 1/s are kept", minimum=0.0, above=True
    ),
    "static_correction": Setting(
        "text", "yes", "dropped modes follow the steering without delay", choices=("yes", "no")
    ),
    **ONLINE_SETTINGS,
}


@dataclass(frozen=True, eq=False)
class Lateral:
    """Linear lateral dynamics z' = a z + b s of a shape left + right z + follow (s, s', ...).

    Attributes
    ----------
    a, b
        Matrix (k, k) and column (k,) of the steering.
    left, right
        z per deviation of the shape (k, n), less `feedthrough` of the inputs, and back (n, k).
    follow
        Deviation (n, inputs) of the shape that follows the inputs without delay.
    feedthrough
        What of the inputs (k, inputs) is not in z.
    """

    a: np.ndarray
    b: np.ndarray
    left: np.ndarray
    right: np.ndarray
    follow: np.ndarray
    feedthrough: np.ndarray


def lateral_modes(shape: VehicleShape) -> Lateral:
    """All modes that steering moves, slow ones first, in real form (blocks of two for pairs)."""
    linear = shape.linearised
    follow = np.zeros_like(linear.b)
    for j in range(linear.b.shape[1] - 1, 0, -1):
        follow[:, j - 1] = linear.b[:, j] + linear.a @ follow[:, j]
    drive = linear.b[:, 0] + linear.a @ follow[:, 0]
    values, vectors = np.linalg.eig(linear.a.T)
    w = vectors.T
    v = np.linalg.inv(w)
    distance = np.abs(values[:, None] - values[None, :]) + 1e9 * np.eye(len(values))
    apart = (distance.min(axis=1) > APART) & (np.abs(values) > APART)
    moved = np.abs(w @ drive) * np.linalg.norm(v, axis=0) / np.maximum(np.abs(values), APART)
    moved[~apart] = 0.0
    rows, columns = [], []
    chosen = np.flatnonzero((moved > MOVED * moved.max()) & (values.imag >= 0.0))
    for i in sorted(chosen, key=lambda i: abs(values[i])):
        rows.append(w[i].real)
        if values[i].imag > 0.0:
            rows.append(w[i].imag)
            columns += [2.0 * v[:, i].real, -2.0 * v[:, i].imag]
        else:
            columns.append(v[:, i].real)
    left, right = np.array(rows), np.array(columns).T
    return Lateral(left @ linear.a @ right, left @ drive, left, right, follow, left @ follow)


def linear_vehicle(
    shape: VehicleShape, lateral: Lateral, settings: Mapping[str, Value], began: float
) -> ReducedVehicle:
    """A reduced vehicle of linear lateral dynamics at the speed of the start.

    Parameters
    ----------
    began
        `time.perf_counter()` when the work began.
    """
    linear, modes = shape.linearised, slow_modes(shape, np.inf)
    k, inputs = len(lateral.a), linear.b.shape[1]
    features, odd, even = straight_features(k, inputs)
    lifting = np.zeros((len(features.terms), len(linear.a)))
    lifting[odd] = np.vstack([lateral.right.T, lateral.follow.T])
    lifting[even[1]] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([lateral.a.T, lateral.b])
    # The vehicle is its own mirror image: no lateral motion comes from the speed.
    c[odd, k + 1], c[odd, k + 3] = lifting[odd] @ linear.motion_a[[0, 2]].T @ np.eye(2)
    return ReducedVehicle(
        shape.model,
        shape,
        features,
        np.zeros(0),
        c,
        lifting,
        np.vstack([lateral.left, modes.speed_left]),
        np.vstack([lateral.feedthrough, np.zeros(inputs)]),
        np.concatenate([typical(shape, lateral), [SPEED, HEADING, PLACE, PLACE]]),
        Offline(time.perf_counter() - began, linearisation_evaluations(shape)),
        str(settings["solver"]),
        float(settings["tolerance"]),
        modes.symmetric,
    )
