"""Methods of general learners: a library fits polynomials, kernels or a network, our loop runs."""

from collections.abc import Callable
from typing import Any

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, Learning
from vehiclemor.reduction.training import Training

MOVING = ("ode", "dae", "structural")
EVERY = ("ae", *MOVING)
# Name by which a library is imported -> its package.
PACKAGES = {"opinf": "opinf", "pysindy": "pysindy", "sklearn": "scikit-learn"}


def learner(
    name: str,
    summary: str,
    reference: str,
    learned: Callable[[Learning, Any], LearnedModel],
    settings: type[LearnedSettings],
    library: str,
    *,
    mapped: bool = True,
    kinds: tuple[str, ...] = MOVING,
) -> Method:
    """The method of a learner: of changes in one step where `mapped`, else of rates."""

    def fit(model: Any, training: Training, chosen: Any) -> LearnedModel:
        steps = mapped and model.kind != "ae"
        return learned(Learning.of(model, training, chosen, steps, library), chosen)

    declared = dict.fromkeys(kinds, settings)
    return Method(name, summary, declared, fit, reference, packages=(PACKAGES[library],))
