"""POD with one basis for the whole run: control-period POD with a single window.

L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.projected import (
    SUBSPACE_PRESETS,
    SUBSPACE_SETTINGS,
    ProjectedModel,
    check_subspace,
    fit_windows,
)
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.model import Model

SUMMARY = "POD with one mean and basis for the whole run"
REFERENCE = "10.1090/qam/910462"
# Kind of model -> settings, and presets.
SETTINGS_BY_KIND: dict[str, dict[str, Setting]] = {
    "ae": {
        **SUBSPACE_SETTINGS,
        # As many snapshots as two control periods of the paper have together.
        "snapshots": replace(SUBSPACE_SETTINGS["snapshots"], default=20),
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
    return (
        model.kind == "ae",
        f"fixed_basis reduces models of kind ae, {model.name} is {model.kind}",
    )


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspace(model, dict(settings))


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedModel:
    """One POD subspace for the whole of the training runs."""
    assert isinstance(model, AlgebraicModel)
    edges = np.array([0.0, training[0].maneuver.duration])
    return fit_windows(model, training, edges, dict(settings))
