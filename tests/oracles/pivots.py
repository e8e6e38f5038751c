"""Pivots of a sparse elimination by Markowitz' rule, for matrices of numbers."""

import numpy as np

from vehiclemor.symbolic.elimination import Pivots


def choose_pivots(matrix: np.ndarray, threshold: float = 0.1) -> Pivots:
    """Choose a pivot sequence for a numeric matrix by Markowitz' rule with threshold pivoting.

    Parameters
    ----------
    matrix
        Square matrix (n x n) at a reference position, structural zeros being zero.
    threshold
        A pivot has at least this share of the largest entry of its remaining column.

    Returns
    -------
    tuple of (row, column)
        In order of elimination.

    Raises
    ------
    ValueError
        If the matrix is singular.

    Notes
    -----
    Duff, Erisman and Reid, *Direct Methods for Sparse Matrices* (2nd ed., Oxford 2017), chapter 5.
    """
    work = np.array(matrix, dtype=float)
    rows, columns = list(range(len(work))), list(range(len(work)))
    pivots: list[tuple[int, int]] = []
    while rows:
        best: tuple[float, float, int, int] | None = None
        for column in columns:
            largest = np.abs(work[rows, column]).max()
            for row in rows:
                size = float(abs(work[row, column]))
                if largest == 0.0 or size < threshold * largest or size < 1e-12:
                    continue
                fill = int(
                    (np.count_nonzero(work[row, columns]) - 1)
                    * (np.count_nonzero(work[rows, column]) - 1)
                )
                candidate = (fill, -size, row, column)
                best = candidate if best is None or candidate < best else best
        if best is None:
            raise ValueError("the matrix is singular: no pivot is left")
        row, column = best[2:]
        rows.remove(row)
        columns.remove(column)
        pivots.append((row, column))
        for other in rows:
            factor = work[other, column] / work[row, column]
            if factor != 0.0:
                work[other] -= factor * work[row]
                work[other, column] = 0.0
    return tuple(pivots)
