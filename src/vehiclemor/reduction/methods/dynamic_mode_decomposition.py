"""Dynamic mode decomposition with control, plain (DMDc) and extended by monomials (EDMDc).

J. L. Proctor, S. L. Brunton, J. N. Kutz, Dynamic mode decomposition with control, SIAM J. Appl.
Dyn. Syst. 15 (2016), 142-161; M. Korda, I. Mezic, Linear predictors for nonlinear dynamical
systems: Koopman operator meets model predictive control, Automatica 93 (2018), 149-160.
"""

from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.learned.learned_method import learned_method
from vehiclemor.reduction.learned.learned_model import (
    LearnedModel,
    LearnedSettings,
    TrainingData,
    columns,
    monomials,
    polynomials,
)


class DynamicModeSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the observables: 1 is DMDc, more EDMDc")
    ridge: float = Field(1e-8, ge=0.0, description="weight of the matrices' size in the fit")


def linear_step(data: TrainingData, settings: DynamicModeSettings) -> LearnedModel:
    """One linear step of all observables by scikit-learn."""
    from sklearn.linear_model import Ridge

    s, r = data.samples, len(data.forward)
    observables = monomials(r, settings.degree, s.constant)
    values, following = (columns(observables, z) for z in data.coordinates)
    arguments = np.hstack([values, data.inputs])
    results = np.hstack([following - values, s.motion])
    # Monomials are rare where they are large: each counts alike.
    scale = np.sqrt((arguments**2).mean(axis=0))
    scale[scale == 0.0] = 1.0
    linear: Any = Ridge(settings.ridge * len(arguments), fit_intercept=False)
    linear.fit(arguments / scale, results)
    terms = monomials(len(scale), 1, constant=False)
    equations = polynomials(terms, (linear.coef_ / scale).T, len(scale))
    return data.model(equations, observables)


METHOD = learned_method(
    "dynamic_mode_decomposition",
    "one linear step of components and their monomials (DMDc, EDMDc), by scikit-learn",
    "10.1016/j.automatica.2018.03.046",
    linear_step,
    DynamicModeSettings,
    "sklearn",
)
