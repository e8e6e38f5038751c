"""POD subspaces for models of every kind."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.reduction.projection import algebraic, dynamic
from vehiclemor.reduction.projection.pod_settings import AlgebraicPodSettings, DynamicPodSettings
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

SubspaceSettings = AlgebraicPodSettings | DynamicPodSettings


def check_subspaces(model: Model, settings: SubspaceSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    if isinstance(model, AlgebraicModel) and isinstance(settings, AlgebraicPodSettings):
        algebraic.check_subspace(model, settings)
    elif isinstance(model, DynamicModel) and isinstance(settings, DynamicPodSettings):
        dynamic.check_subspace(model, settings)


def fit_subspaces(
    model: Model,
    training: Sequence[TrainingRun],
    edges: np.ndarray,
    settings: SubspaceSettings,
) -> ReducedModel:
    """One subspace in each window with the given edges (windows + 1,) in s."""
    if isinstance(model, AlgebraicModel) and isinstance(settings, AlgebraicPodSettings):
        return algebraic.fit_windows(model, training, edges, settings)
    if isinstance(model, DynamicModel) and isinstance(settings, DynamicPodSettings):
        return dynamic.fit_windows(model, training, edges, settings)
    raise TypeError(f"{model.name} is neither an algebraic nor a dynamic model")
