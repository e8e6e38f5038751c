"""Features evaluated on arrays, and the reduced vehicle that is linear in them."""

from __future__ import annotations

from functools import cache

import numpy as np

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.reduction.vehicle.feature_kernels import columns_text, rates_text
from vehiclemor.reduction.vehicle.features import PLANAR, Features
from vehiclemor.simulation.paths import along
from vehiclemor.simulation.system import System


def feature_columns(
    features: Features, z: np.ndarray, u: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Features (samples, terms) of reduced coordinates (samples, states) and inputs."""
    sizes = features.states, features.inputs, len(features.terms)
    return along(_column_kernels(features), "columns", parameters, (z, u), sizes)


@cache
def _column_kernels(features: Features) -> Kernels:
    return Kernels(kernel_sources(columns_text(features)))


# A fit makes systems of the same features again and again.
@cache
def _kernels(features: Features, parameters: int) -> Kernels:
    return Kernels(kernel_sources(rates_text(features, parameters)))


def feature_system(
    features: Features,
    parameters: np.ndarray,
    coefficients: np.ndarray,
    error_scale: np.ndarray,
    reference: np.ndarray,
) -> System:
    """The reduced vehicle as the compiled loops take it.

    Parameters
    ----------
    parameters
        Of the features.
    coefficients
        C (terms, states + 3): columns of z', then of psi', U and V.
    error_scale
        Magnitude of each state (states + 3,) below which errors count absolutely.
    reference
        Reduced coordinates (states,) at which the Jacobian is frozen.
    """
    blocks = [np.zeros((len(terms), padded(len(c)))) for terms, c in features.blocks]
    for block, (terms, columns) in zip(blocks, features.blocks, strict=True):
        block[:, : len(columns)] = coefficients[np.ix_(terms, columns)]
    constants = np.concatenate([parameters, *(block.ravel() for block in blocks)])
    dim = features.states + PLANAR
    return System(
        _kernels(features, len(parameters)),
        constants,
        features.inputs,
        np.concatenate([reference, np.zeros(PLANAR)]),
        error_scale,
        np.arange(dim - 2),
        np.zeros(0, dtype=np.int64),
    )
