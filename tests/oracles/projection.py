"""Reduced algebraic equations solved with NumPy alone, sample by sample and window by window."""

from collections.abc import Callable, Sequence

import numpy as np

Equations = Callable[[np.ndarray, np.ndarray], np.ndarray]


def reduced_path(
    residual: Equations,
    jacobian: Equations,
    subspaces: Sequence[tuple[np.ndarray, np.ndarray]],
    windows: Sequence[range],
    inputs: np.ndarray,
    start: np.ndarray,
    galerkin: bool = False,
    tolerance: float = 1e-12,
    limit: int = 50,
) -> tuple[np.ndarray, int]:
    """Path (samples, n) on subspaces (mean, vectors), and the number of iterations.

    Least squares minimises |Phi(mean + U qh)|_2 by Gauss-Newton; Galerkin solves U^T Phi = 0.
    Every iteration starts at the previous sample, in a new window at its projection.
    """
    path, q, iterations = np.full((len(inputs), len(start)), np.nan), start, 0
    for (mean, vectors), samples in zip(subspaces, windows, strict=True):
        reduced = vectors.T @ (q - mean)
        for sample in samples:
            for _ in range(limit):
                q = mean + vectors @ reduced
                phi, tangent = residual(q, inputs[sample]), jacobian(q, inputs[sample]) @ vectors
                if galerkin:
                    step = np.linalg.solve(vectors.T @ tangent, vectors.T @ phi)
                else:
                    step = np.linalg.lstsq(tangent, phi, rcond=None)[0]
                reduced, iterations = reduced - step, iterations + 1
                if np.abs(step).max() < tolerance:
                    break
            q = path[sample] = mean + vectors @ reduced
    return path, iterations
