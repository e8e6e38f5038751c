"""Linear regression on features."""

import numpy as np


def ridge_fit(columns: np.ndarray, values: np.ndarray, weight: float) -> np.ndarray:
    """Coefficients (terms, ...) of the fit of values (samples, ...) on columns (samples, terms).

    Minimises the mean square error plus `weight` times the squares of the coefficients (ridge
    regression: A. E. Hoerl, R. W. Kennard, Technometrics 12 (1970), 55-67).
    """
    normal = columns.T @ columns + weight * len(columns) * np.eye(columns.shape[1])
    return np.linalg.solve(normal, columns.T @ values)


def largest(values: np.ndarray) -> np.ndarray:
    """Largest magnitude in each column (samples, n) -> (n,); 1 where a column is zero."""
    found = np.abs(values).max(axis=0)
    return np.where(found > 0.0, found, 1.0)


def unit_diagonal(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (n, n) scaled to a diagonal of ones, and the scales (n,) of coefficients.

    A feature that is zero in all samples has the scale 1.
    """
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0.0] = 1.0
    return normal / np.outer(scale, scale), scale
