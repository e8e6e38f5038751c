"""Sparse matrices and their factors as compiled loops take them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.simulation.structures.sparse_loops import Blocks, Columns

# Numbers stored for each that is not zero, and columns, in a block of a factor.
WASTE, WIDEST = 1.3, 32


def columns_of(matrix: Any) -> Columns:
    """A sparse matrix by columns, as loops take it."""
    matrix = matrix.tocsc()
    matrix.sort_indices()
    matrix.eliminate_zeros()
    rows, values = matrix.indices.astype(np.int64), np.ascontiguousarray(matrix.data, dtype=float)
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = np.diff(rows) != 1
    begins[matrix.indptr[:-1][np.diff(matrix.indptr) > 0]] = True
    places = np.flatnonzero(begins)
    pieces = np.searchsorted(places, matrix.indptr).astype(np.int64)
    table = np.column_stack([np.append(rows[places], 0), np.append(places, len(rows))])
    return Columns(pieces, table.ravel().astype(np.int64), values)


def ordering(matrix: Any) -> np.ndarray:
    """Order (n,) of rows and columns in which the factors of a matrix stay sparse."""
    return np.argsort(factored(matrix, "MMD_AT_PLUS_A").perm_c)


def factored(matrix: Any, order: str = "NATURAL") -> Any:
    """Factors L (D L') of a symmetric matrix, without pivoting; `GeometryError` if it has none."""
    from scipy.sparse.linalg import splu

    try:
        return splu(
            matrix.tocsc(),
            permc_spec=order,
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise GeometryError(f"the matrices of the structure are singular ({error})") from None


def blocks_of(low: Any) -> Blocks:
    """A lower triangular matrix in blocks of columns, as loops take it.

    Neighbours share a block if that stores few zeros: long columns are quicker than few numbers.
    """
    low = low.tocsc()
    low.sort_indices()
    first, rows, n = low.indptr.tolist(), low.indices.astype(np.int64), low.shape[0]
    columns, below, begin = [0], list[np.ndarray](), 0
    wanted = rows[1 : first[1]]
    for j in range(1, n + 1):
        together = wanted[:0]
        if j < n:
            own = rows[first[j] + 1 : first[j + 1]]
            together = np.union1d(wanted[wanted > j], own)
            width = j + 1 - begin
            stored = width * (width + 1) // 2 + width * len(together)
            if stored <= WASTE * (first[j + 1] - first[begin]) and width <= WIDEST:
                wanted = together
                continue
            together = own
        columns.append(j)
        below.append(wanted)
        begin, wanted = j, together
    parts = []
    for (begin, end), others in zip(pairwise(columns), below, strict=True):
        width = end - begin
        block = np.zeros((width, width + len(others)))
        for k in range(width):
            here = slice(first[begin + k], first[begin + k + 1])
            inside = rows[here] - begin
            far = width + np.searchsorted(others, rows[here])
            block[k, np.where(inside < width, inside, far)] = low.data[here]
        parts.append(block.ravel())
    places, row_places = (
        np.cumsum([0, *map(len, part)]).astype(np.int64) for part in (parts, below)
    )
    numbers = np.array(columns, dtype=np.int64)
    return Blocks(numbers, np.concatenate(below), row_places, np.concatenate(parts), places)
