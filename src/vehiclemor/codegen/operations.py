"""Kernels as lists of operations: what compilers, printers and derivatives read.

A kernel takes arrays of floats and fills its result.  Its operations are executed one after the
other; each has a kind, numbers of earlier operations whose values it takes, and details:

    number            a float
    entry             (array, index): an entry of an argument
    add ... >=        arithmetic, comparisons and functions, see `KINDS`
    sincos            sine and cosine of a value
    batch             `sincos` or `atan` of `LANES` values at once: its name
    sums              (array, first, targets): see `instructions`
    part              index of one of several results of these three
    store             index of the result, row by row
    combine ...       statements on whole vectors, see `instructions`

Named operations run in order; the others are inlined where used.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

# Elementary functions are evaluated this many at a time, so that the compiler makes one vector loop
# of them.  Kernels along a path take as many samples.
LANES = 8
# Floats in a vector: half a batch; vectors of 512 bits were a fifth slower.
WIDTH = LANES // 2
# Before the name of an argument: the argument's direction, see `derivatives`.
SEED = "_seed"
FUNCTIONS = (
    *("sqrt", "log", "exp", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("floor", "abs", "power_of_two"),
)
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
# Operations of values with one result -> how many values they take.  Saved models hold indices into
# this table: new kinds come last.
KINDS = {
    **dict.fromkeys(("number", "entry"), 0),
    **dict.fromkeys(("add", "subtract", "multiply", "divide", "power", "atan2"), 2),
    **dict.fromkeys(COMPARISONS, 2),
    **dict.fromkeys(("negate", *FUNCTIONS), 1),
    "select": 3,
}
# Operations to which NumPy gives other names.
OPERATORS = {"negative": "negate", "absolute": "abs"}
OPERATORS |= {"greater": ">", "greater_equal": ">=", "less": "<", "not_equal": "!="}
VECTOR_STATEMENTS = ("combine", "product", "execute")
# No value depends on these; they are always named.
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
    """Result of an operation; arithmetic with it writes further operations."""

    listing: Listing
    number: int

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *arguments: Value | float) -> Value:
        """Arithmetic with operators and functions of NumPy, also of its numbers."""
        del method
        return self.listing.new(OPERATORS.get(ufunc.__name__, ufunc.__name__), *arguments)


class Listing:
    """Operations that are written one after the other; `named` are numbers of those with names."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self.named: set[int] = set()

    def new(self, kind: str, *arguments: Value | float, detail: Any = None) -> Value:
        """Write an operation; its result."""
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

    def entry(self, array: str, index: int) -> Value:
        """Read an entry of an argument."""
        return self.new("entry", detail=(array, index))

    def parts(self, value: Value, count: int) -> list[Value]:
        """Results of an operation that has several."""
        return [self.new("part", value, detail=index) for index in range(count)]

    def sums(self, array: str, first: int, targets: int, factors: Sequence[Value]) -> list[Value]:
        """Sums of factors times weights from index `first` of an array on, see `instructions`."""
        sums = self.new("sums", *factors, detail=(array, first, targets))
        return self.parts(sums, targets)

    def store(self, index: int, value: Value | float) -> None:
        """Write a value into the result."""
        self.new("store", value, detail=index)

    def kernel(self, name: str, arguments: Sequence[str], columns: int = 0) -> Kernel:
        """The written operations as a kernel; with columns its result is a matrix.

        Operations that no stored value depends on are left out.
        """
        sizes = dict.fromkeys(arguments, 0)
        roots = [n for n, operation in enumerate(self.operations) if operation.kind in EFFECTS]
        operations, renumbered = pruned(self.operations, roots)
        for kind, numbers, detail in operations:
            for array, reach in _reaches(kind, len(numbers), detail):
                sizes[array] = max(sizes[array], reach)
        named = [renumbered[n] for n in sorted(self.named) if n in renumbered]
        listed = json.dumps([operations, named], separators=(",", ":"))
        return Kernel(name, tuple(arguments), tuple(sizes.values()), columns, listed)


def _reaches(kind: str, factors: int, detail: Any) -> list[tuple[str, int]]:
    """Arrays that an operation reads or writes, and how many floats they must have."""
    if kind == "store":
        return [("_result", detail + 1)]
    if kind == "sums":
        array, first, targets = detail
        return [(array, first + factors * padded(targets))]
    if kind == "entry":
        return [(detail[0], detail[1] + 1)]
    if kind in VECTOR_STATEMENTS:
        return [(part[0], part[1] + 1) for part in detail if is_entry(part)]
    return []


@dataclass(frozen=True)
class Kernel:
    """A kernel and the sizes of its arrays.

    Sizes are the smallest numbers of floats of its arguments, columns the length of the rows of its
    result, 0 if that is a vector.  Operations and numbers of the named ones are listed as JSON: few
    programs read them.
    """

    name: str
    arguments: tuple[str, ...]
    sizes: tuple[int, ...]
    columns: int
    listed: str

    @classmethod
    def read(cls, fields: dict[str, Any]) -> Kernel:
        """A kernel from its fields, in which JSON has lists for tuples."""
        arrays = {key: tuple(fields[key]) for key in ("arguments", "sizes")}
        return cls(**{**fields, **arrays})

    @property
    def operations(self) -> list[Operation]:
        """The operations in order."""
        return _read(self.listed)[0]

    @property
    def named(self) -> list[int]:
        """Numbers of the named operations."""
        return _read(self.listed)[1]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the result."""
        size = self.sizes[self.arguments.index("_result")]
        return (size // self.columns, self.columns) if self.columns else (size,)

    @property
    def copies(self) -> tuple[int, ...]:
        """Index of the first argument's entry that a result is a copy of; -1 of other results."""
        operations, copied = self.operations, [-1] * self.sizes[-1]
        for kind, arguments, result in operations:
            if kind == "store" and operations[arguments[0]].kind == "entry":
                array, entry = operations[arguments[0]].detail
                copied[result] = entry if array == self.arguments[0] else -1
        return tuple(copied)

    def of(self, results: Sequence[int]) -> Kernel:
        """The kernel of some results alone, which become a vector in this order."""
        stores = {op.detail: n for n, op in enumerate(self.operations) if op.kind == "store"}
        wanted = [stores[result] for result in results]
        operations, renumbered = pruned(self.operations, wanted)
        for index, old in enumerate(wanted):
            new = renumbered[old]
            operations[new] = operations[new]._replace(detail=index)
        named = [renumbered[n] for n in self.named if n in renumbered]
        listed = json.dumps([operations, named], separators=(",", ":"))
        return Kernel(self.name, self.arguments, (*self.sizes[:-1], len(results)), 0, listed)

    @property
    def by_row(self) -> list[str]:
        """Arguments that have a row for each of several samples: all but constants.

        In a directional derivative these are seeds and result: a row belongs to a direction.
        """
        seeds = [name for name in self.arguments if name.startswith(SEED)]
        if seeds:
            return [*seeds, "_result"]
        return [name for name in self.arguments if name != "_constants"]

    def check(self, *lengths: int) -> None:
        """Raise `ValueError` if it needs more floats than its first arguments have (`lengths`)."""
        for argument, size, length in zip(self.arguments, self.sizes, lengths, strict=False):
            if size > length:
                raise ValueError(f"kernel {self.name}: {argument} has {length} floats, not {size}")

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of executed operations by kind, see `COUNTED`, and in `total`.

        `trigonometric` are sines, cosines and inverses.
        """
        operations, used = self.operations, uses(self.operations)
        counted_as = {kind: kind for kind in COUNTED}
        counted_as |= {"subtract": "add", "atan2": "trigonometric"}
        counted_as |= dict.fromkeys(set(FUNCTIONS) - {"sqrt", "abs"}, "trigonometric")
        counts: dict[str, int] = dict.fromkeys(COUNTED, 0)
        for number, (kind, arguments, _) in enumerate(operations):
            if kind in counted_as:
                counts[counted_as[kind]] += 1
            elif kind == "part" and used[number] and operations[arguments[0]].kind != "sums":
                counts["trigonometric"] += 1
        return counts | {"total": sum(counts.values())}


# A kernel's operations are read a few times in a row.
@lru_cache(maxsize=8)
def _read(listed: str) -> tuple[list[Operation], list[int]]:
    operations, named = json.loads(listed)
    return [Operation(*map(_tuples, operation)) for operation in operations], named


def padded(count: int, width: int = WIDTH) -> int:
    """Length of a row of so many floats, padded to a multiple of the vectors' width."""
    return -(-count // width) * width


def is_entry(detail: Any) -> bool:
    """Whether a part of a detail is an entry of an array."""
    return isinstance(detail, tuple) and bool(detail) and isinstance(detail[0], str)


def _tuples(part: Any) -> Any:
    return tuple(map(_tuples, part)) if isinstance(part, list) else part


def uses(operations: Sequence[Operation]) -> list[int]:
    """How many operations take each operation's value."""
    counts = [0] * len(operations)
    for operation in operations:
        for number in operation.arguments:
            counts[number] += 1
    return counts


def needed(operations: Sequence[Operation], roots: Collection[int]) -> list[int]:
    """Numbers of the roots and of all operations that they depend on, in order."""
    numbers = set(roots)
    for number in range(len(operations) - 1, -1, -1):
        if number in numbers:
            numbers.update(operations[number].arguments)
    return sorted(numbers)


def pruned(
    operations: Sequence[Operation], roots: Collection[int]
) -> tuple[list[Operation], dict[int, int]]:
    """The roots and all operations that they depend on; old number -> new number."""
    old_numbers = needed(operations, roots)
    renumbered = {old: new for new, old in enumerate(old_numbers)}
    remaining = []
    for old in old_numbers:
        kind, arguments, detail = operations[old]
        remaining.append(Operation(kind, tuple(renumbered[n] for n in arguments), detail))
    return remaining, renumbered


# Most operations of a file: the largest kernel of this package has 22,000, and compiles in 9 s.
MOST_SIZE = 90_000
# Arguments whose entries files may read.
ARRAYS = ("_x", "_u", "_constants")


def as_arrays(operations: Sequence[Operation]) -> dict[str, np.ndarray]:
    """Operations with one result as arrays, for files.

    Index of the kind in `KINDS`; arguments, for an entry its indices in `ARRAYS` and in the array;
    number.
    """
    kinds, arguments = list(KINDS), np.zeros((len(operations), 3), dtype=np.int64)
    numbers = np.zeros(len(operations))
    for n, (kind, taken, detail) in enumerate(operations):
        if kind == "number":
            numbers[n] = detail
        row = (ARRAYS.index(detail[0]), detail[1]) if kind == "entry" else taken
        arguments[n, : len(row)] = row
    indices = np.array([kinds.index(operation.kind) for operation in operations], dtype=np.int64)
    return {"kinds": indices, "arguments": arguments, "numbers": numbers}


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
        raise ValueError("the arrays of operations don't fit one another")
    table, operations = [*KINDS.items()], []
    for n, (index, row) in enumerate(zip(kinds.tolist(), arguments.tolist(), strict=True)):
        kind, count = table[index]
        detail = None
        if kind == "number":
            detail = float(numbers[n])
        elif kind == "entry":
            detail = ARRAYS[row[0]], row[1]
        if max(row[:count], default=-1) >= n:
            raise ValueError(f"operation {n} takes the value of a later one")
        operations.append(Operation(kind, tuple(row[:count]), detail))
    return tuple(operations)
