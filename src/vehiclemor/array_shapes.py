"""Checks of the array shapes of loaded models: compiled code does not check them.

A kernel reads and writes at fixed offsets, a loop as far as an array is long, so a file with wrong
sizes would reach into other memory.  A class that may be part of a saved model has a method
`check_sizes`, which raises `ValueError` where its fields don't fit.
"""

from collections.abc import Sequence
from typing import Any


def require(fits: bool, what: str) -> None:
    """Raise `ValueError` unless something fits."""
    if not fits:
        raise ValueError(f"{what} does not fit the rest")


def check_shapes(what: str, *arrays: Sequence[Any]) -> None:
    """Require arrays of floats; each stands with its shape."""
    for array, *shape in arrays:
        require(array.dtype == float and array.shape == tuple(shape), what)


def check_indices(what: str, indices: Sequence[Any], size: int) -> None:
    """Require integers from zero to below a size."""
    require(all(type(index) is int and 0 <= index < size for index in indices), what)


def check_distinct_indices(what: str, indices: Sequence[Any], size: int) -> None:
    """Require indices that are all different."""
    check_indices(what, indices, size)
    require(len({*indices}) == len(indices), what)
