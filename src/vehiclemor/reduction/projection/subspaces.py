"""POD subspaces for models of every kind: which module reduces which."""

from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.reduction.projection import algebraic as projected
from vehiclemor.reduction.projection import dynamic as dynamic_subspaces
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

# Kind of model -> settings and presets of its subspaces.
SETTINGS_BY_KIND: dict[str, dict[str, Setting]] = {
    "ae": projected.SUBSPACE_SETTINGS,
    "ode": dynamic_subspaces.DYNAMIC_SETTINGS,
    "dae": dynamic_subspaces.CONSTRAINED_SETTINGS,
}
PRESETS_BY_KIND: dict[str, dict[str, dict[str, Value]]] = {
    "ae": projected.SUBSPACE_PRESETS,
    "ode": dynamic_subspaces.DYNAMIC_PRESETS,
    "dae": dynamic_subspaces.DYNAMIC_PRESETS,
}


def accepted(method: str, model: Model) -> tuple[bool, str]:
    """Whether the model's kind has subspaces, and why not."""
    reason = f"{method} reduces models of kinds {', '.join(SETTINGS_BY_KIND)}, not {model.kind}"
    return model.kind in SETTINGS_BY_KIND, reason


def check_subspaces(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    if isinstance(model, AlgebraicModel):
        projected.check_subspace(model, dict(settings))
    elif isinstance(model, DynamicModel):
        dynamic_subspaces.check_subspace(model, settings)


def fit_subspaces(
    model: Model,
    training: Sequence[TrainingRun],
    edges: np.ndarray,
    settings: Mapping[str, Value],
) -> ReducedModel:
    """One subspace in each window with the given edges (windows + 1,) in s."""
    if isinstance(model, AlgebraicModel):
        return projected.fit_windows(model, training, edges, dict(settings))
    if isinstance(model, DynamicModel):
        return dynamic_subspaces.fit_windows(model, training, edges, settings)
    raise TypeError(f"{model.name} is neither an algebraic nor a dynamic model")
