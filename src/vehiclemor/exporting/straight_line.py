"""Kernels written out as operations with one result each, for other languages and libraries.

Kernels also have batches of elementary functions and sums with weights, which are for vector units.
What is left here is short enough for any printer or interpreter: operations with one result, `min`,
`max`, and `table` (a number of a table, by row and offset).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.derivatives import derivative
from vehiclemor.codegen.operations import (
    SEED,
    Kernel,
    Listing,
    Operation,
    Value,
    needed,
    padded,
)

# Function of a system -> names of its arguments, in order, and of its result.
SIGNATURES = {
    "constants": ("p", "c"),
    "derivative": ("x", "u", "c", "dx"),
    "outputs": ("x", "u", "c", "y"),
}
# Functions that other systems must have.
FUNCTIONS = (
    *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("atan2", "abs", "max", "min", "floor"),
)
# Function that has batches -> what gives its results.
PARTS = {"sincos": ("sin", "cos"), "atan": ("atan",)}
OPERATORS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
    "negate": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
# Name of an array -> its entries.
Arrays = Mapping[str, Sequence[Value]]


class StraightLine(NamedTuple):
    """A function of arrays: the operations that give its results, among others."""

    operations: Sequence[Operation]
    results: Sequence[int]

    @property
    def needed(self) -> list[int]:
        """Numbers of the operations that the results depend on, in order."""
        return needed(self.operations, self.results)

    def read(self, array: str) -> set[int]:
        """Indices of the entries of an array that the results depend on."""
        indices = set()
        for number in self.needed:
            kind, _, detail = self.operations[number]
            if kind == "entry" and detail[0] == array:
                indices.add(detail[1])
        return indices


class Lines(Listing):
    """Operations that several functions share, written one after the other."""

    def entries(self, array: str, count: int) -> list[Value]:
        """Entries of an array."""
        return [self.entry(array, index) for index in range(count)]

    def numbers(self, values: Iterable[float]) -> list[Value]:
        """Numbers."""
        return [self.number(value) for value in values]

    def functions(self, results: Mapping[str, Sequence[Value]]) -> dict[str, StraightLine]:
        """Name -> function; one without results is a function too."""
        by_name = {}
        for name in SIGNATURES:
            numbers = [value.number for value in results.get(name, ())]
            by_name[name] = StraightLine(self.operations, numbers)
        return by_name

    def include(self, kernel: Kernel, arrays: Arrays) -> list[Value]:
        """Write a kernel out for entries of its arguments; its results, row by row."""
        written: list[Any] = []
        results = {}
        for kind, arguments, detail in kernel.operations:
            values = [written[n] for n in arguments]
            match kind:
                case "entry":
                    value: Any = arrays[detail[0]][detail[1]]
                case "store":
                    value = results[detail] = values[0]
                case "sincos":
                    value = [self.new(name, *values) for name in PARTS[kind]]
                case "batch":
                    value = [self.new(name, v) for name in PARTS[detail] for v in values]
                case "sums":
                    value = self._sums(arrays, values, *detail)
                case "part":
                    value = values[0][detail]
                case _:
                    value = self.new(kind, *values, detail=detail)
            written.append(value)
        return [results[index] for index in sorted(results)]

    def derivative(self, kernel: Kernel, arrays: Arrays, seeds: Arrays) -> list[Value]:
        """The derivative of a kernel along seeds of some of its arguments, see `derivatives`."""
        seeded = tuple(name for name in seeds if name in kernel.arguments)
        seed_arrays = {SEED + name: seeds[name] for name in seeded}
        return self.include(derivative(kernel, seeded), {**arrays, **seed_arrays})

    def _sums(
        self, arrays: Arrays, factors: Sequence[Value], array: str, first: int, targets: int
    ) -> list[Value]:
        """Sums of factors times weights, of which zeros are left out."""
        zero, one = (Operation("number", (), number) for number in (0.0, 1.0))
        rows, sums = arrays[array][first:], []
        for column in range(targets):
            terms = []
            for weight, factor in zip(rows[column :: padded(targets)], factors, strict=False):
                if self.operations[weight.number] != zero:
                    alone = self.operations[factor.number] == one
                    terms.append(weight if alone else weight * factor)
            sums.append(self._total(terms))
        return sums

    def product(self, matrix: np.ndarray, vector: Sequence[Value]) -> list[Value]:
        """A matrix times a vector; zeros are left out."""
        rows = []
        for weights in matrix.tolist():
            terms = []
            for weight, value in zip(weights, vector, strict=True):
                if weight:
                    terms.append(value if weight == 1.0 else weight * value)
            rows.append(self._total(terms))
        return rows

    def _total(self, terms: Sequence[Value]) -> Value:
        """Sum of terms in pairs: shallow for whoever walks through it, and rounded less."""
        if len(terms) < 2:
            return terms[0] if terms else self.number(0.0)
        half = len(terms) // 2
        return self._total(terms[:half]) + self._total(terms[half:])

    def largest(self, values: Sequence[Value]) -> Value:
        """The largest magnitude, which says how far a state goes within the training."""
        first, *others = map(abs, values)
        for value in others:
            first = self.new("max", first, value)
        return first

    def largest_derivative(self, values: Sequence[Value], changes: Sequence[Value]) -> Value:
        """Derivative of the largest magnitude, from changes of the values."""
        largest, result = self.largest(values), self.number(0.0)
        for value, change in zip(values, changes, strict=True):
            of_magnitude = self.new("select", self.new("<", value, 0.0), -change, change)
            is_largest = self.new(">=", abs(value), largest)
            result = self.new("select", is_largest, of_magnitude, result)
        return result


def evaluated(
    function: StraightLine,
    arrays: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
) -> list[Any]:
    """Results of a function over values of another system: symbols, or arrays of a batch.

    Arrays have the values of their entries; functions are those of `FUNCTIONS`, `select` and, of a
    table, `entry`.
    """
    computed = OPERATORS | dict(functions)
    known = {}
    for number in function.needed:
        kind, arguments, detail = function.operations[number]
        values = [known[n] for n in arguments]
        if kind == "number":
            value = detail
        elif kind == "entry":
            value = arrays[detail[0]][detail[1]]
        elif kind == "table":
            value = functions["entry"](*values, detail)
        else:
            value = computed[kind](*values)
        known[number] = value
    return [known[number] for number in function.results]
