"""POD in control periods: the paper's method.

R. Masoudi, T. Uchida, J. McPhee, Reduction of Multibody Dynamic Models in Automotive Systems Using
the Proper Orthogonal Decomposition, J. Comput. Nonlinear Dyn. 10(3), 031007 (2015), section 3.
"""

from collections.abc import Mapping, Sequence

from vehiclemor.errors import InputError
from vehiclemor.reduction.projected import (
    SUBSPACE_PRESETS,
    SUBSPACE_SETTINGS,
    ProjectedModel,
    check_subspace,
    fit_windows,
)
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.windows import window_edges
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.model import Model

# A window of less than a millisecond holds no motion of a vehicle.
SHORTEST_PERIOD = 1e-3
SUMMARY = "POD with its own mean and basis in each control period (the paper's method)"
REFERENCE = "10.1115/1.4029390"
# Kind of model -> settings, and presets.
SETTINGS_BY_KIND: dict[str, dict[str, Setting]] = {
    "ae": {
        **SUBSPACE_SETTINGS,
        "control_period": Setting(
            "number", 5.0, "length of a control period in s", minimum=0.0, above=True
        ),
    },
}
PRESETS_BY_KIND = {"ae": SUBSPACE_PRESETS}


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return SETTINGS_BY_KIND.get(kind, {})


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets for models of the model's kind."""
    return PRESETS_BY_KIND.get(model.kind, {})


def accepts(model: Model) -> tuple[bool, str]:
    """Whether the model is of a kind that this method can reduce."""
    return model.kind == "ae", f"pod reduces models of kind ae, {model.name} is {model.kind}"


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspace(model, dict(settings))
    if float(settings["control_period"]) < SHORTEST_PERIOD:
        raise InputError(f"control_period is below {SHORTEST_PERIOD:g} s")


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedModel:
    """One POD subspace for each control period of the training runs."""
    assert isinstance(model, AlgebraicModel)
    edges = window_edges(training[0].maneuver.duration, float(settings["control_period"]))
    return fit_windows(model, training, edges, dict(settings))
