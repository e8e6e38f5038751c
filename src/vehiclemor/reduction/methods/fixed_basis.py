"""POD with one basis for the whole run: control-period POD with a single window.

L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987).
"""

import numpy as np

from vehiclemor.reduction.interface import Method, ReducedModel
from vehiclemor.reduction.projection.algebraic import AlgebraicPodSettings
from vehiclemor.reduction.projection.bases import Snapshots
from vehiclemor.reduction.projection.dynamic import ConstrainedPodSettings, DynamicPodSettings
from vehiclemor.reduction.projection.subspaces import PRESETS, check_subspaces, fit_subspaces
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.model import Model


# As many snapshots by kind of model as the paper's control periods have together.
class AlgebraicSettings(AlgebraicPodSettings):
    """Settings for algebraic equations."""

    snapshots: Snapshots = 20


class DynamicSettings(DynamicPodSettings):
    """Settings for ordinary differential equations."""

    snapshots: Snapshots = 500


class ConstrainedSettings(ConstrainedPodSettings):
    """Settings for equations with constraints."""

    snapshots: Snapshots = 500


def fit(
    model: Model,
    training: Training,
    settings: AlgebraicSettings | DynamicSettings | ConstrainedSettings,
) -> ReducedModel:
    """One POD subspace for the whole of the training runs."""
    edges = np.array([0.0, training[0].maneuver.duration])
    return fit_subspaces(model, training, edges, settings)


METHOD = Method(
    name="fixed_basis",
    summary="POD with one mean and basis for the whole run",
    reference="10.1090/qam/910462",
    settings={"ae": AlgebraicSettings, "ode": DynamicSettings, "dae": ConstrainedSettings},
    presets=PRESETS,
    check=check_subspaces,
    fit=fit,
)
