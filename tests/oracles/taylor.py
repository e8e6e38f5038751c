"""Paths as Taylor polynomials of degree 2 in time: coefficients of 1, t, t^2 on the first axis."""

import numpy as np

X, Y, Z = np.eye(3)
# [u]x = u @ CROSS, shape (3, 3, 3)
CROSS = np.swapaxes(np.cross(np.eye(3)[:, None], np.eye(3)), 1, 2)


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Matrix product of two polynomials, truncated."""
    return np.array(
        [a[0] @ b[0], a[0] @ b[1] + a[1] @ b[0], a[0] @ b[2] + a[1] @ b[1] + a[2] @ b[0]]
    )


def turned(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotations E + sin [u]x + (1 - cos) [u]x^2 (3, ..., 3, 3) about constant unit axes."""
    cross = np.tensordot(axis, CROSS, 1)
    s, c = np.sin(angle[0]), np.cos(angle[0])
    half = angle[1] ** 2 / 2
    sine = np.array([s, c * angle[1], c * angle[2] - s * half])
    versine = np.array([1 - c, s * angle[1], s * angle[2] + c * half])
    matrix = sine[..., None, None] * cross + versine[..., None, None] * (cross @ cross)
    matrix[0] += np.eye(3)
    return matrix


def euler_321(angles: np.ndarray) -> np.ndarray:
    """Rotations (3, ..., 3, 3) by 3-2-1 Euler angles (3, ..., 3)."""
    zeta, eta, xi = np.moveaxis(angles, -1, 0)
    return times(times(turned(Z, zeta), turned(Y, eta)), turned(X, xi))


def axial(matrix: np.ndarray) -> np.ndarray:
    """Axial vector of a matrix's skew part."""
    skew = (matrix - np.swapaxes(matrix, -1, -2)) / 2
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
