"""Kernels written as Python functions of their arguments."""

import inspect
from collections.abc import Callable, Sequence

from vehiclemor.codegen.operations import Kernel, Listing, Value


class Argument:
    """An argument: its entries are read, and those of the result written."""

    def __init__(self, listing: Listing, name: str, columns: int = 0) -> None:
        self.listing, self.name, self.columns = listing, name, columns

    def __getitem__(self, place: int) -> Value:
        return self.listing.entry(self.name, place)

    def __setitem__(self, place: int | tuple[int, int], value: Value | float) -> None:
        flat = place if isinstance(place, int) else place[0] * self.columns + place[1]
        self.listing.store(flat, value)

    def sums(self, first: int, targets: int, factors: Sequence[Value | float]) -> list[Value]:
        """Sums of factors with weights from a place on."""
        return self.listing.sums(self.name, first, targets, factors)


def kernel(body: Callable[..., None], columns: int = 0) -> Kernel:
    """The kernel of what a function does with its arguments."""
    names = [f"_{name}" for name in inspect.signature(body).parameters]
    listing = Listing()
    body(*(Argument(listing, name, columns) for name in names))
    return listing.kernel(body.__name__.strip("_"), names, columns)


def function(kind: str, *values: Value) -> Value:
    """A function of values."""
    return values[0].listing.new(kind, *values)


def sincos(angle: Value) -> list[Value]:
    """Sine and cosine."""
    return angle.listing.parts(function("sincos", angle), 2)


def batch(name: str, values: Sequence[Value | float]) -> list[Value]:
    """Results of a batch, one function first."""
    listing = next(value.listing for value in values if isinstance(value, Value))
    whole = listing.new("batch", *values, detail=name)
    return listing.parts(whole, len(values) * (2 if name == "sincos" else 1))
