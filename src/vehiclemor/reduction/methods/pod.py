"""POD: in control periods, which is the paper's method, with one basis, or interpolated (DEIM).

R. Masoudi, T. Uchida, J. McPhee, Reduction of Multibody Dynamic Models in Automotive Systems Using
the Proper Orthogonal Decomposition, J. Comput. Nonlinear Dyn. 10(3), 031007 (2015), section 3.
L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987).

DEIM: S. Chaturantabut, D. C. Sorensen, Nonlinear model reduction via discrete empirical
interpolation, SIAM J. Sci. Comput. 32 (2010), 2737-2764.  Rates f are approximated by
U (P'U)^-1 P'f, where P takes some of their rows; U holds the POD basis V of the states, beside one
of the rates that are left.  The rows are chosen by pyMOR.  All rows are evaluated here: of a
vehicle's equations, which share nearly all that they compute, few rows cost nearly as much.
"""

import time
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import FittedModel, Method, installed, offline_cost
from vehiclemor.reduction.projection import algebraic, dynamic, structural
from vehiclemor.reduction.projection.bases import Rank, Snapshots, window_edges
from vehiclemor.reduction.projection.dynamic import DynamicPodSettings, DynamicProjection
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, ProjectedSolver, Settings
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

# Directions of rates below this part of the largest one are rounding.
ROUNDING = 1e-8
PROJECTIONS = {"ae": algebraic, "ode": dynamic, "dae": dynamic, "structural": structural}
SETTINGS: dict[str, type[Settings]] = {
    "ae": algebraic.AlgebraicPodSettings,
    "ode": dynamic.DynamicPodSettings,
    "dae": dynamic.ConstrainedPodSettings,
    "structural": structural.StructuralPodSettings,
}
# Lengths in s of the paper's control periods, and the shortest: no motion of a vehicle happens in
# less.
PERIODS = {"ae": 5.0, "ode": 0.5, "dae": 0.1, "structural": 0.5}
SHORTEST_PERIOD = {"ae": 1e-3, "ode": 1e-2, "dae": 1e-2, "structural": 0.1}
ControlPeriod = Annotated[float, Field(gt=0.0, description="length of a control period in s")]
Restart = Annotated[
    Literal["own", "projected", "full_model"],
    Field(
        description="where a control period starts: own: where the one before has ended; "
        "projected: at the full model's state, projected onto the period's subspace (paper, step "
        "6); full_model: at that state itself, the origin of the subspace from there on, as in a "
        "model-predictive controller; the full model runs beside both"
    ),
]
# As many snapshots of one basis as the paper's control periods have together.
SNAPSHOTS = {"ae": 20, "ode": 500, "dae": 500}
DYNAMIC_LITERAL = {"formulation": "state", "inner_product": "euclidean", "rank_tolerance": 0.0}
# `literal` takes the paper's words literally.
PRESETS = {
    "ae": {"literal": {"test_space": "galerkin", "rank_tolerance": 0.0}},
    "ode": {"literal": DYNAMIC_LITERAL},
    "dae": {"literal": DYNAMIC_LITERAL},
}


def _in_periods(kind: str) -> type[Settings]:
    """Settings of POD in control periods."""
    fields: dict[str, Any] = {"control_period": (ControlPeriod, PERIODS[kind])}
    if kind in ("ode", "dae"):
        fields["restart"] = Restart, "own"
    return create_model("PodSettings", __base__=SETTINGS[kind], **fields)


def _of_one_basis(kind: str) -> type[Settings]:
    """Settings of POD with one basis."""
    fields: dict[str, Any] = {}
    if kind in SNAPSHOTS:
        fields["snapshots"] = Snapshots, SNAPSHOTS[kind]
    return create_model("FixedBasisSettings", __base__=SETTINGS[kind], **fields)


def check(model: Model, settings: Any) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    PROJECTIONS[model.kind].check_subspace(model, settings)
    period, shortest = getattr(settings, "control_period", np.inf), SHORTEST_PERIOD[model.kind]
    if period < shortest:
        raise InputError(f"control_period is below {shortest:g} s")


def fit(model: Model, training: Training, settings: Any) -> FittedModel:
    """One POD subspace for each control period of the training runs, or for the whole of them."""
    duration = training[0].maneuver.duration
    edges = window_edges(duration, getattr(settings, "control_period", duration))
    return PROJECTIONS[model.kind].fit_windows(model, training, edges, settings)


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


def check_rows(model: DynamicModel, settings: DeimSettings) -> None:
    """Raise `InputError` if the settings don't fit the model or each other."""
    dynamic.check_subspace(model, settings)
    if not settings.rank <= settings.rows <= 2 * len(model.coordinates):
        most = 2 * len(model.coordinates)
        raise InputError(f"rows is {settings.rows}; it must be from rank {settings.rank} to {most}")


def fit_rows(
    model: DynamicModel, training: Training, settings: DeimSettings
) -> InterpolatedProjection:
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
    own, _ = np.linalg.qr((trial / scale).T)
    left = (rates / scale) @ (np.eye(len(scale)) - own @ own.T)
    _, sizes, rest = np.linalg.svd(left, full_matrices=False)
    more = rest[: settings.rows - own.shape[1]][sizes[: settings.rows - own.shape[1]] > ROUNDING]
    basis = np.hstack([own, more.T])
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
    name="pod",
    summary="POD with its own mean and basis in each control period (the paper's method)",
    reference="10.1115/1.4029390",
    settings={kind: _in_periods(kind) for kind in SETTINGS},
    presets=PRESETS,
    check=check,
    fit=fit,
    follows_time=True,
)
FIXED_BASIS = Method(
    name="fixed_basis",
    summary="POD with one mean and basis for the whole run",
    reference="10.1090/qam/910462",
    settings={kind: _of_one_basis(kind) for kind in SETTINGS},
    presets=PRESETS,
    check=check,
    fit=fit,
)
DEIM = Method(
    name="deim",
    summary="POD with one basis, rates from few rows of the equations (DEIM), by pyMOR",
    reference="10.1137/090766498",
    settings=dict.fromkeys(("ode", "dae"), DeimSettings),
    check=check_rows,
    fit=fit_rows,
    packages=("pymor",),
)
