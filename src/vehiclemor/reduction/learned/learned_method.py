"""General learned methods: a library fits polynomials, kernels or a network, one loop runs them."""

from collections.abc import Callable
from typing import Any

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, TrainingData
from vehiclemor.reduction.training import Training

MOVING = ("ode", "dae", "structural")
EVERY = ("ae", *MOVING)
# Name by which a library is imported -> its package.
PACKAGES = {"opinf": "opinf", "pysindy": "pysindy", "sklearn": "scikit-learn"}


def learned_method(
    name: str,
    summary: str,
    reference: str,
    regression: Callable[[TrainingData, Any], LearnedModel],
    settings: type[LearnedSettings],
    library: str,
    *,
    discrete_time: bool = True,
    kinds: tuple[str, ...] = MOVING,
) -> Method:
    """A method that learns changes in one step where time is discrete, else rates."""

    def fit(model: Any, training: Training, chosen: Any) -> LearnedModel:
        steps = discrete_time and model.kind != "ae"
        return regression(TrainingData.of(model, training, chosen, steps, library), chosen)

    declared = dict.fromkeys(kinds, settings)
    return Method(name, summary, declared, fit, reference, packages=(PACKAGES[library],))
