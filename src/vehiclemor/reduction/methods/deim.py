"""POD with discrete empirical interpolation (DEIM): rates from few rows of the equations.

S. Chaturantabut, D. C. Sorensen, Nonlinear model reduction via discrete empirical interpolation,
SIAM J. Sci. Comput. 32 (2010), 2737-2764.  Rates f are approximated by U (P'U)^-1 P'f, where P
takes some of their rows; U holds the POD basis V of the states, beside one of the rates that are
left.  The rows are chosen by pyMOR.  All rows are evaluated here: of a vehicle's equations, which
share nearly all that they compute, few rows cost nearly as much.
"""

import time
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, installed, offline_cost
from vehiclemor.reduction.projection import dynamic
from vehiclemor.reduction.projection.bases import Rank
from vehiclemor.reduction.projection.dynamic import DynamicPodSettings, DynamicProjection
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, ProjectedSolver
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.dynamic import DynamicModel

# Directions of rates below this part of the largest one are rounding.
ROUNDING = 1e-8


class DeimSettings(DynamicPodSettings):
    """Settings for equations of motion."""

    rank: Rank = 4
    rows: Annotated[int, AT_MOST_COORDINATES] = Field(
        8, ge=1, description="rows of the equations, at least as many as the rank"
    )
    formulation: Literal["state"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        "state", description="all states in one basis"
    )
    solver: ProjectedSolver = "rodas4"
    snapshots: int = Field(500, ge=2, description="equidistant snapshots of each training run")


@dataclass(frozen=True, eq=False)
class InterpolatedProjection(DynamicProjection):
    """A projection whose rates are interpolated; `within` (r, 2 n) projects the start."""

    within: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def encode(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """The nearest state (2 n,) in the subspace: that of few rows alone would be another."""
        del inputs
        mean = self.spaces.means[0]
        return mean + self.within @ (state - mean) @ self.spaces.trial_basis[0]


def check(model: DynamicModel, settings: DeimSettings) -> None:
    """Raise `InputError` if the settings don't fit the model or each other."""
    dynamic.check_subspace(model, settings)
    if not settings.rank <= settings.rows <= 2 * len(model.coordinates):
        most = 2 * len(model.coordinates)
        raise InputError(f"rows is {settings.rows}; it must be from rank {settings.rank} to {most}")


def fit(model: DynamicModel, training: Training, settings: DeimSettings) -> InterpolatedProjection:
    """POD with one basis, then rows for its rates; `InputError` if pyMOR is missing."""
    with installed("pyMOR"):
        from pymor.algorithms.ei import deim
        from pymor.core.logger import log_levels
        from pymor.vectorarrays.numpy import NumpyVectorSpace
    began, ends = time.process_time(), training[0].maneuver.duration
    projected = dynamic.fit_windows(model, training, np.array([0.0, ends]), settings)
    spaces, runs = projected.spaces, [run.recorded() for run in training]
    trial, test = spaces.trial_basis[0], spaces.test_basis[0]
    rates = np.vstack([model.rhs_at(run.states, run.inputs) for run in runs])
    scale = np.sqrt((rates**2).mean(axis=0))
    scale = np.maximum(scale, ROUNDING * scale.max())
    # The basis of rates begins with that of the states, so that a state stays what it is.
    of_states, _ = np.linalg.qr((trial / scale).T)
    remainder = (rates / scale) @ (np.eye(len(scale)) - of_states @ of_states.T)
    _, sizes, directions = np.linalg.svd(remainder, full_matrices=False)
    more = settings.rows - of_states.shape[1]
    of_rates = directions[:more][sizes[:more] > ROUNDING]
    basis = np.hstack([of_states, of_rates.T])
    with log_levels({"pymor": "ERROR"}):
        rows, *_ = deim(NumpyVectorSpace(len(scale)).make_array(basis), pod=False)
    oblique = np.zeros_like(test)
    oblique[:, rows] = (test * scale) @ basis @ np.linalg.inv(basis[rows]) / scale[rows]
    further = projected.offline.evaluations + len(rates)
    return InterpolatedProjection(
        model,
        replace(spaces, test_basis=oblique[None]),
        offline_cost(began, model, runs, further),
        settings.solver,
        settings.tolerance,
        projected.bases,
        within=test,
    )


METHOD = Method(
    name="deim",
    summary="POD with one basis, rates from few rows of the equations (DEIM), by pyMOR",
    reference="10.1137/090766498",
    settings=dict.fromkeys(("ode", "dae"), DeimSettings),
    refusal=dynamic.further_states_refused,
    check=check,
    fit=fit,
    packages=("pymor",),
)
