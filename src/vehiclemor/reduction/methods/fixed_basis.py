"""POD with one basis for the whole run: control-period POD with a single window.

L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.reduction.projection.subspaces import (
    PRESETS_BY_KIND,
    SETTINGS_BY_KIND,
    accepted,
    check_subspaces,
    fit_subspaces,
)
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.model import Model

SUMMARY = "POD with one mean and basis for the whole run"
REFERENCE = "10.1090/qam/910462"
# As many snapshots by kind of model as the paper's control periods have together.
SNAPSHOTS = {"ae": 20, "ode": 500, "dae": 500}


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    if kind not in SETTINGS_BY_KIND:
        return {}
    shared = SETTINGS_BY_KIND[kind]
    return {**shared, "snapshots": replace(shared["snapshots"], default=SNAPSHOTS[kind])}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets for models of the model's kind."""
    return PRESETS_BY_KIND.get(model.kind, {})


def accepts(model: Model) -> tuple[bool, str]:
    """Whether the model is of a kind that this method can reduce."""
    return accepted("fixed_basis", model)


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspaces(model, settings)


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedModel:
    """One POD subspace for the whole of the training runs."""
    edges = np.array([0.0, training[0].maneuver.duration])
    return fit_subspaces(model, training, edges, settings)
