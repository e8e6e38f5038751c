"""Reduced equations with a fixed test space, fitted by polynomials in the reduced coordinates.

With q = q_mean + U S x (U: POD basis, S: scales) and the fixed test space W = Phi_q(q_mean) U, the
reduced equations W^T Phi = 0 are as many functions of as few variables.  Where the inputs enter
linearly, their part is exact; the rest is fitted, so that no trigonometric function and no equation
of the full model is evaluated online.
"""

import math
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from vehiclemor.codegen.loops import Loop, Ready, ready
from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method, Offline, offline_cost
from vehiclemor.reduction.polynomials.kernels import (
    derivatives,
    monomials,
    residual_loop,
)
from vehiclemor.reduction.polynomials.residual_loops import Polynomials
from vehiclemor.reduction.projection.algebraic import ITERATION_LIMIT
from vehiclemor.reduction.projection.bases import Basis, check_pod, pod_basis, project
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, Settings, StepTolerance
from vehiclemor.reduction.solved_path import solved_path
from vehiclemor.reduction.state_space import SolvedAnywhere
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.trajectory import Trajectory

# Every monomial is a line of machine code in each equation.
MOST_MONOMIALS = 150
HIGHEST_DEGREE = 8
# Points beside each snapshot, and their largest distance from it (scaled reduced coordinates).
NEIGHBOURS = 10
SPREAD = 0.05
# Modes with a singular value below it times the first are rounding.
RANK_TOLERANCE = 1e-10
# Random points at which linearity in the inputs is checked, and the largest deviation (rad or m).
LINEARITY_CHECKS = 3
LINEARITY_TOLERANCE = 1e-12


class PolynomialResidualSettings(Settings):
    """Settings for a kinematic model."""

    rank: Annotated[int, AT_MOST_COORDINATES] = Field(3, ge=1, description="reduced coordinates")
    degree: int = Field(3, ge=1, description="total degree of the polynomials")
    snapshots: int = Field(101, ge=2, description="snapshots in each training run")
    solver: Literal["chord", "newton"] = Field(
        "chord",
        description="chord: constant reduced Jacobian; newton: a fresh one in each iteration",
    )
    tolerance: StepTolerance = 1e-6
    seed: int = Field(0, ge=0, description="seed of the points beside the training path")


@dataclass(frozen=True)
class PolynomialResidualModel(SolvedAnywhere):
    """Polynomial reduced equations g(x) = response^T (u - u_mean).

    Attributes
    ----------
    basis
        Affine subspace of the coordinates.
    scales
        Largest reduced coordinates (r,) of training: x = U^T (q - q_mean) / scales.
    degree
        Total degree of the polynomials.
    test
        Fixed test space (n, r), such that g has the unit matrix as its Jacobian at x = 0.
    mean_inputs
        Mean inputs (inputs,) of training.
    response
        Change of g for each unit of an input (inputs, r).
    coefficients
        Of each monomial in each equation (monomials, r).
    newton, tolerance
        Whether Jacobians are fresh, and the largest step of the last iteration.
    """

    model: AlgebraicModel
    basis: Basis
    scales: np.ndarray
    degree: int
    test: np.ndarray
    mean_inputs: np.ndarray
    response: np.ndarray
    coefficients: np.ndarray
    newton: bool
    tolerance: float
    offline: Offline

    @property
    def effective_rank(self) -> int:
        """Number of reduced coordinates."""
        return self.basis.rank

    def solved(self, times: np.ndarray, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Solve the polynomial equations at some times, beginning at a state (n,)."""
        model, began_at = self.model, self.reduced(state[None, :])[0]
        rank, start_at = self.basis.rank, loop_array(began_at)
        given = (inputs, start_at, self._polynomials, int(self.newton), ITERATION_LIMIT)
        loop, buffer = self._loop("reduced_path"), np.empty(6 * rank + rank * (rank + 1))
        return solved_path(model, times, inputs, lambda to: loop.prepared(*given, to, buffer))[0]

    @cached_property
    def _polynomials(self) -> Ready:
        return ready(
            Polynomials(
                np.concatenate([self.mean_inputs, self.basis.mean]),
                loop_array((self.basis.vectors * self.scales).T),
                loop_array(self.response),
                loop_array(self.coefficients),
                derivatives(self.coefficients, self.basis.rank, self.degree),
                self.tolerance / self.scales,
            )
        )

    def reduced(self, states: np.ndarray) -> np.ndarray:
        """Scaled reduced coordinates (samples, r) of states (samples, n)."""
        return (states - self.basis.mean) @ self.basis.vectors / self.scales

    def fitted_residual(self, points: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Fitted W^T Phi (samples, r) at scaled reduced coordinates (samples, r) and inputs."""
        loads = loop_array((inputs - self.mean_inputs) @ self.response)
        result = np.empty(loads.shape)
        coefficients = loop_array(self.coefficients)
        self._loop("terms_path")(loop_array(points), loads, coefficients, result)
        return result

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """Projection of states (samples, n) onto the subspace."""
        return project(states, self.basis)

    def _loop(self, name: str) -> Loop:
        return residual_loop(name, len(self.model.inputs), self.basis.rank, self.degree)


def refusal(model: AlgebraicModel) -> str:
    """Models whose inputs enter the equations linearly are accepted."""
    response = _response(model, model.design)
    generator = np.random.default_rng(0)
    for _ in range(LINEARITY_CHECKS):
        q = model.design + generator.uniform(-0.1, 0.1, len(model.design))
        u = generator.uniform(-0.1, 0.1, len(model.inputs))
        change = model.residual(q, u) - model.residual(q, np.zeros(len(u)))
        if np.abs(change - response @ u).max() > LINEARITY_TOLERANCE:
            return (
                "polynomial_residual needs inputs that enter the equations of "
                f"{model.name} linearly"
            )
    return ""


def check(model: AlgebraicModel, settings: PolynomialResidualSettings) -> None:
    """Raise `InputError` if rank, degree or snapshots don't fit the model or each other."""
    rank, degree = settings.rank, settings.degree
    check_pod(rank, settings.snapshots, len(model.coordinates), f"coordinates of {model.name}")
    if degree > HIGHEST_DEGREE:
        raise InputError(f"degree {degree} is above {HIGHEST_DEGREE}")
    count = math.comb(rank + degree, rank)
    if count > MOST_MONOMIALS:
        raise InputError(
            f"degree {degree} with rank {rank} has {count} monomials; at most {MOST_MONOMIALS}"
        )


def fit(
    model: AlgebraicModel, training: Training, settings: PolynomialResidualSettings
) -> PolynomialResidualModel:
    """POD of equidistant snapshots, and polynomials through residuals along and beside their path.

    Raises
    ------
    InputError
        If the mechanism doesn't move in training.
    """
    began = time.process_time()
    count, degree = settings.snapshots, settings.degree
    runs = [run.snapshots(count) for run in training]
    states = np.concatenate([run.coordinates for run in runs])
    mean_inputs = np.concatenate([run.inputs for run in runs]).mean(axis=0)
    if np.ptp(states, axis=0).max() == 0.0:
        raise InputError("polynomial_residual: the mechanism doesn't move in training")
    basis = pod_basis(states.T, settings.rank, RANK_TOLERANCE)
    scaled = (states - basis.mean) @ basis.vectors
    scales = np.abs(scaled).max(axis=0)
    points = _points(scaled / scales, settings.seed)
    test = model.jacobian(basis.mean, mean_inputs) @ basis.vectors
    lifted = basis.mean + (points * scales) @ basis.vectors.T
    values = model.residual_at(lifted, np.tile(mean_inputs, (len(points), 1))) @ test
    matrix = np.column_stack(
        [np.prod(points[:, list(term)], axis=1) for term in monomials(basis.rank, degree)]
    )
    coefficients = np.linalg.lstsq(matrix, values, rcond=None)[0]
    # Multiplied by the inverse of the Jacobian at x = 0, whose rows are the linear terms.
    inverse = np.linalg.inv(coefficients[1 : basis.rank + 1])
    test, coefficients = test @ inverse, coefficients @ inverse
    return PolynomialResidualModel(
        model,
        basis,
        scales,
        degree,
        test,
        mean_inputs,
        -(test.T @ _response(model, basis.mean)).T,
        coefficients,
        settings.solver == "newton",
        settings.tolerance,
        offline_cost(began, model, runs, len(points)),
    )


def _response(model: AlgebraicModel, q: np.ndarray) -> np.ndarray:
    """Changes (n, inputs) of the residual for each unit of an input, at coordinates q (n,)."""
    step, inputs = 0.125, len(model.inputs)
    rest = model.residual(q, np.zeros(inputs))
    changes = [model.residual(q, step * unit) - rest for unit in np.eye(inputs)]
    return np.column_stack(changes) / step


def _points(path: np.ndarray, seed: int) -> np.ndarray:
    """Points (samples, r) of a path (snapshots, r) and others beside it.

    On the path alone the reduced coordinates are functions of one another, and the polynomials not
    determined; what they are beside it steers the iteration.
    """
    generator = np.random.default_rng(seed)
    shape = (NEIGHBOURS, *path.shape)
    beside = path + generator.uniform(-SPREAD, SPREAD, shape)
    return np.concatenate([path, beside.reshape(-1, path.shape[1])])


METHOD = Method(
    name="polynomial_residual",
    summary="POD with a fixed test space; the reduced equations are fitted polynomials",
    settings={"ae": PolynomialResidualSettings},
    refusal=refusal,
    check=check,
    fit=fit,
)
