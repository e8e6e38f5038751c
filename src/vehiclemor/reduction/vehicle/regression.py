"""Linear regression on features."""

import numpy as np

# Columns of which less than this share is left are sums of those chosen before.
DEPENDENT = 1e-8


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


def sizes(values: np.ndarray) -> np.ndarray:
    """Root mean square of each column (samples, n) -> (n,); 1 where a column is zero."""
    found = np.sqrt(np.mean(values**2, axis=0))
    return np.where(found > 0.0, found, 1.0)


def unit_diagonal(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (n, n) scaled to a diagonal of ones, and the scales (n,) of coefficients.

    A feature that is zero in all samples has the scale 1.
    """
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0.0] = 1.0
    return normal / np.outer(scale, scale), scale


def forward_selection(columns: np.ndarray, values: np.ndarray, given: int, more: int) -> list[int]:
    """Indices of the columns that explain most, one after the other (orthogonal least squares).

    S. Chen, S. A. Billings, W. Luo, Int. J. Control 50 (1989), 1873-1896.

    The first `given` columns (samples, terms) are chosen already, `more` beside them; all values
    (samples, targets) count the same, whatever their sizes.
    """
    columns = columns / sizes(columns)
    normal, products = columns.T @ columns, columns.T @ (values / sizes(values))
    least = DEPENDENT * len(columns)
    chosen: list[int] = []
    while len(chosen) < min(given + more, len(normal)):
        if len(chosen) < given:
            best = len(chosen)
        else:
            left = np.diag(normal)
            gains = np.sum(products**2, axis=1) / np.maximum(left, least)
            gains[(left <= least) | np.isin(np.arange(len(gains)), chosen)] = -1.0
            best = int(np.argmax(gains))
        chosen.append(best)
        if normal[best, best] > least:
            row = normal[best] / normal[best, best]
            products = products - np.outer(row, products[best])
            normal = normal - np.outer(row, normal[best])
    return chosen
