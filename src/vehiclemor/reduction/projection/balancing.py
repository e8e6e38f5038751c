"""Square-root balancing of two gramians.

A. C. Antoulas, Approximation of Large-Scale Dynamical Systems (SIAM 2005), section 7.3.
"""

from typing import NamedTuple

import numpy as np


class Balanced(NamedTuple):
    """Projection of a linear system on its balanced states.

    Attributes
    ----------
    left, right
        Reduced states per state (r, n) and back (n, r); left right = 1.
    hankel
        All Hankel singular values (n,).
    """

    left: np.ndarray
    right: np.ndarray
    hankel: np.ndarray


def balancing(reached: np.ndarray, seen: np.ndarray, rank: int, smallest: float = 0.0) -> Balanced:
    """Square-root balancing.

    Parameters
    ----------
    reached, seen
        F (n, m) with F F^T the gramian of controllability, of observability.
    rank
        Number of states to keep.
    smallest
        Part of the largest singular value below which a state is left out all the same.
    """
    u, hankel, vt = np.linalg.svd(seen.T @ reached, full_matrices=False)
    kept = min(rank, int(np.count_nonzero(hankel > smallest * hankel[0])))
    scale = 1.0 / np.sqrt(hankel[:kept])
    left = scale[:, None] * (u[:, :kept].T @ seen.T)
    return Balanced(left, reached @ vt[:kept].T * scale, hankel)


def gramian_factor(gramian: np.ndarray) -> np.ndarray:
    """F (n, n) with F F^T the gramian, without the negative eigenvalues of rounding."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
