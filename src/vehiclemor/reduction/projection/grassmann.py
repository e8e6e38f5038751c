"""Interpolation of subspaces between cars, on the Grassmann manifold.

D. Amsallem, C. Farhat, Interpolation method for adapting reduced-order models and application to
aeroelasticity, AIAA J. 46(7) (2008), 1803-1813: subspaces become tangents at one of them, tangents
are interpolated, and the result is mapped back.  Tangents are matrices, so that any interpolation
does; here it is by radial basis functions that are exact on linear functions.
"""

import numpy as np


def tangent(origin: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Tangent (n, r) at the span of `origin` of the geodesic that ends in the span of `basis`.

    Both have orthonormal columns (n, r); no direction of one is orthogonal to all of the other.
    """
    shared = origin.T @ basis
    across = (basis - origin @ shared) @ np.linalg.inv(shared)
    u, sizes, vt = np.linalg.svd(across, full_matrices=False)
    return (u * np.arctan(sizes)) @ vt


def along(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Orthonormal basis (n, r) of the end of the geodesic from `origin` along a tangent (n, r)."""
    u, angles, vt = np.linalg.svd(direction, full_matrices=False)
    return (origin @ (vt.T * np.cos(angles)) + u * np.sin(angles)) @ vt


def interpolation_weights(places: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Weights (m,) with which values at places (m, d) make the value at another (d,).

    Thin plates with a linear part where the places determine one, else distances.
    """
    from scipy.interpolate import RBFInterpolator

    count, dimensions = places.shape
    linear = np.linalg.matrix_rank(np.column_stack([np.ones(count), places])) == 1 + dimensions
    kernel = "thin_plate_spline" if linear else "linear"
    interpolator = RBFInterpolator(places, np.eye(count), kernel=kernel, degree=int(linear))
    return interpolator(at[None])[0]
