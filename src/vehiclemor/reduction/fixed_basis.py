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
from vehiclemor.reduction.settings import Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import AlgebraicModel

SUMMARY = "POD with one mean and basis for the whole run"
REFERENCE = "10.1090/qam/910462"
# As many snapshots as two control periods of the paper have together.
SETTINGS = {**SUBSPACE_SETTINGS, "snapshots": replace(SUBSPACE_SETTINGS["snapshots"], default=20)}
PRESETS = SUBSPACE_PRESETS


def presets(model: str) -> dict[str, dict[str, Value]]:
    """Presets; the same for every kinematic model."""
    del model
    return PRESETS


def accepts(model: AlgebraicModel) -> tuple[bool, str]:
    """Whether the model is of a kind that this method can reduce."""
    return (
        model.kind == "ae",
        f"fixed_basis reduces models of kind ae, {model.name} is {model.kind}",
    )


def check(model: AlgebraicModel, settings: Mapping[str, Value]) -> None:
    """Raise `InputError` if the settings don't fit the model."""
    check_subspace(model, dict(settings))


def fit(
    model: AlgebraicModel, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedModel:
    """One POD subspace for the whole of the training runs."""
    edges = np.array([0.0, training[0].maneuver.duration])
    return fit_windows(model, training, edges, dict(settings))
