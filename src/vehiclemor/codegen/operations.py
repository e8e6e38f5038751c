"""Kernels as lists of operations: what compilers, printers and derivatives read.

A kernel takes arrays of floats and fills its result.  Its operations are executed one after the
other; each has a kind, numbers of earlier operations whose values it takes, and details:

    number            a float
    entry             (array, place): an entry of an argument
    add ... >=        arithmetic, comparisons and functions, see `KINDS`
    sincos            sine and cosine of a value
    batch             `sincos` or `atan` of `LANES` values at once: its name
    sums              (array, first, targets): see `llvm_vectors`
    part              number of one of several results of these three
    store             place of the result, row by row
    combine ...       statements on whole vectors, see `llvm_vectors`

Those that have a name are executed in order, others when one of them needs their value.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from vehiclemor.codegen.vector_lanes import padded

# Before the name of an argument: the argument's direction, see `derivatives`.
SEED = "_seed"
FUNCTIONS = (
    *("sqrt", "log", "exp", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("floor", "abs", "power_of_two"),
)
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
# Operations of values with one result -> how many values they take.  Saved models hold places of
# this table: new kinds come last.
KINDS = {
    **dict.fromkeys(("number", "entry"), 0),
    **dict.fromkeys(("add", "subtract", "multiply", "divide", "power", "atan2"), 2),
    **dict.fromkeys(COMPARISONS, 2),
    **dict.fromkeys(("negate", *FUNCTIONS), 1),
    "select": 3,
}
# What NumPy calls otherwise.
OPERATORS = {"negative": "negate", "absolute": "abs"}
VECTOR_STATEMENTS = ("combine", "product", "execute")
# Nothing else depends on these, and these have a name whatever they are.
EFFECTS = ("store", *VECTOR_STATEMENTS)
NAMED = ("sincos", "batch", "sums", "part", *EFFECTS)
COUNTED = ("add", "multiply", "divide", "negate", "sqrt", "trigonometric", "power")


class Operation(NamedTuple):
    """One operation of a kernel."""

    kind: str
    arguments: tuple[int, ...] = ()
    detail: Any = None


@dataclass(frozen=True)
class Value(NDArrayOperatorsMixin):
    """What an operation gives; arithmetic with it writes further operations."""

    listing: Listing
    number: int

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *arguments: Value | float) -> Value:
        """Arithmetic with operators, also of numbers of NumPy."""
        del method
        return self.listing.new(OPERATORS.get(ufunc.__name__, ufunc.__name__), *arguments)


class Listing:
    """Operations that are written one after the other; `named` are numbers of those with names."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self.named: set[int] = set()

    def new(self, kind: str, *arguments: Value | float, detail: Any = None) -> Value:
        """Write an operation; what it gives."""
        numbers = tuple(
            a.number if isinstance(a, Value) else self.number(a).number for a in arguments
        )
        value = Value(self, len(self.operations))
        self.operations.append(Operation(kind, numbers, detail))
        return self.let(value) if kind in NAMED else value

    def let(self, value: Value) -> Value:
        """A value that has a name from here on."""
        self.named.add(value.number)
        return value

    def number(self, value: float) -> Value:
        """Write a number."""
        return self.new("number", detail=float(value))

    def entry(self, array: str, place: int) -> Value:
        """Read an entry of an argument."""
        return self.new("entry", detail=(array, place))

    def parts(self, whole: Value, count: int) -> list[Value]:
        """Results of an operation that has several."""
        return [self.new("part", whole, detail=place) for place in range(count)]

    def sums(self, array: str, first: int, targets: int, factors: Sequence[Value]) -> list[Value]:
        """Sums of factors times the weights that stand in an array, see `llvm_vectors`."""
        whole = self.new("sums", *factors, detail=(array, first, targets))
        return self.parts(whole, targets)

    def store(self, place: int, value: Value | float) -> None:
        """Write a value into the result."""
        self.new("store", value, detail=place)

    def kernel(self, name: str, arguments: Sequence[str], columns: int = 0) -> Kernel:
        """What has been written as a kernel; with columns its result is a matrix.

        Operations that nothing depends on are left out.
        """
        sizes = dict.fromkeys(arguments, 0)
        roots = [n for n, operation in enumerate(self.operations) if operation.kind in EFFECTS]
        operations, places = pruned(self.operations, roots)
        for kind, numbers, detail in operations:
            for array, reach in _reaches(kind, len(numbers), detail):
                sizes[array] = max(sizes[array], reach)
        named = [places[n] for n in sorted(self.named) if n in places]
        listed = json.dumps([operations, named], separators=(",", ":"))
        return Kernel(name, tuple(arguments), tuple(sizes.values()), columns, listed)


def _reaches(kind: str, factors: int, detail: Any) -> list[tuple[str, int]]:
    """Arrays that an operation reads or writes, and how many floats they must have."""
    if kind == "store":
        return [("_result", detail + 1)]
    if kind == "sums":
        array, first, targets = detail
        return [(array, first + factors * padded(targets))]
    entries = [detail] if kind == "entry" else detail if kind in VECTOR_STATEMENTS else []
    return [(entry[0], entry[1] + 1) for entry in entries if is_entry(entry)]


def function(kind: str, *values: Value) -> Value:
    """A function of values, as `function("floor", x)`."""
    return values[0].listing.new(kind, *values)


@dataclass(frozen=True)
class Kernel:
    """A kernel, and what it wants of its arrays.

    Sizes are the smallest numbers of floats of its arguments, columns the length of the rows of its
    result, 0 if that is a vector.  Operations and numbers of those with names are listed as JSON:
    few programs ask for them.
    """

    name: str
    arguments: tuple[str, ...]
    sizes: tuple[int, ...]
    columns: int
    listed: str

    @classmethod
    def read(cls, written: dict[str, Any]) -> Kernel:
        """The kernel of what `dataclasses.asdict` has made of one, and JSON of that."""
        arrays = {key: tuple(written[key]) for key in ("arguments", "sizes")}
        return cls(**{**written, **arrays})

    @property
    def operations(self) -> list[Operation]:
        """The operations in order."""
        return _read(self.listed)[0]

    @property
    def named(self) -> list[int]:
        """Numbers of the operations that have names."""
        return _read(self.listed)[1]

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the result."""
        size = self.sizes[self.arguments.index("_result")]
        return (size // self.columns, self.columns) if self.columns else (size,)

    @property
    def copies(self) -> tuple[int, ...]:
        """By result the place in the first argument of which it is a copy; -1 of other results."""
        operations, found = self.operations, [-1] * self.sizes[-1]
        for kind, arguments, place in operations:
            if kind == "store" and operations[arguments[0]].kind == "entry":
                array, entry = operations[arguments[0]].detail
                found[place] = entry if array == self.arguments[0] else -1
        return tuple(found)

    def of(self, results: Sequence[int]) -> Kernel:
        """The kernel of some results alone, which become a vector in this order."""
        stored = {op.detail: n for n, op in enumerate(self.operations) if op.kind == "store"}
        wanted = {stored[result]: place for place, result in enumerate(results)}
        operations, numbers = pruned(self.operations, wanted)
        for old, place in wanted.items():
            operations[numbers[old]] = operations[numbers[old]]._replace(detail=place)
        named = [numbers[n] for n in self.named if n in numbers]
        listed = json.dumps([operations, named], separators=(",", ":"))
        return Kernel(self.name, self.arguments, (*self.sizes[:-1], len(results)), 0, listed)

    @property
    def by_row(self) -> list[str]:
        """Arguments that have a row for each of several samples: all but constants.

        Of a directional derivative the rows are directions: seeds and results have some.
        """
        seeds = [name for name in self.arguments if name.startswith(SEED)]
        return [*seeds, "_result"] if seeds else [n for n in self.arguments if n != "_constants"]

    def check(self, *lengths: int) -> None:
        """Raise `ValueError` if it needs more floats than its first arguments have (`lengths`)."""
        for argument, size, length in zip(self.arguments, self.sizes, lengths, strict=False):
            if size > length:
                raise ValueError(f"kernel {self.name}: {argument} has {length} floats, not {size}")

    @property
    def counts(self) -> dict[str, int]:
        """How many operations it executes.

        By kind, see `COUNTED` (`trigonometric`: sines, cosines and inverses), and in `total`.
        """
        operations, used = self.operations, uses(self.operations)
        known = {kind: kind for kind in COUNTED} | {"subtract": "add", "atan2": "trigonometric"}
        known |= dict.fromkeys(set(FUNCTIONS) - {"sqrt", "abs"}, "trigonometric")
        counts: dict[str, int] = dict.fromkeys(COUNTED, 0)
        for number, (kind, arguments, _) in enumerate(operations):
            if kind in known:
                counts[known[kind]] += 1
            elif kind == "part" and used[number] and operations[arguments[0]].kind != "sums":
                counts["trigonometric"] += 1
        return counts | {"total": sum(counts.values())}


# Those of a kernel are asked for a few times one after the other.
@lru_cache(maxsize=8)
def _read(listed: str) -> tuple[list[Operation], list[int]]:
    operations, named = json.loads(listed)
    return [Operation(*map(_tuples, operation)) for operation in operations], named


def is_entry(detail: Any) -> bool:
    """Whether a part of a detail is an entry of an array."""
    return isinstance(detail, tuple) and bool(detail) and isinstance(detail[0], str)


def _tuples(part: Any) -> Any:
    return tuple(map(_tuples, part)) if isinstance(part, list) else part


def uses(operations: Sequence[Operation]) -> list[int]:
    """How often each operation's value is taken."""
    found = [0] * len(operations)
    for operation in operations:
        for number in operation.arguments:
            found[number] += 1
    return found


def needed(operations: Sequence[Operation], roots: Collection[int]) -> list[int]:
    """Numbers of the operations that others depend on, these included, in order."""
    kept = set(roots)
    for number in range(len(operations) - 1, -1, -1):
        if number in kept:
            kept.update(operations[number].arguments)
    return sorted(kept)


def pruned(
    operations: Sequence[Operation], roots: Collection[int]
) -> tuple[list[Operation], dict[int, int]]:
    """The operations that others depend on, these included; number -> its new number."""
    kept = needed(operations, roots)
    places = {number: place for place, number in enumerate(kept)}
    found = []
    for number in kept:
        kind, arguments, detail = operations[number]
        found.append(Operation(kind, tuple(places[n] for n in arguments), detail))
    return found, places


# Operations that a file may have: the largest kernel of this package has 22,000, and compiles in
# 9 s.
MOST_SIZE = 90_000
# Arguments of which files may have entries.
ARRAYS = ("_x", "_u", "_constants")


def as_arrays(operations: Sequence[Operation]) -> dict[str, np.ndarray]:
    """Operations with one result as numbers alone, for files.

    Place of the kind in `KINDS`; arguments, of an entry the place in `ARRAYS` and in the array;
    number.
    """
    kinds, arguments = list(KINDS), np.zeros((len(operations), 3), dtype=np.int64)
    numbers = np.zeros(len(operations))
    for n, (kind, given, detail) in enumerate(operations):
        if kind == "number":
            numbers[n] = detail
        elif kind == "entry":
            given = ARRAYS.index(detail[0]), detail[1]  # noqa: PLW2901
        arguments[n, : len(given)] = given
    found = np.array([kinds.index(operation.kind) for operation in operations], dtype=np.int64)
    return {"kinds": found, "arguments": arguments, "numbers": numbers}


def of_arrays(
    kinds: np.ndarray, arguments: np.ndarray, numbers: np.ndarray
) -> tuple[Operation, ...]:
    """Operations from what `as_arrays` gives; `ValueError` or `IndexError` if they are none."""
    n = len(kinds)
    if not (
        (kinds.dtype, arguments.dtype, numbers.dtype) == (np.int64, np.int64, np.float64)
        and (kinds.shape, arguments.shape, numbers.shape) == ((n,), (n, 3), (n,))
        and n <= MOST_SIZE
        and ((kinds >= 0) & (kinds < len(KINDS))).all()
        and (arguments >= 0).all()
    ):
        raise ValueError("operations have arrays that don't fit one another")
    table, found = [*KINDS.items()], []
    for place, (number, given) in enumerate(zip(kinds.tolist(), arguments.tolist(), strict=True)):
        kind, count = table[number]
        detail = None
        if kind == "number":
            detail = float(numbers[place])
        elif kind == "entry":
            detail = ARRAYS[given[0]], given[1]
        if max(given[:count], default=-1) >= place:
            raise ValueError(f"operation {place} takes what is not there yet")
        found.append(Operation(kind, tuple(given[:count]), detail))
    return tuple(found)
