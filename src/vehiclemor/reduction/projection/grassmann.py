"""Interpolation of subspaces between cars, on the Grassmann manifold.

D. Amsallem, C. Farhat, Interpolation method for adapting reduced-order models and application to
aeroelasticity, AIAA J. 46(7) (2008), 1803-1813: subspaces become tangents at one of them, tangents
are interpolated, and the result is mapped back.  Tangents are matrices, so that any interpolation
does; here it is by radial basis functions that are exact on polynomials.
"""

import numpy as np

from vehiclemor.reduction.polynomials.kernels import monomials

# By the degree of the polynomial beside them.
KERNELS = ("linear", "thin_plate_spline", "quintic")


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

    Radial basis functions with the polynomial of highest degree that the places determine: the
    smoother, the nearer to bases, which follow smoothly from the parameters.
    """
    from scipy.interpolate import RBFInterpolator

    degree = next(k for k in (2, 1, 0) if _determined(places, k))
    return RBFInterpolator(places, np.eye(len(places)), kernel=KERNELS[degree], degree=degree)(
        at[None]
    )[0]


def _determined(places: np.ndarray, degree: int) -> bool:
    """Whether values at some places (m, d) determine a polynomial of a degree."""
    terms = monomials(places.shape[1], degree)
    columns = [places[:, list(term)].prod(axis=1) for term in terms]
    return bool(np.linalg.matrix_rank(np.array(columns)) == len(terms))
