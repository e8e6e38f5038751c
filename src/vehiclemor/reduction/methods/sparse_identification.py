"""Sparse identification with control (SINDYc), by the library PySINDy: few polynomial terms.

S. L. Brunton, J. L. Proctor, J. N. Kutz, Sparse identification of nonlinear dynamics with control,
IFAC-PapersOnLine 49-18 (2016), 710-715.
"""

from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.learned.learned_method import learned_method
from vehiclemor.reduction.learned.learned_model import LearnedModel, LearnedSettings, TrainingData


class SparseIdentificationSettings(LearnedSettings):
    """Settings for every model with states."""

    degree: int = Field(1, ge=1, le=4, description="of the polynomials of components and inputs")
    threshold: float = Field(0.01, ge=0.0, description="terms of smaller coefficients are dropped")
    ridge: float = Field(1e-6, ge=0.0, description="weight of the coefficients' size in the fit")


def sparse_terms(data: TrainingData, settings: SparseIdentificationSettings) -> LearnedModel:
    """Terms of the rates by PySINDy."""
    import pysindy

    arguments, results = data.regression
    r, samples = len(data.forward), data.samples
    library: Any = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=settings.threshold, alpha=settings.ridge),
        feature_library=pysindy.PolynomialLibrary(settings.degree, include_bias=samples.constant),
    )
    z, inputs = arguments[:, :r], arguments[:, r:]
    library.fit(z, t=samples.spacing, x_dot=results[:, :r], u=inputs)
    powers = np.asarray(library.feature_library.powers_)
    terms = [tuple(np.repeat(np.arange(1, len(row) + 1), row).tolist()) for row in powers]
    return data.model(data.with_motion(terms, library.coefficients().T))


METHOD = learned_method(
    "sparse_identification",
    "sparse polynomial rates of principal components (SINDYc), fitted by PySINDy",
    "10.1016/j.ifacol.2016.10.249",
    sparse_terms,
    SparseIdentificationSettings,
    "pysindy",
    discrete_time=False,
)
