"""General learners: a library fits polynomials, kernels or a network to samples, our loop runs.

Operator inference: B. Peherstorfer, K. Willcox, Data-driven operator inference for nonintrusive
projection-based model reduction, Comput. Methods Appl. Mech. Engrg. 306 (2016), 196-215.

Sparse identification with control (SINDYc): S. L. Brunton, J. L. Proctor, J. N. Kutz, Sparse
identification of nonlinear dynamics with control, IFAC-PapersOnLine 49-18 (2016), 710-715.

Dynamic mode decomposition with control, plain (DMDc) and extended by monomials (EDMDc):
J. L. Proctor, S. L. Brunton, J. N. Kutz, Dynamic mode decomposition with control, SIAM J. Appl.
Dyn. Syst. 15 (2016), 142-161; M. Korda, I. Mezic, Linear predictors for nonlinear dynamical
systems: Koopman operator meets model predictive control, Automatica 93 (2018), 149-160.

Gaussian processes: C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT
Press 2006.  Neural networks: K. S. Narendra, K. Parthasarathy, Identification and control of
dynamical systems using neural networks, IEEE Trans. Neural Netw. 1 (1990), 4-27.
"""

import warnings
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned.learned_model import (
    LearnedModel,
    LearnedSettings,
    Learning,
    columns,
    monomials,
    polynomials,
)
from vehiclemor.reduction.training import Training

FORMS = {"linear": "AB", "bilinear": "ABN", "quadratic": "AHBN"}
MOVING = ("ode", "dae", "structural")
# Name by which a library is imported -> its package.
PACKAGES = {"opinf": "opinf", "pysindy": "pysindy", "sklearn": "scikit-learn"}
# By which samples are taken and weights begin.
SEED = 0


def learner(
    described: tuple[str, str, str],
    learned: Callable[[Learning, Any], LearnedModel],
    settings: type[LearnedSettings],
    library: str,
    *,
    mapped: bool = True,
    kinds: tuple[str, ...] = MOVING,
) -> Method:
    """The method of a learner: of changes in one step where `mapped`, else of rates.

    It is described by name, summary and reference.
    """

    def fit(model: Any, training: Training, chosen: Any) -> LearnedModel:
        steps = mapped and model.kind != "ae"
        return learned(Learning.of(model, training, chosen, steps, library), chosen)

    name, summary, reference = described
    declared = dict.fromkeys(kinds, settings)
    return Method(name, summary, declared, fit, reference, packages=(PACKAGES[library],))


class OperatorInferenceSettings(LearnedSettings):
    """Settings for every model with states."""

    form: Literal["linear", "bilinear", "quadratic"] = Field(
        "linear", description="of the rates; products of states with inputs, and with states too"
    )
    ridge: float = Field(1e-6, ge=0.0, description="weight of the operators' size in the fit")


def operators(learning: Learning, settings: OperatorInferenceSettings) -> LearnedModel:
    """Operators of the rates by opinf."""
    import opinf

    (arguments, results), r = learning.regression, len(learning.forward)
    form = "c" * learning.samples.constant + FORMS[settings.form]
    solver = opinf.lstsq.L2Solver(settings.ridge)
    library: Any = opinf.models.ContinuousModel(form, solver=solver)
    z, inputs = arguments[:, :r].T, arguments[:, r:].T
    library.fit(states=z, ddts=results[:, :r].T, inputs=inputs)
    terms: dict[str, list[tuple[int, ...]]] = {
        "c": [()],
        "A": [(i,) for i in range(1, r + 1)],
        "H": [(i, j) for i in range(1, r + 1) for j in range(1, i + 1)],
        "B": [(r + j,) for j in range(1, len(inputs) + 1)],
        "N": [(r + j, i) for j in range(1, len(inputs) + 1) for i in range(1, r + 1)],
    }
    entries = [np.reshape(operator.entries, (r, -1)).T for operator in library.operators]
    listed = [term for name in form for term in terms[name]]
    return learning.model(learning.with_motion(listed, np.vstack(entries)))


class SparseIdentificationSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the polynomials of components and inputs")
    threshold: float = Field(0.01, ge=0.0, description="terms of smaller coefficients are dropped")
    ridge: float = Field(1e-6, ge=0.0, description="weight of the coefficients' size in the fit")


def sparse_terms(learning: Learning, settings: SparseIdentificationSettings) -> LearnedModel:
    """Terms of the rates by PySINDy."""
    import pysindy

    arguments, results = learning.regression
    r, samples = len(learning.forward), learning.samples
    library: Any = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=settings.threshold, alpha=settings.ridge),
        feature_library=pysindy.PolynomialLibrary(settings.degree, include_bias=samples.constant),
    )
    z, inputs = arguments[:, :r], arguments[:, r:]
    library.fit(z, t=samples.spacing, x_dot=results[:, :r], u=inputs)
    powers = np.asarray(library.feature_library.powers_)
    terms = [tuple(np.repeat(np.arange(1, len(row) + 1), row).tolist()) for row in powers]
    return learning.model(learning.with_motion(terms, library.coefficients().T))


class DynamicModeSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the observables: 1 is DMDc, more EDMDc")
    ridge: float = Field(1e-8, ge=0.0, description="weight of the matrices' size in the fit")


def linear_step(learning: Learning, settings: DynamicModeSettings) -> LearnedModel:
    """One linear step of all observables by scikit-learn."""
    from sklearn.linear_model import Ridge

    s, r = learning.samples, len(learning.forward)
    observables = monomials(r, settings.degree, s.constant)
    values, following = (columns(observables, z) for z in learning.coordinates)
    arguments = np.hstack([values, learning.inputs])
    results = np.hstack([following - values, s.motion])
    # Monomials are rare where they are large: each counts alike.
    scale = np.sqrt((arguments**2).mean(axis=0))
    scale[scale == 0.0] = 1.0
    linear: Any = Ridge(settings.ridge * len(arguments), fit_intercept=False)
    linear.fit(arguments / scale, results)
    terms = monomials(len(scale), 1, constant=False)
    equations = polynomials(terms, (linear.coef_ / scale).T, len(scale))
    return learning.model(equations, observables)


class GaussianProcessSettings(LearnedSettings):
    """Settings for every model."""

    samples: int = Field(1000, ge=10, le=4000, description="training samples, each a kernel")
    length: float = Field(10.0, gt=0.0, description="of the kernels, in standard deviations")
    noise: float = Field(1e-3, gt=0.0, description="variance of the noise, of the results' own")


def with_kernels(learning: Learning, settings: GaussianProcessSettings) -> LearnedModel:
    """A linear step, and the kernels of scikit-learn on what it leaves."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF

    (arguments, _), (equations, left) = learning.regression, learning.linear
    scale = learning.residual_scale
    order = np.random.default_rng(SEED).permutation(len(arguments))[: settings.samples]
    x, y = arguments[order], left[order] / scale
    # Lengths of largest likelihood are too short: samples lie densely along runs, not beside them.
    kernel: Any = RBF(settings.length)
    options: Any = {"alpha": settings.noise, "optimizer": None}
    process: Any = GaussianProcessRegressor(kernel, **options).fit(x, y)
    lengths = np.full(x.shape[1], settings.length)
    heights = np.ascontiguousarray(np.reshape(process.alpha_, (len(x), len(scale))) * scale)
    parts = {"lengths": lengths, "centres": x / lengths, "heights": heights}
    return learning.model(equations._replace(**parts))


class NeuralNetworkSettings(LearnedSettings):
    """Settings for every model."""

    width: int = Field(32, ge=1, le=512, description="neurons in each hidden layer")
    layers: int = Field(2, ge=1, le=4, description="hidden layers, with tanh")
    penalty: float = Field(1e-5, ge=0.0, description="weight of the squared weights in the fit")
    epochs: int = Field(60, ge=1, le=2000, description="passes over the samples, at most")


def with_network(learning: Learning, settings: NeuralNetworkSettings) -> LearnedModel:
    """A linear step, and the network of scikit-learn on what it leaves."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    (arguments, _), (equations, left) = learning.regression, learning.linear
    scale = learning.residual_scale
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
    return learning.model(equations._replace(widths=widths, weights=np.concatenate(flat)))


OPERATOR_INFERENCE = learner(
    (
        "operator_inference",
        "linear or quadratic rates of principal components, fitted by opinf",
        "10.1016/j.cma.2016.03.025",
    ),
    operators,
    OperatorInferenceSettings,
    "opinf",
    mapped=False,
)
SPARSE_IDENTIFICATION = learner(
    (
        "sparse_identification",
        "sparse polynomial rates of principal components (SINDYc), fitted by PySINDy",
        "10.1016/j.ifacol.2016.10.249",
    ),
    sparse_terms,
    SparseIdentificationSettings,
    "pysindy",
    mapped=False,
)
DYNAMIC_MODE_DECOMPOSITION = learner(
    (
        "dynamic_mode_decomposition",
        "one linear step of components and their monomials (DMDc, EDMDc), by scikit-learn",
        "10.1016/j.automatica.2018.03.046",
    ),
    linear_step,
    DynamicModeSettings,
    "sklearn",
)
GAUSSIAN_PROCESS = learner(
    (
        "gaussian_process",
        "one linear step and Gaussian kernels on what it leaves, by scikit-learn",
        "10.7551/mitpress/3206.001.0001",
    ),
    with_kernels,
    GaussianProcessSettings,
    "sklearn",
    kinds=("ae", *MOVING),
)
NEURAL_NETWORK = learner(
    (
        "neural_network",
        "one linear step and a multilayer perceptron on what it leaves, by scikit-learn",
        "10.1109/72.80202",
    ),
    with_network,
    NeuralNetworkSettings,
    "sklearn",
    kinds=("ae", *MOVING),
)
