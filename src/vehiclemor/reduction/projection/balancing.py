"""Square-root balancing of two gramians.

A. C. Antoulas, Approximation of Large-Scale Dynamical Systems (SIAM 2005), section 7.3.
"""

import numpy as np


def balancing(
    reached: np.ndarray, seen: np.ndarray, rank: int, smallest: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Square-root balancing.

    Parameters
    ----------
    reached, seen
        F (n, m) with F F^T the gramian of controllability, of observability.
    rank
        Number of states to keep.
    smallest
        Part of the largest singular value below which a state is left out all the same.

    Returns
    -------
    tuple of numpy.ndarray
        Reduced states per state (r, n), back (n, r), and all Hankel singular values.
    """
    u, hankel, vt = np.linalg.svd(seen.T @ reached, full_matrices=False)
    kept = min(rank, int(np.count_nonzero(hankel > smallest * hankel[0])))
    scale = 1.0 / np.sqrt(hankel[:kept])
    left = scale[:, None] * (u[:, :kept].T @ seen.T)
    return left, reached @ vt[:kept].T * scale, hankel


def gramian_factor(gramian: np.ndarray) -> np.ndarray:
    """F (n, n) with F F^T the gramian, without the negative eigenvalues of rounding."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
