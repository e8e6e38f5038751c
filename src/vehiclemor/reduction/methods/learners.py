"""General learners of one step, each fitted and run by its library.

- `operator_inference` (B. Peherstorfer, K. Willcox, Comput. Methods Appl. Mech. Engrg. 306 (2016),
  196-215): a polynomial step by opinf, which selects the ridge.
- `sparse_identification` (SINDYc: S. L. Brunton, J. L. Proctor, J. N. Kutz, IFAC-PapersOnLine 49-18
  (2016), 710-715): a polynomial step with few terms, by the optimiser of PySINDy.
- `dynamic_mode_decomposition` (DMDc: J. L. Proctor, S. L. Brunton, J. N. Kutz, SIAM J. Appl. Dyn.
  Syst. 15 (2016), 142-161; EDMDc: M. Korda, I. Mezic, Automatica 93 (2018), 149-160): one linear
  step of the coordinates and their monomials, by scikit-learn.
- `gaussian_process` (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning,
  MIT Press 2006) and `neural_network` (K. S. Narendra, K. Parthasarathy, IEEE Trans. Neural Netw. 1
  (1990), 4-27): what a linear step leaves, by scikit-learn.
"""

import warnings
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned_model import (
    LearnedModel,
    LearnedSettings,
    TrainingData,
    paths_in_step,
    predicted,
    stepped,
)
from vehiclemor.reduction.training import Training

# By which samples are taken and weights begin.
SEED = 0
FORMS = {"linear": "AB", "bilinear": "ABN", "quadratic": "AHBN"}
# Among these the library selects what repeats the training runs best, all of them stable.
RIDGES = tuple(10.0**power for power in range(-8, 3, 2))
# How far a coordinate may leave its range in a run that is stable; of a nearly straight run that is
# small, so that the library's own 5 refuses what repeats all others.
STABLE = 100.0


class OperatorInferenceSettings(LearnedSettings):
    """Settings for every model with states."""

    form: Literal["linear", "bilinear", "quadratic"] = Field(
        "linear", description="of a step; products of states with inputs, and with states too"
    )


class SparseIdentificationSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the polynomials of components and inputs")
    threshold: float = Field(1e-4, ge=0.0, description="terms of smaller coefficients are dropped")
    ridge: float = Field(1e-6, ge=0.0, description="weight of the coefficients' size in the fit")


class DynamicModeSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the observables: 1 is DMDc, more EDMDc")
    ridge: float = Field(1e-8, ge=0.0, description="weight of the matrices' size in the fit")


class GaussianProcessSettings(LearnedSettings):
    """Settings for every model."""

    samples: int = Field(1000, ge=10, le=4000, description="training samples, each a kernel")
    length: float = Field(10.0, gt=0.0, description="of the kernels, in standard deviations")
    noise: float = Field(1e-3, gt=0.0, description="variance of the noise, of the results' own")


class NeuralNetworkSettings(LearnedSettings):
    """Settings for every model."""

    width: int = Field(32, ge=1, le=512, description="neurons in each hidden layer")
    layers: int = Field(2, ge=1, le=4, description="hidden layers, with tanh")
    penalty: float = Field(1e-5, ge=0.0, description="weight of the squared weights in the fit")
    epochs: int = Field(60, ge=1, le=2000, description="passes over the samples, at most")


def operators(data: TrainingData, settings: OperatorInferenceSettings) -> LearnedModel:
    """Operators of one step by opinf, with the regularisation that it selects."""
    import opinf

    # The library wants inputs at the last sample too.
    inputs = [np.vstack([u, u[-1:]]).T for u in data.inputs]
    paths, starts = [z.T for z in data.paths], [z[0] for z in data.paths]
    keys = [z.tobytes() + u.tobytes() for z, u in zip(starts, inputs, strict=True)]

    class Step(opinf.models.DiscreteModel):
        """One step; training runs go on together, where the library takes one after the other."""

        def refit(self) -> Any:
            super().refit()
            path = stepped(lambda z, u: self.rhs(z.T, u.T).T)
            self.runs = dict(zip(keys, paths_in_step(path, starts, data.inputs), strict=True))
            return self

        def predict(self, state0: np.ndarray, niters: int, inputs: Any = None) -> np.ndarray:
            return self.runs[state0.tobytes() + inputs.tobytes()][:niters].T

    class Reduced(opinf.lstsq.L2Solver):
        """Least squares of as many rows as there are unknowns, which have the same solution."""

        def fit(self, data_matrix: np.ndarray, lhs_matrix: np.ndarray) -> Any:
            arguments, results = same_least_squares(data_matrix, lhs_matrix.T)
            return super().fit(arguments, results.T)

    step: Any = Step("c" * data.constant + FORMS[settings.form], solver=Reduced(RIDGES[0]))
    chosen = {"stability_margin": STABLE, "gridsearch_only": True}
    try:
        opinf.ROM(step).fit_regselect_discrete([*RIDGES], paths, inputs, **chosen)
    except RuntimeError as error:
        raise InputError("opinf finds no ridge that keeps all training runs stable") from error
    step.runs.clear()
    return data.model(stepped(lambda z, u: step.rhs(z.T, u.T).T))


def same_least_squares(arguments: np.ndarray, results: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As many rows as there are columns, whose residuals differ from those of all by a constant."""
    triangle: Any = np.linalg.qr(np.hstack([arguments, results]), mode="r")
    of_arguments, of_results = np.hsplit(triangle, [arguments.shape[1]])
    return of_arguments, of_results


def sparse_terms(data: TrainingData, settings: SparseIdentificationSettings) -> LearnedModel:
    """Terms of one step by the optimiser of PySINDy, as a regressor of scikit-learn."""
    # `DiscreteSINDy` finds the same in five milliseconds a step.
    from pysindy import STLSQ
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    features = PolynomialFeatures(settings.degree, include_bias=data.constant)
    sparse: Any = STLSQ(threshold=settings.threshold, alpha=settings.ridge)
    arguments, results = data.regression
    sparse.fit(*same_least_squares(features.fit_transform(arguments), results))
    return data.model(predicted((make_pipeline(features, sparse), 1.0)))


def linear_step(data: TrainingData, settings: DynamicModeSettings) -> LearnedModel:
    """One linear step of all observables by scikit-learn."""
    from sklearn.linear_model import Ridge
    from sklearn.preprocessing import PolynomialFeatures

    observables: Any = PolynomialFeatures(settings.degree, include_bias=False)
    now, inputs, following = data.steps
    values, following = observables.fit_transform(now), observables.transform(following)
    arguments, r = np.hstack([values, inputs]), now.shape[1]
    # Monomials are rare where they are large: each counts alike.
    size = arguments.std(axis=0)
    size[size == 0.0] = 1.0
    ridge: Any = Ridge(settings.ridge * len(values), fit_intercept=data.constant)
    ridge.fit(arguments / size, following - values)
    path = stepped(lambda z, u: z + ridge.predict(np.hstack([z, u]) / size))
    # The first observables are the coordinates.
    return data.model(lambda z, u: path(observables.transform(z), u)[..., :r])


def with_kernels(data: TrainingData, settings: GaussianProcessSettings) -> LearnedModel:
    """A linear step, and the kernels of scikit-learn on what it leaves."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF

    order = np.random.default_rng(SEED).permutation(len(data.regression[0]))
    # Lengths of largest likelihood are too short: samples lie densely along runs, not beside them.
    kernel: Any = RBF(settings.length)
    options: Any = {"alpha": settings.noise, "optimizer": None}
    process = GaussianProcessRegressor(kernel, **options)
    return data.with_residual(process, order[: settings.samples])


def with_network(data: TrainingData, settings: NeuralNetworkSettings) -> LearnedModel:
    """A linear step, and the network of scikit-learn on what it leaves."""
    from sklearn.exceptions import ConvergenceWarning, DataConversionWarning
    from sklearn.neural_network import MLPRegressor

    network = MLPRegressor(
        hidden_layer_sizes=(settings.width,) * settings.layers,
        activation="tanh",
        alpha=settings.penalty,
        max_iter=settings.epochs,
        random_state=SEED,
    )
    with warnings.catch_warnings():
        # The number of epochs is a setting: validation judges what they have reached.
        warnings.simplefilter("ignore", ConvergenceWarning)
        # Of a single coordinate, which is a column all the same.
        warnings.simplefilter("ignore", DataConversionWarning)
        return data.with_residual(network, slice(None))


def learner(
    name: str,
    summary: str,
    reference: str,
    regression: Callable[[TrainingData, Any], LearnedModel],
    settings: type[LearnedSettings],
    package: tuple[str, str] = ("scikit-learn", "sklearn"),
) -> Method:
    """A method that learns a step from training runs by a package, imported by another name."""

    def fit(model: Any, training: Training, chosen: Any) -> LearnedModel:
        return regression(TrainingData.of(model, training, chosen, package[1]), chosen)

    # Of a mechanism coordinates follow from the inputs, which needs a regression without steps.
    static = ("ae",) * (settings in (GaussianProcessSettings, NeuralNetworkSettings))
    kinds = (*static, "ode", "dae", "structural")
    declared: Any = dict.fromkeys(kinds, settings)
    return Method(name, summary, declared, fit, reference, packages=package[:1])


OPERATOR_INFERENCE = learner(
    "operator_inference",
    "a linear or quadratic step of few coordinates, with the ridge that opinf selects",
    "10.1016/j.cma.2016.03.025",
    operators,
    OperatorInferenceSettings,
    ("opinf", "opinf"),
)
SPARSE_IDENTIFICATION = learner(
    "sparse_identification",
    "a sparse polynomial step of few coordinates (SINDYc), by PySINDy",
    "10.1016/j.ifacol.2016.10.249",
    sparse_terms,
    SparseIdentificationSettings,
    ("pysindy", "pysindy"),
)
DYNAMIC_MODE_DECOMPOSITION = learner(
    "dynamic_mode_decomposition",
    "one linear step of coordinates and their monomials (DMDc, EDMDc), by scikit-learn",
    "10.1016/j.automatica.2018.03.046",
    linear_step,
    DynamicModeSettings,
)
GAUSSIAN_PROCESS = learner(
    "gaussian_process",
    "one linear step and Gaussian kernels on what it leaves, by scikit-learn",
    "10.7551/mitpress/3206.001.0001",
    with_kernels,
    GaussianProcessSettings,
)
NEURAL_NETWORK = learner(
    "neural_network",
    "one linear step and a multilayer perceptron on what it leaves, by scikit-learn",
    "10.1109/72.80202",
    with_network,
    NeuralNetworkSettings,
)
