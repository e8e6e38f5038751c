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

Nothing makes a fitted A stable: its spectral abscissa at straight running is reported, or growing
eigenvalues are reflected at the imaginary axis (`stabilise`).
"""

import time
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.acceptance import no_steered_vehicle
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import PLANAR, polynomial_features
from vehiclemor.reduction.vehicle.linear_vehicle import HEADING, MARGIN, PLACE
from vehiclemor.reduction.vehicle.mirror import mirror, mirror_basis, term_parity
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape, shape_samples
from vehiclemor.simulation.dynamic import DynamicModel


class OperatorInferenceSettings(OnlineSettings):
    """Settings for a vehicle."""

    rank: int = Field(6, ge=1, description="POD coordinates, lateral and symmetric together")
    degree: int = Field(1, ge=1, description="of the operators: 1 linear, 2 quadratic")
    ridge: float = Field(1e-8, ge=0.0, description="weight of the coefficients' size in the fit")
    stabilise: Literal["check", "shift"] = Field(
        "check", description="growing linear part: check reports it, shift reflects its eigenvalues"
    )


def operators(columns: np.ndarray, rates: np.ndarray, ridge: float) -> np.ndarray:
    """Coefficients (terms, targets) of rates (samples, targets) in terms (samples, terms)."""
    sizes = largest(columns)
    return ridge_fit(columns / sizes, rates, ridge) / sizes[:, None]


def reflected(a: np.ndarray) -> np.ndarray:
    """The matrix (k, k) with growing eigenvalues reflected at the imaginary axis."""
    values, vectors = np.linalg.eig(a)
    values = -np.abs(np.real(values)) + 1j * np.imag(values)
    return np.real(vectors * values @ np.linalg.inv(vectors))


def check(model: DynamicModel, settings: OperatorInferenceSettings) -> None:
    """The rank may not exceed the number of states, the degree not two."""
    states = len(VehicleShape(model).kept)
    if settings.rank > states:
        raise InputError(f"rank is {settings.rank}, but the shape has {states} states")
    if settings.degree > 2:
        raise InputError(f"degree is {settings.degree}; allowed: 1, 2")


def fit(
    model: DynamicModel, training: Training, settings: OperatorInferenceSettings
) -> ReducedVehicle:
    """Project the training runs on their POD basis and fit the operators."""
    if not training:
        raise InputError("operator inference needs training runs")
    began = time.process_time()
    runs = [run.recorded() for run in training]
    shape = VehicleShape(model)
    u, deviations, rates, motion = shape_samples(shape, runs)
    basis = mirror_basis(deviations, mirror(shape), settings.rank)
    k, inputs = len(basis.odd), u.shape[1]
    features = polynomial_features(k, inputs, settings.degree)
    values = feature_columns(features, deviations @ basis.encoding.T, u, np.zeros(0))
    # Straight running is an equilibrium: the only constant is that of U.
    goals = np.column_stack([rates @ basis.encoding.T, motion - [0.0, shape.speed, 0.0]])
    c, groups = _inferred(basis.odd, values, goals, inputs, settings)
    c[0, k + 1] = shape.speed
    lifting = np.zeros((len(c), len(shape.reference)))
    lifting[1 : k + 1] = basis.lifting.T
    # Two evaluations for every state and input of the linearisation, one for every sample.
    further = 2 * sum(shape.linearised.b.shape) + len(u)
    return ReducedVehicle(
        model,
        shape,
        replace(features, groups=groups),
        np.zeros(0),
        c,
        lifting,
        basis.encoding,
        np.zeros((k, inputs)),
        np.concatenate([np.full(k, MARGIN), [HEADING, PLACE, PLACE]]),
        offline_cost(began, model, runs, further),
        settings.solver,
        settings.tolerance,
    )


def _inferred(
    odd: np.ndarray,
    values: np.ndarray,
    goals: np.ndarray,
    inputs: int,
    settings: OperatorInferenceSettings,
) -> tuple[np.ndarray, tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]]:
    """Coefficients (terms, k + 3) of the goals, and the blocks that parity allows.

    `odd` (k,) are coordinates that change sign in the mirror, `values` the terms (samples, terms),
    `goals` rates, psi', U and V (samples, k + 3).
    """
    k = len(odd)
    parity = term_parity(odd, inputs, settings.degree)
    # Columns of psi', U, V: odd, even, odd.
    columns = np.concatenate([odd, [True, False, True]])
    c = np.zeros((len(parity), k + PLANAR))
    blocks = []
    for side in (True, False):
        terms, targets = np.flatnonzero(parity == side), np.flatnonzero(columns == side)
        blocks.append((tuple(terms.tolist()), tuple(targets.tolist())))
        fitted = terms[terms > 0]
        if len(fitted):
            c[np.ix_(fitted, targets)] = operators(
                values[:, fitted], goals[:, targets], settings.ridge
            )
        own = np.flatnonzero(odd == side)
        if settings.stabilise == "shift" and len(own):
            c[np.ix_(1 + own, own)] = reflected(c[np.ix_(1 + own, own)].T).T
    return c, tuple(blocks)


METHOD = Method(
    name="operator_inference",
    summary="global POD, reduced operators fitted on projected rates of training runs",
    reference="10.1016/j.cma.2016.03.025",
    settings=dict.fromkeys(("ode", "dae"), OperatorInferenceSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
)
