"""Gaussian processes, by scikit-learn: kernels on what a linear step leaves.

C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006.
"""

from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.learned.learned_method import EVERY, learned_method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, TrainingData

# By which samples are taken.
SEED = 0


class GaussianProcessSettings(LearnedSettings):
    """Settings for every model."""

    samples: int = Field(1000, ge=10, le=4000, description="training samples, each a kernel")
    length: float = Field(10.0, gt=0.0, description="of the kernels, in standard deviations")
    noise: float = Field(1e-3, gt=0.0, description="variance of the noise, of the results' own")


def with_kernels(data: TrainingData, settings: GaussianProcessSettings) -> LearnedModel:
    """A linear step, and the kernels of scikit-learn on what it leaves."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF

    (arguments, _), (equations, left) = data.regression, data.linear
    scale = data.residual_scale
    order = np.random.default_rng(SEED).permutation(len(arguments))[: settings.samples]
    x, y = arguments[order], left[order] / scale
    # Lengths of largest likelihood are too short: samples lie densely along runs, not beside them.
    kernel: Any = RBF(settings.length)
    options: Any = {"alpha": settings.noise, "optimizer": None}
    process: Any = GaussianProcessRegressor(kernel, **options).fit(x, y)
    lengths = np.full(x.shape[1], settings.length)
    heights = np.ascontiguousarray(np.reshape(process.alpha_, (len(x), len(scale))) * scale)
    parts = {"lengths": lengths, "centres": x / lengths, "heights": heights}
    return data.model(equations._replace(**parts))


METHOD = learned_method(
    "gaussian_process",
    "one linear step and Gaussian kernels on what it leaves, by scikit-learn",
    "10.7551/mitpress/3206.001.0001",
    with_kernels,
    GaussianProcessSettings,
    "sklearn",
    kinds=EVERY,
)
