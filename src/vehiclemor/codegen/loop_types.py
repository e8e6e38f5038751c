"""Types of the arguments of compiled loops, and stand-ins for what only compiled code can do.

A loop is an ordinary function; its entry, which Python calls, declares its arguments by these types
or by named tuples of them.
"""

from typing import Annotated, Any

import numpy as np

# C-contiguous arrays of floats or integers by number of dimensions.
Vector = Annotated[np.ndarray, "float64", 1]
Matrix = Annotated[np.ndarray, "float64", 2]
Cube = Annotated[np.ndarray, "float64", 3]
IntVector = Annotated[np.ndarray, "int64", 1]
IntMatrix = Annotated[np.ndarray, "int64", 2]
Float = Annotated[float, "float64", 0]
Int = Annotated[int, "int64", 0]

COMPILED_ONLY = "runs only in a compiled loop"


def vector(buffer: Vector, first: int, size: int) -> Vector:
    """Part of a buffer, from place `first` on, as a vector."""
    return buffer[first : first + size]


def matrix(buffer: Vector, first: int, rows: int, columns: int) -> Matrix:
    """Part of a buffer, from place `first` on, as a matrix."""
    return buffer[first : first + rows * columns].reshape(rows, columns)


def call_kernel(kernels: IntVector, index: int, *arrays: Any) -> None:
    """Call a kernel, by its index in a list of addresses, with its arrays; nothing is checked."""
    raise NotImplementedError(COMPILED_ONLY)


def call_lanes(
    kernels: IntVector,
    index: int,
    path: Matrix,
    inputs: Matrix,
    constants: Vector,
    result: Matrix,
    first: int,
) -> None:
    """Call such a kernel for `LANES` samples at once, from row `first` of the matrices on."""
    raise NotImplementedError(COMPILED_ONLY)


def rows_product(values: Matrix, first: int, matrix: Matrix, result: Matrix, to: int) -> None:
    """Write `LANES` rows of values times a matrix, from row `first` on, to rows of a result.

    Only the first columns of values and of the result are used, as many as the matrix has rows and
    columns; it has a multiple of `LANES` columns.
    """
    raise NotImplementedError(COMPILED_ONLY)


def declared_arguments(entry: Any) -> dict[str, Any]:
    """Declared types of the arguments of a loop's entry by name."""
    return {name: kind for name, kind in entry.__annotations__.items() if name != "return"}
