"""Sizes of what comes from a file, checked before compiled code gets it: it does not look.

A kernel reads and writes at the places that its text names, a loop as far as an array is long, so
that a file that lies about sizes would reach into other memory.  A class that may be part of a
saved model has a method `check_sizes`, which raises `ValueError` where its fields don't fit.
"""

from collections.abc import Sequence
from typing import Any


def require(fits: bool, what: str) -> None:
    """Raise `ValueError` unless something fits."""
    if not fits:
        raise ValueError(f"{what} does not fit the rest")


def shaped(what: str, *arrays: Sequence[Any]) -> None:
    """Require floats: pairs of an array and its shape."""
    for array, *shape in arrays:
        require(array.dtype == float and array.shape == tuple(shape), what)


def apart(what: str, places: Sequence[Any], size: int) -> None:
    """Require whole numbers of at least zero and below a size, each once."""
    within(what, places, size)
    require(len({*places}) == len(places), what)


def within(what: str, places: Sequence[Any], size: int) -> None:
    """Require the same, each as often as it may be."""
    require(all(type(place) is int and 0 <= place < size for place in places), what)
