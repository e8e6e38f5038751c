"""Operator inference: reduced operators fitted on the rates of projected training data.

B. Peherstorfer, K. Willcox, Comput. Methods Appl. Mech. Eng. 306 (2016), 196-215.  Deviations of
the shape from straight running, each state scaled by its range in training, give one global POD
basis.  The rates of its coordinates (here exact: those of the full equations, projected) are fitted
by

    z' = A z + B u (+ H (z x z)),   psi' and U, V in the same terms

with ridge regression, scaled by the size of each term (S. McQuarrie, C. Huang, K. Willcox, J. R.
Soc. N. Z. 51 (2021), 194-211).  The training data count twice, as they are and as their mirror
image: a vehicle is its own mirror image, so every basis vector is either odd (lateral) or even, and
operators are fitted only where parity allows them.  Without steering the reduced car drives
straight.

Nothing makes a fitted A stable: its growth rate at straight running is reported, or growing
eigenvalues are reflected at the imaginary axis (`stabilise`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.reduction.methods.slow_manifold import accepts
from vehiclemor.reduction.online_settings import ONLINE_SETTINGS
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.features import PLANAR, polynomial_features
from vehiclemor.reduction.vehicle.linear_vehicle import (
    HEADING,
    MARGIN,
    PLACE,
    lateral_modes,
    linearisation_cost,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

__all__ = ["REFERENCE", "SUMMARY", "accepts", "check", "fit", "presets", "settings"]
SUMMARY = "global POD, reduced operators fitted on projected rates of training runs"
REFERENCE = "10.1016/j.cma.2016.03.025"
# Wheels that the mirror exchanges, as parts of names.
SWAPPED = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}
# Parts of a state's range below which it counts as not moved.
STILL = 1e-6
_SETTINGS = {
    "rank": Setting("integer", 6, "POD coordinates, lateral and symmetric together", minimum=1),
    "degree": Setting("integer", 1, "of the operators: 1 linear, 2 quadratic", minimum=1),
    "ridge": Setting("number", 1e-8, "weight of the coefficients' size in the fit", minimum=0.0),
    "stabilise": Setting(
        "text",
        "check",
        "growing linear part: check reports it, shift reflects its eigenvalues",
        choices=("check", "shift"),
    ),
    **ONLINE_SETTINGS,
}


@dataclass(frozen=True, eq=False)
class MirrorBasis:
    """POD basis of data and their mirror image.

    Attributes
    ----------
    encoding, lifting
        Coordinates per deviation (r, n), with largest magnitude 1 in training, and back (n, r).
    odd
        Which coordinates change sign in the mirror (r,).
    """

    encoding: np.ndarray
    lifting: np.ndarray
    odd: np.ndarray


def mirror(shape: VehicleShape) -> np.ndarray:
    """Signed permutation (n, n): the deviation of the shape in the vehicle's mirror image.

    Names tell the partners.  Signs follow from what steering moves, which changes its sign in the
    mirror: of a state without a partner, and against its partner's of any other.
    """
    lateral = lateral_modes(shape)
    moved = np.hstack([lateral.right, lateral.follow])
    moved /= largest(moved)
    names = shape.names
    matrix = np.zeros((len(names), len(names)))
    for i, name in enumerate(names):
        partner = "_".join(SWAPPED.get(part, part) for part in name.split("_"))
        j = names.index(partner) if partner in names else i
        if i == j:
            matrix[i, i] = -1.0 if np.abs(moved[i]).max() > STILL else 1.0
        else:
            matrix[i, j] = -1.0 if moved[i] @ moved[j] > 0.0 else 1.0
    return matrix


def mirror_basis(deviations: np.ndarray, image: np.ndarray, rank: int) -> MirrorBasis:
    """POD of deviations (samples, n) and their mirror image, scaled by each state's range."""
    mirrored = deviations @ image.T
    scale = np.maximum(np.abs(deviations).max(axis=0), np.abs(mirrored).max(axis=0))
    scale[scale == 0.0] = 1.0
    values, vectors, odd = [], [], []
    for sign in (-1.0, 1.0):
        # The POD of both together is that of the odd part and of the even part.
        part = 0.5 * (deviations + sign * mirrored) / scale
        _, sizes, modes = np.linalg.svd(part, full_matrices=False)
        values += list(sizes)
        vectors += list(modes)
        odd += [sign < 0.0] * len(sizes)
    chosen = np.argsort(values)[::-1][:rank]
    modes = np.array(vectors)[chosen]
    sizes = largest(deviations / scale @ modes.T)
    return MirrorBasis(
        modes / scale / sizes[:, None], (modes * scale).T * sizes, np.array(odd)[chosen]
    )


def term_parity(odd: np.ndarray, inputs: int, degree: int) -> np.ndarray:
    """Which terms of `polynomial_features` change sign in the mirror; all inputs do."""
    parity = [False, *(bool(o) for o in odd), *[True] * inputs]
    for power in range(2, degree + 1):
        products = combinations_with_replacement(odd, power)
        parity += [sum(product) % 2 == 1 for product in products]
    return np.array(parity)


def operators(columns: np.ndarray, rates: np.ndarray, ridge: float) -> np.ndarray:
    """Coefficients (terms, targets) of rates (samples, targets) in terms (samples, terms)."""
    sizes = largest(columns)
    return ridge_fit(columns / sizes, rates, ridge) / sizes[:, None]


def reflected(a: np.ndarray) -> np.ndarray:
    """The matrix (k, k) with growing eigenvalues reflected at the imaginary axis."""
    values, vectors = np.linalg.eig(a)
    values = -np.abs(np.real(values)) + 1j * np.imag(values)
    return np.real(vectors * values @ np.linalg.inv(vectors))


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """The rank may not exceed the number of states, the degree not two."""
    assert isinstance(model, DynamicModel)
    states = len(VehicleShape(model).kept)
    if int(settings["rank"]) > states:
        raise InputError(f"rank is {settings['rank']}, but the shape has {states} states")
    if int(settings["degree"]) > 2:
        raise InputError(f"degree is {settings['degree']}; allowed: 1, 2")


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedVehicle:
    """Project the training runs on their POD basis and fit the operators."""
    assert isinstance(model, DynamicModel)
    if not training:
        raise InputError("operator inference needs training runs")
    check(model, settings)
    began = time.perf_counter()
    runs = [run.at(run.maneuver.times) for run in training]
    shape = VehicleShape(model)
    u = np.concatenate([run.inputs for run in runs])
    shapes = np.concatenate([shape.of(run.states) for run in runs])
    rates, motion = shape.motion(shapes, u)
    deviations = shapes - shape.reference
    basis = mirror_basis(deviations, mirror(shape), int(settings["rank"]))
    z, ridge = deviations @ basis.encoding.T, float(settings["ridge"])
    k, inputs, degree = len(basis.odd), u.shape[1], int(settings["degree"])
    features = polynomial_features(k, inputs, degree)
    parity = term_parity(basis.odd, inputs, degree)
    # Columns of psi', U, V: odd, even, odd.  Straight running goes on: no constant but U's.
    columns = np.concatenate([basis.odd, [True, False, True]])
    goals = np.column_stack([rates @ basis.encoding.T, motion - [0.0, shape.speed, 0.0]])
    values = features.at(z, u, np.zeros(0))
    c = np.zeros((len(parity), k + PLANAR))
    blocks = []
    for side in (True, False):
        terms, targets = np.flatnonzero(parity == side), np.flatnonzero(columns == side)
        blocks.append((tuple(terms.tolist()), tuple(targets.tolist())))
        fitted = terms[terms > 0]
        if len(fitted):
            c[np.ix_(fitted, targets)] = operators(values[:, fitted], goals[:, targets], ridge)
        own = np.flatnonzero(basis.odd == side)
        if settings["stabilise"] == "shift" and len(own):
            c[np.ix_(1 + own, own)] = reflected(c[np.ix_(1 + own, own)].T).T
    c[0, k + 1] = shape.speed
    lifting = np.zeros((len(parity), len(shape.reference)))
    lifting[1 : k + 1] = basis.lifting.T
    evaluations = sum(run.counts[model.evaluations] for run in runs) + len(u)
    cost = linearisation_cost(shape, began)
    return ReducedVehicle(
        model,
        shape,
        replace(features, groups=tuple(blocks)),
        np.zeros(0),
        c,
        lifting,
        basis.encoding,
        np.zeros((k, inputs)),
        np.concatenate([np.full(k, MARGIN), [HEADING, PLACE, PLACE]]),
        replace(cost, evaluations=cost.evaluations + evaluations),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )
