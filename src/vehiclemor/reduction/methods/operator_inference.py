"""Operator inference, by the library opinf: polynomial rates of principal components.

B. Peherstorfer, K. Willcox, Data-driven operator inference for nonintrusive projection-based model
reduction, Comput. Methods Appl. Mech. Engrg. 306 (2016), 196-215.
"""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.reduction.learned.learned_method import learned_method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, TrainingData

FORMS = {"linear": "AB", "bilinear": "ABN", "quadratic": "AHBN"}


class OperatorInferenceSettings(LearnedSettings):
    """Settings for every model with states."""

    form: Literal["linear", "bilinear", "quadratic"] = Field(
        "linear", description="of the rates; products of states with inputs, and with states too"
    )
    ridge: float = Field(1e-6, ge=0.0, description="weight of the operators' size in the fit")


def operators(data: TrainingData, settings: OperatorInferenceSettings) -> LearnedModel:
    """Operators of the rates by opinf."""
    import opinf

    (arguments, results), r = data.regression, len(data.forward)
    form = "c" * data.samples.constant + FORMS[settings.form]
    solver = opinf.lstsq.L2Solver(settings.ridge)
    library: Any = opinf.models.ContinuousModel(form, solver=solver)
    z, inputs = arguments[:, :r].T, arguments[:, r:].T
    library.fit(states=z, ddts=results[:, :r].T, inputs=inputs)
    of_state, of_input = range(1, r + 1), range(r + 1, r + len(inputs) + 1)
    terms: dict[str, list[tuple[int, ...]]] = {"c": [()]}
    terms["A"] = [(i,) for i in of_state]
    terms["H"] = [(i, j) for i in of_state for j in range(1, i + 1)]
    terms["B"] = [(j,) for j in of_input]
    terms["N"] = [(j, i) for j in of_input for i in of_state]
    entries = [np.reshape(operator.entries, (r, -1)).T for operator in library.operators]
    listed = [term for name in form for term in terms[name]]
    return data.model(data.with_motion(listed, np.vstack(entries)))


METHOD = learned_method(
    "operator_inference",
    "linear or quadratic rates of principal components, fitted by opinf",
    "10.1016/j.cma.2016.03.025",
    operators,
    OperatorInferenceSettings,
    "opinf",
    discrete_time=False,
)
