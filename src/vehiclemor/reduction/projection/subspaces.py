"""POD subspaces for models of every kind."""

from types import ModuleType

import numpy as np

from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.reduction.projection import algebraic, dynamic
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.model import Model

SubspaceSettings = algebraic.AlgebraicPodSettings | dynamic.DynamicPodSettings
PROJECTIONS: dict[str, ModuleType] = {"ae": algebraic, "ode": dynamic, "dae": dynamic}
DYNAMIC_LITERAL = {"formulation": "state", "inner_product": "euclidean", "rank_tolerance": 0.0}
# `literal` takes the paper's words literally.
PRESETS = {
    "ae": {"literal": {"test_space": "galerkin", "rank_tolerance": 0.0}},
    "ode": {"literal": DYNAMIC_LITERAL},
    "dae": {"literal": DYNAMIC_LITERAL},
}


def check_subspaces(model: Model, settings: SubspaceSettings) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    PROJECTIONS[model.kind].check_subspace(model, settings)


def fit_subspaces(
    model: Model, training: Training, edges: np.ndarray, settings: SubspaceSettings
) -> ReducedModel:
    """One subspace in each window with the given edges (windows + 1,) in s."""
    return PROJECTIONS[model.kind].fit_windows(model, training, edges, settings)
