"""Matrix functions of the exponential Runge-Kutta method ETDRK4, for a grid of step sizes.

phi_0(z) = exp(z), phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z.  Taylor series at a small argument,
then doubling (N. Higham, Functions of Matrices, SIAM 2008, section 10.7):

    phi_k(2 z) = 2^-k [phi_0(z) phi_k(z) + sum_{j=1}^k phi_j(z) / (k - j)!]

so that defective matrices, those of stabilised constraints, are no exception.
"""

import math
from collections.abc import Iterable

import numpy as np

# Norm of the matrix below which the series is used, and its terms: rounding is larger.
SMALL, TERMS = 0.1, 10
# Tables of a step size, see `etdrk4`: J, then functions of h J / 2 and h J.
TABLES = 7
JACOBIAN, HALF_FIRST, HALF_SECOND, FIRST, SECOND, MIDDLE, LAST = range(TABLES)
# The tables' functions at argument zero, for states that no block belongs to.
AT_ZERO = (0.0, 1.0 / 2.0, 1.0 / 2.0, 1.0, 1.0, 1.0 / 3.0, 1.0 / 6.0)


def phi_functions(matrix: np.ndarray) -> tuple[np.ndarray, ...]:
    """phi_0 to phi_3 of a matrix (n, n)."""
    norm = float(np.abs(matrix).sum(axis=0).max())
    halvings = max(0, math.ceil(math.log2(norm / SMALL))) if norm > 0.0 else 0
    functions = _series(matrix / 2.0**halvings)
    for _ in range(halvings):
        functions = _doubled(functions)
    return functions


def _series(z: np.ndarray) -> tuple[np.ndarray, ...]:
    identity = np.eye(len(z))
    third = np.zeros_like(z)
    for k in range(TERMS, -1, -1):
        third = third @ z + identity / math.factorial(k + 3)
    second = z @ third + identity / 2.0
    first = z @ second + identity
    return z @ first + identity, first, second, third


def _doubled(functions: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    e, first, second, third = functions
    return (
        e @ e,
        (e @ first + first) / 2.0,
        (e @ second + first + second) / 4.0,
        (e @ third + first / 2.0 + second + third) / 8.0,
    )


def exponential_tables(jacobian: np.ndarray, grid: Iterable[float]) -> np.ndarray:
    """Tables (step sizes, 7, n, n) of the loops, each matrix transposed.

    J; phi_1(z/2) / 2 and phi_2(z/2); phi_1, 2 phi_2, 2 phi_2 - 4 phi_3, 4 phi_3 - phi_2 of
    z = h J.
    """
    steps = [float(h) for h in grid]
    tables = np.empty((len(steps), TABLES, *jacobian.shape))
    for table, h in zip(tables, steps, strict=True):
        half = phi_functions(0.5 * h * jacobian)
        _, first, second, third = _doubled(half)
        table[0] = jacobian.T
        table[1], table[2] = half[1].T / 2.0, half[2].T
        table[3], table[4] = first.T, 2.0 * second.T
        table[5], table[6] = (2.0 * second - 4.0 * third).T, (4.0 * third - second).T
    return tables
