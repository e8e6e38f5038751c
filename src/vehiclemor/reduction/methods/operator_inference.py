"""Operator inference, by the library opinf: polynomial rates in reduced coordinates.

B. Peherstorfer, K. Willcox, Data-driven operator inference for nonintrusive projection-based model
reduction, Comput. Methods Appl. Mech. Engrg. 306 (2016), 196-215.
"""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, Learning
from vehiclemor.reduction.training import Training

FORMS = {"linear": "AB", "bilinear": "ABN", "quadratic": "AHBN"}


class OperatorInferenceSettings(LearnedSettings):
    """Settings for every model with states."""

    form: Literal["linear", "bilinear", "quadratic"] = Field(
        "linear", description="of the rates; products of states with inputs, and with states too"
    )
    ridge: float = Field(1e-6, ge=0.0, description="weight of the operators' size in the fit")


def trained(learning: Learning, settings: OperatorInferenceSettings) -> Any:
    """The library's model, fitted on the rates of the training runs."""
    import opinf

    (arguments, results), r = learning.regression, len(learning.components.forward)
    form = "c" * learning.samples.constant + FORMS[settings.form]
    solver = opinf.lstsq.L2Solver(settings.ridge)
    library: Any = opinf.models.ContinuousModel(form, solver=solver)
    z, inputs = arguments[:, :r].T, arguments[:, r:].T
    return library.fit(states=z, ddts=results[:, :r].T, inputs=inputs)


def fit(model: Any, training: Training, settings: OperatorInferenceSettings) -> LearnedModel:
    """Operators by the library, run by our loop."""
    learning = Learning.of(model, training, settings, False, "opinf")
    library, u = trained(learning, settings), learning.inputs.shape[1]
    r, form = len(learning.components.forward), "c" * learning.samples.constant
    terms: dict[str, list[tuple[int, ...]]] = {
        "c": [()],
        "A": [(i,) for i in range(1, r + 1)],
        "H": [(i, j) for i in range(1, r + 1) for j in range(1, i + 1)],
        "B": [(r + j,) for j in range(1, u + 1)],
        "N": [(r + j, i) for j in range(1, u + 1) for i in range(1, r + 1)],
    }
    entries = [np.reshape(operator.entries, (r, -1)).T for operator in library.operators]
    listed = [term for name in form + FORMS[settings.form] for term in terms[name]]
    return learning.model(learning.with_motion(listed, np.vstack(entries)))


METHOD = Method(
    name="operator_inference",
    summary="linear or quadratic rates of principal components, fitted by opinf",
    reference="10.1016/j.cma.2016.03.025",
    settings=dict.fromkeys(("ode", "dae", "structural"), OperatorInferenceSettings),
    fit=fit,
    packages=("opinf",),
)
