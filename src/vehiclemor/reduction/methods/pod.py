"""POD in control periods: the paper's method.

R. Masoudi, T. Uchida, J. McPhee, Reduction of Multibody Dynamic Models in Automotive Systems Using
the Proper Orthogonal Decomposition, J. Comput. Nonlinear Dyn. 10(3), 031007 (2015), section 3.
"""

from typing import Annotated, Literal

from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method, ReducedModel
from vehiclemor.reduction.projection.algebraic import AlgebraicPodSettings
from vehiclemor.reduction.projection.bases import window_edges
from vehiclemor.reduction.projection.dynamic import (
    ConstrainedPodSettings,
    DynamicPodSettings,
    RestartedProjection,
)
from vehiclemor.reduction.projection.subspaces import PRESETS, check_subspaces, fit_subspaces
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.model import Model

# Shortest control period in s by kind of model: no motion of a vehicle happens in less.
SHORTEST_PERIOD = {"ae": 1e-3, "ode": 1e-2, "dae": 1e-2}
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


# Lengths of the control periods are the paper's.
class AlgebraicSettings(AlgebraicPodSettings):
    """Settings for algebraic equations."""

    control_period: ControlPeriod = 5.0


class DynamicSettings(DynamicPodSettings):
    """Settings for ordinary differential equations."""

    control_period: ControlPeriod = 0.5
    restart: Restart = "own"


class ConstrainedSettings(ConstrainedPodSettings):
    """Settings for equations with constraints."""

    control_period: ControlPeriod = 0.1
    restart: Restart = "own"


PodSettings = AlgebraicSettings | DynamicSettings | ConstrainedSettings


def check(model: Model, settings: PodSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspaces(model, settings)
    shortest = SHORTEST_PERIOD[model.kind]
    if settings.control_period < shortest:
        raise InputError(f"control_period is below {shortest:g} s")


def fit(model: Model, training: Training, settings: PodSettings) -> ReducedModel:
    """One POD subspace for each control period of the training runs."""
    edges = window_edges(training[0].maneuver.duration, settings.control_period)
    reduced = fit_subspaces(model, training, edges, settings)
    if isinstance(settings, AlgebraicSettings) or settings.restart == "own":
        return reduced
    return RestartedProjection(**vars(reduced), moved=settings.restart == "full_model")


METHOD = Method(
    name="pod",
    summary="POD with its own mean and basis in each control period (the paper's method)",
    reference="10.1115/1.4029390",
    settings={"ae": AlgebraicSettings, "ode": DynamicSettings, "dae": ConstrainedSettings},
    presets=PRESETS,
    check=check,
    fit=fit,
    follows_time=True,
)
