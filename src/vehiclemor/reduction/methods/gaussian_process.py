"""One-step model by Gaussian processes, by scikit-learn: kernels on what a linear step leaves.

C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006.
"""

from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, Learning
from vehiclemor.reduction.training import Training

# By which samples are taken.
SEED = 0


class GaussianProcessSettings(LearnedSettings):
    """Settings for every model."""

    samples: int = Field(1000, ge=10, le=4000, description="training samples, each a kernel")
    length: float = Field(10.0, gt=0.0, description="of the kernels, in standard deviations")
    noise: float = Field(1e-3, gt=0.0, description="variance of the noise, of the results' own")


def trained(learning: Learning, settings: GaussianProcessSettings) -> Any:
    """The library's process of what a linear step leaves, in units of the `residual_scale`."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF

    (arguments, _), (_, left) = learning.regression, learning.linear
    order = np.random.default_rng(SEED).permutation(len(arguments))[: settings.samples]
    x, y = arguments[order], left[order] / learning.residual_scale
    # Lengths of largest likelihood are too short: samples lie densely along runs, not beside them.
    kernel: Any = RBF(settings.length)
    options: Any = {"alpha": settings.noise, "optimizer": None}
    return GaussianProcessRegressor(kernel, **options).fit(x, y)


def fit(model: Any, training: Training, settings: GaussianProcessSettings) -> LearnedModel:
    """A linear step and the library's kernels, run by our loop."""
    learning = Learning.of(model, training, settings, model.kind != "ae", "sklearn")
    (equations, _), process = learning.linear, trained(learning, settings)
    scale, x = learning.residual_scale, process.X_train_
    lengths = np.full(x.shape[1], settings.length)
    heights = np.ascontiguousarray(np.reshape(process.alpha_, (len(x), len(scale))) * scale)
    parts = {"lengths": lengths, "centres": x / lengths, "heights": heights}
    return learning.model(equations._replace(**parts))


METHOD = Method(
    name="gaussian_process",
    summary="one linear step and Gaussian kernels on what it leaves, by scikit-learn",
    reference="10.7551/mitpress/3206.001.0001",
    settings=dict.fromkeys(("ae", "ode", "dae", "structural"), GaussianProcessSettings),
    fit=fit,
    packages=("scikit-learn",),
)
