"""Modal truncation: the slow lateral modes of a vehicle linearised at straight running.

After E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101: of the modes that steering moves
those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.

    z' = Lambda z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.

Speed, heading and place are kept as in every reduced vehicle: the speed stays that of the start,
and the dynamics are those of the model's own speed.  Nothing is trained.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.features import polynomial_features
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.reduced_vehicle import ReducedVehicle
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
    chosen = np.flatnonzero((moved > MOVED * moved.max()) & (np.imag(values) >= 0.0))
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
    shape, lateral
        Shape and what moves it.
    settings
        With the solver and its tolerance.
    began
        `time.perf_counter()` when the work began.
    """
    linear, modes = shape.linearised, slow_modes(shape, np.inf)
    k, inputs = len(lateral.a), linear.b.shape[1]
    features = polynomial_features(k + 1, inputs)
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle is its own mirror image: the speed moves nothing sideways, steering changes no U.
    features = replace(
        features, groups=((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    )
    lifting = np.zeros((len(features.terms), len(linear.a)))
    lifting[odd] = np.vstack([lateral.right.T, lateral.follow.T])
    lifting[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([lateral.a.T, lateral.b])
    for column, row in ((k + 1, 0), (k + 3, 2)):
        c[odd, column] = lifting[odd] @ linear.motion_a[row]
        c[odd[k:], column] += linear.motion_b[row]
    c[even, k + 2] = shape.speed, 1.0
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
        linearisation_cost(shape, began),
        str(settings["solver"]),
        float(settings["tolerance"]),
        modes.symmetric,
    )


def typical(shape: VehicleShape, lateral: Lateral) -> np.ndarray:
    """Typical sizes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(lateral.a, lateral.b)
    turn = shape.linearised.motion_a[0] @ (lateral.right @ steady + lateral.follow[:, 0])
    # A coordinate that steady cornering leaves alone counts as the largest one.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


def linearisation_cost(shape: VehicleShape, began: float) -> Offline:
    """Seconds since `began`; two evaluations for every state and input."""
    return Offline(time.perf_counter() - began, 2 * sum(shape.linearised.b.shape))


def truncated(lateral: Lateral, fastest: float, static: bool) -> Lateral:
    """The modes with |lambda| up to `fastest` (1/s), the others static or dropped."""
    # In real form, rows of a block have the length |lambda|.
    kept = np.linalg.norm(lateral.a, axis=1) <= fastest
    if not kept.any():
        raise InputError(f"fastest is {fastest:g} 1/s: no mode that steering moves is that slow")
    follow = lateral.follow.copy()
    if static and not kept.all():
        rest = np.linalg.solve(lateral.a[~kept][:, ~kept], lateral.b[~kept])
        follow[:, 0] -= lateral.right[:, ~kept] @ rest
    return Lateral(
        lateral.a[kept][:, kept],
        lateral.b[kept],
        lateral.left[kept],
        lateral.right[:, kept],
        follow,
        lateral.feedthrough[kept],
    )


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """At least one mode must be kept."""
    assert isinstance(model, DynamicModel)
    truncated(lateral_modes(VehicleShape(model)), float(settings["fastest"]), False)


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedVehicle:
    """Linearise and truncate; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape = VehicleShape(model)
    static = settings["static_correction"] == "yes"
    lateral = truncated(lateral_modes(shape), float(settings["fastest"]), static)
    return linear_vehicle(shape, lateral, settings, began)
