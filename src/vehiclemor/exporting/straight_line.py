"""Kernels written out as operations with one result each, for other languages and libraries.

Kernels also have batches of elementary functions and sums with weights, which are for vector units.
What is left here is short enough for any printer or interpreter: operations with one result, `min`,
`max`, and `table` (a number of a table, of a row and at a place).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from vehiclemor.codegen.derivatives import derivative
from vehiclemor.codegen.operations import SEED, Kernel, Listing, Operation, Value, needed, uses
from vehiclemor.codegen.vector_lanes import padded

# Functions of a system.
NAMES = ("constants", "derivative", "outputs")
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
Given = Mapping[str, Sequence[Value]]


class StraightLine(NamedTuple):
    """A function of arrays: the operations that give its results, among others."""

    operations: Sequence[Operation]
    results: Sequence[int]

    @property
    def needed(self) -> list[int]:
        """Numbers of the operations that the results depend on, in order."""
        return needed(self.operations, self.results)

    def read(self, array: str) -> set[int]:
        """Places of the entries of an array that the results depend on."""
        found = (self.operations[number] for number in self.needed)
        return {op.detail[1] for op in found if op.kind == "entry" and op.detail[0] == array}


class Lines(Listing):
    """Operations that several functions share, written one after the other."""

    def entries(self, array: str, count: int) -> list[Value]:
        """Entries of an array."""
        return [self.entry(array, place) for place in range(count)]

    def numbers(self, values: Iterable[float]) -> list[Value]:
        """Numbers."""
        return [self.number(value) for value in values]

    def functions(self, results: Mapping[str, Sequence[Value]]) -> dict[str, StraightLine]:
        """Name -> function; what has no results is a function too."""
        listed = {name: [value.number for value in results.get(name, ())] for name in NAMES}
        return {name: StraightLine(self.operations, numbers) for name, numbers in listed.items()}

    def include(self, kernel: Kernel, given: Given) -> list[Value]:
        """Write a kernel out, given entries of its arguments; its results, row by row."""
        written: list[Any] = []
        stored = {}
        for kind, arguments, detail in kernel.operations:
            values = [written[n] for n in arguments]
            match kind:
                case "entry":
                    found: Any = given[detail[0]][detail[1]]
                case "store":
                    found = stored[detail] = values[0]
                case "sincos":
                    found = [self.new(name, *values) for name in PARTS[kind]]
                case "batch":
                    found = [self.new(name, v) for name in PARTS[detail] for v in values]
                case "sums":
                    found = self._sums(given, values, *detail)
                case "part":
                    found = values[0][detail]
                case _:
                    found = self.new(kind, *values, detail=detail)
            written.append(found)
        return [stored[place] for place in sorted(stored)]

    def derivative(self, kernel: Kernel, given: Given, seeds: Given) -> list[Value]:
        """The derivative of a kernel along seeds of some of its arguments, see `derivatives`."""
        own = {name: seed for name, seed in seeds.items() if name in kernel.arguments}
        seeded = {SEED + name: seed for name, seed in own.items()}
        return self.include(derivative(kernel, tuple(own)), {**given, **seeded})

    def _sums(
        self, given: Given, factors: Sequence[Value], array: str, first: int, targets: int
    ) -> list[Value]:
        """Sums of factors times weights, of which zeros are left out."""
        zero, one = (Operation("number", (), number) for number in (0.0, 1.0))
        rows, found = given[array][first:], []
        for column in range(targets):
            terms = []
            for weight, factor in zip(rows[column :: padded(targets)], factors, strict=False):
                if self.operations[weight.number] != zero:
                    alone = self.operations[factor.number] == one
                    terms.append(weight if alone else weight * factor)
            found.append(self._total(terms))
        return found

    def _total(self, terms: Sequence[Value]) -> Value:
        """Sum of terms in pairs: shallow for whoever walks through it, and rounded less."""
        if len(terms) < 2:
            return terms[0] if terms else self.number(0.0)
        half = len(terms) // 2
        return self._total(terms[:half]) + self._total(terms[half:])

    def largest(self, values: Sequence[Value]) -> Value:
        """The largest magnitude: what tells how far a state goes in what a model knows."""
        first, *others = map(abs, values)
        for value in others:
            first = self.new("max", first, value)
        return first

    def largest_derivative(self, values: Sequence[Value], changes: Sequence[Value]) -> Value:
        """Derivative of the largest magnitude, of values that change so."""
        largest, found = self.largest(values), self.number(0.0)
        for value, change in zip(values, changes, strict=True):
            own = self.new("select", self.new("<", value, 0.0), -change, change)
            found = self.new("select", self.new(">=", abs(value), largest), own, found)
        return found


def evaluated(
    function: StraightLine,
    arrays: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
    let: Callable[[Any], Any] | None = None,
) -> list[Any]:
    """Results of a function over values of another system: symbols, or arrays of a batch.

    Arrays have the values of their entries; functions are those of `FUNCTIONS`, `select` and, of a
    table, `entry`; `let` gives what stands for a value that is used more than once.
    """
    computed = OPERATORS | dict(functions)
    counts, known = uses(function.operations), {}
    for number in function.needed:
        kind, arguments, detail = function.operations[number]
        values = [known[n] for n in arguments]
        if kind == "number":
            found = detail
        elif kind == "entry":
            found = arrays[detail[0]][detail[1]]
        elif kind == "table":
            found = functions["entry"](*values, detail)
        else:
            found = computed[kind](*values)
            found = let(found) if let and counts[number] > 1 else found
        known[number] = found
    return [known[number] for number in function.results]
