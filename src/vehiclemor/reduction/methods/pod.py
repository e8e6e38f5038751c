"""POD in control periods: the paper's method.

R. Masoudi, T. Uchida, J. McPhee, Reduction of Multibody Dynamic Models in Automotive Systems Using
the Proper Orthogonal Decomposition, J. Comput. Nonlinear Dyn. 10(3), 031007 (2015), section 3.
"""

from collections.abc import Mapping, Sequence

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.reduction.projection.subspaces import (
    PRESETS_BY_KIND,
    SETTINGS_BY_KIND,
    accepted,
    check_subspaces,
    fit_subspaces,
)
from vehiclemor.reduction.projection.windows import window_edges
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.model import Model

# Shortest control period in s by kind of model: no motion of a vehicle happens in less.
SHORTEST_PERIOD = {"ae": 1e-3, "ode": 1e-2, "dae": 1e-2}
SUMMARY = "POD with its own mean and basis in each control period (the paper's method)"
REFERENCE = "10.1115/1.4029390"
# Length of a control period in s by kind of model, as in the paper.
CONTROL_PERIOD = {"ae": 5.0, "ode": 0.5, "dae": 0.1}


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    if kind not in SETTINGS_BY_KIND:
        return {}
    text = "length of a control period in s"
    period = Setting("number", CONTROL_PERIOD[kind], text, minimum=0.0, above=True)
    return {**SETTINGS_BY_KIND[kind], "control_period": period}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets for models of the model's kind."""
    return PRESETS_BY_KIND.get(model.kind, {})


def accepts(model: Model) -> tuple[bool, str]:
    """Whether the model is of a kind that this method can reduce."""
    return accepted("pod", model)


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspaces(model, settings)
    shortest = SHORTEST_PERIOD[model.kind]
    if float(settings["control_period"]) < shortest:
        raise InputError(f"control_period is below {shortest:g} s")


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedModel:
    """One POD subspace for each control period of the training runs."""
    edges = window_edges(training[0].maneuver.duration, float(settings["control_period"]))
    return fit_subspaces(model, training, edges, settings)
