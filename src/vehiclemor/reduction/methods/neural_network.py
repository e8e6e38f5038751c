"""A neural network, by scikit-learn: a multilayer perceptron on what a linear step leaves.

K. S. Narendra, K. Parthasarathy, Identification and control of dynamical systems using neural
networks, IEEE Trans. Neural Netw. 1 (1990), 4-27.
"""

import warnings
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.learned.learned_method import EVERY, learned_method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, TrainingData

# By which weights begin.
SEED = 0


class NeuralNetworkSettings(LearnedSettings):
    """Settings for every model."""

    width: int = Field(32, ge=1, le=512, description="neurons in each hidden layer")
    layers: int = Field(2, ge=1, le=4, description="hidden layers, with tanh")
    penalty: float = Field(1e-5, ge=0.0, description="weight of the squared weights in the fit")
    epochs: int = Field(60, ge=1, le=2000, description="passes over the samples, at most")


def with_network(data: TrainingData, settings: NeuralNetworkSettings) -> LearnedModel:
    """A linear step, and the network of scikit-learn on what it leaves."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    (arguments, _), (equations, left) = data.regression, data.linear
    scale = data.residual_scale
    network: Any = MLPRegressor(
        hidden_layer_sizes=(settings.width,) * settings.layers,
        activation="tanh",
        alpha=settings.penalty,
        max_iter=settings.epochs,
        random_state=SEED,
    )
    with warnings.catch_warnings():
        # The number of epochs is a setting: validation judges what they have reached.
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(arguments, left / scale)
    weights, offsets = [*network.coefs_], [*network.intercepts_]
    weights[-1], offsets[-1] = weights[-1] * scale, offsets[-1] * scale
    flat = [part.ravel() for pair in zip(weights, offsets, strict=True) for part in pair]
    widths = np.array([len(weights[0]), *map(len, offsets)], dtype=np.int64)
    return data.model(equations._replace(widths=widths, weights=np.concatenate(flat)))


METHOD = learned_method(
    "neural_network",
    "one linear step and a multilayer perceptron on what it leaves, by scikit-learn",
    "10.1109/72.80202",
    with_network,
    NeuralNetworkSettings,
    "sklearn",
    kinds=EVERY,
)
