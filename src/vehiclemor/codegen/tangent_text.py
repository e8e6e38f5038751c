"""Tangents of straight-line kernels: the derivative of a kernel, as a kernel again.

The tangent of F(x, u, constants) in the directions `_seed_x`, `_seed_u`, ... is a kernel that gives
dF/dx seed_x + dF/du seed_u + ... (forward mode: A. Griewank, A. Walther, Evaluating Derivatives,
SIAM 2008, chapter 3).  The derivatives of each statement are gathered in scalar coefficients; what
does not depend on a seeded argument has no tangent and leaves no statement.  In vector lanes the
lanes are directions: values and coefficients are computed once for all of them.

Where a function has a kink, such as |x| at 0, it is the derivative on the side of larger arguments;
the norm of a vector that is zero has the derivative zero.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

from vehiclemor.codegen.operations import (
    COMPARISONS,
    SEED,
    VECTOR_STATEMENTS,
    Kernel,
    Listing,
    Operation,
    Reader,
    kernel_text,
    uses,
)
from vehiclemor.codegen.vector_lanes import LANES

# Function -> its derivative at the argument x, where it has the value v.
DERIVATIVES = {
    # Finite at zero: there a norm, whose square has the slope zero, has it too.  A choice would
    # become a branch, and branches break up what is one long block.
    "sqrt": "0.5 / (v + 1e-300)",
    "sin": "math.cos(x)",
    "cos": "-math.sin(x)",
    "tan": "1.0 + v * v",
    "asin": "1.0 / math.sqrt(1.0 - x * x)",
    "acos": "-1.0 / math.sqrt(1.0 - x * x)",
    "atan": "1.0 / (1.0 + x * x)",
    "exp": "v",
    "log": "1.0 / x",
    "sinh": "math.cosh(x)",
    "cosh": "math.sinh(x)",
    "tanh": "1.0 - v * v",
    "abs": "1.0 if x >= 0.0 else -1.0",
}
# Of these nothing is along a seed, or their parts are.
WITHOUT = ("sincos", "batch", "sums", "floor", *COMPARISONS.values())


class Coefficient(NamedTuple):
    """A scalar that a tangent is multiplied by: the value of an operation, 1 if there is none."""

    negative: bool = False
    number: int | None = None

    @property
    def opposite(self) -> Coefficient:
        """With the other sign."""
        return Coefficient(not self.negative, self.number)


# Tangents that a value's own is a sum of, each with its coefficient.
Combination = Mapping[int, Coefficient]


def tangent_name(name: str, arguments: Sequence[str]) -> str:
    """Name of the tangent of a kernel, such as `derivative_along_x_u`."""
    return "".join([f"{name}_along", *arguments])


def tangent_text(text: str, arguments: Sequence[str]) -> str:
    """Text of the tangent of a kernel.

    Parameters
    ----------
    text
        Of the kernel.
    arguments
        Names of the arguments that have seeds, such as `_x`.  The tangent takes the kernel's own
        arguments, then the seeds in this order, then the result, of the same shape as the kernel's.

    Raises
    ------
    ValueError
        If the text has what has no derivative.
    """
    kernel = Kernel(text)
    if unknown := set(arguments) - set(kernel.pointers[:-1]):
        raise ValueError(f"{kernel.name} has no argument {', '.join(sorted(unknown))}")
    found = _Tangents(kernel, arguments)
    for number in range(len(kernel.operations)):
        found.add(number)
    given = [name for name in kernel.arguments if name not in ("_work", "_result")]
    head = [*given, *(SEED + name for name in arguments), "_work", "_result"]
    columns = kernel.columns if kernel.dimensions == 2 else 0
    name = tangent_name(kernel.name, arguments)
    return kernel_text(name, head, found.operations, columns)


class _Tangents(Listing):
    """Operations of a kernel and, beside them, of the tangents of their values."""

    def __init__(self, kernel: Kernel, seeded: Sequence[str]) -> None:
        super().__init__()
        self._kernel, self._seeded = kernel, seeded
        self._numbers: list[int] = []
        self._tangents: list[Combination] = []
        self._seeds: dict[tuple[str, int], int] = {}
        self._sums: dict[int, int] = {}
        counts = uses(kernel.operations)
        shared = {number for number, count in enumerate(counts) if count > 1}
        self._named = shared.union(kernel.anchors)

    def add(self, number: int) -> None:
        """An operation of the kernel, the next one, and its tangent."""
        kind, arguments, detail = self._kernel.operations[number]
        given = [self._numbers[n] for n in arguments]
        along = [self._tangents[n] for n in arguments]
        if kind == "store":
            self.new("store", self._total(along[0]), detail=detail)
            self._numbers.append(-1)
            self._tangents.append({})
            return
        if kind in VECTOR_STATEMENTS:
            raise ValueError(f"{kind} has no tangent")
        own = self.new(kind, *given, detail=detail)
        found = self._tangent(number, own, given, along)
        if len(found) > 1 and number in self._named:
            found = {self._total(found): Coefficient()}
        self._numbers.append(own)
        self._tangents.append(found)

    def _tangent(
        self, number: int, own: int, given: Sequence[int], along: Sequence[Combination]
    ) -> Combination:
        kind, arguments, detail = self._kernel.operations[number]
        match kind:
            case "entry" if detail[0] in self._seeded:
                if detail not in self._seeds:
                    array, place = detail
                    self._seeds[detail] = self.new("entry", detail=(SEED + array, place))
                return {self._seeds[detail]: Coefficient()}
            case "part":
                return self._of_part(arguments[0], detail)
            case "sums" if detail[0] in self._seeded:
                raise ValueError("sums with weights have no tangent along the weights")
            case "sums" if any(along):
                moved = [self._total(tangent) for tangent in along]
                self._sums[number] = self.new("sums", *moved, detail=detail)
        if kind in WITHOUT or not any(along):
            return {}
        return self._of_value(kind, own, given, along)

    def _of_part(self, whole: int, place: int) -> Combination:
        """Tangent of one of several results."""
        kind, arguments, detail = self._kernel.operations[whole]
        if kind == "sums":
            if whole not in self._sums:
                return {}
            return {self.new("part", self._sums[whole], detail=place): Coefficient()}
        result, lane = divmod(place, LANES) if kind == "batch" else (place, 0)
        tangent, x = self._tangents[arguments[lane]], self._numbers[arguments[lane]]
        if not tangent:
            return {}

        def value(k: int) -> int:
            other = lane + LANES * k if kind == "batch" else k
            return self.new("part", self._numbers[whole], detail=other)

        if kind == "batch" and detail == "atan":
            return self._scaled(tangent, self._slope("atan", x, value(0)))
        if result == 0:
            return self._scaled(tangent, value(1))
        return _opposite(self._scaled(tangent, value(0)))

    def _of_value(
        self, kind: str, own: int, given: Sequence[int], along: Sequence[Combination]
    ) -> Combination:
        a, b = given[0], given[-1]
        of_a, of_b = along[0], along[-1]
        match kind:
            case "add":
                return self._added(of_a, of_b)
            case "subtract":
                return self._added(of_a, _opposite(of_b))
            case "negate":
                return _opposite(of_a)
            case "multiply":
                return self._added(self._scaled(of_a, b), self._scaled(of_b, a))
            case "divide":
                inverse = self.new("divide", self._number(1.0), b)
                found = self._scaled(of_a, inverse)
                if not of_b:
                    return found
                slope = self.new("multiply", own, inverse)
                return self._added(found, _opposite(self._scaled(of_b, slope)))
            case "power":
                if of_b:
                    raise ValueError("a varying exponent has no tangent: write exp(b log(a))")
                less = self.new("subtract", b, self._number(1.0))
                slope = self.new("multiply", b, self.new("power", a, less))
                return self._scaled(of_a, slope)
            case "select":
                return self._chosen(given[0], along[1], along[2])
            case "atan2":
                squares = [self.new("multiply", n, n) for n in (b, a)]
                inverse = self.new("divide", self._number(1.0), self.new("add", *squares))
                along_a = self._scaled(of_a, self.new("multiply", b, inverse))
                along_b = self._scaled(of_b, self.new("multiply", a, inverse))
                return self._added(along_a, _opposite(along_b))
        return self._scaled(of_a, self._slope(kind, a, own))

    def _chosen(self, test: int, then: Combination, other: Combination) -> Combination:
        found = {}
        for tangent in {**then, **other}:
            sides = [self._value(side.get(tangent)) for side in (then, other)]
            found[tangent] = Coefficient(False, self.new("select", test, *sides))
        return found

    def _slope(self, function: str, x: int, value: int) -> int:
        """Derivative of an elementary function at x, where it has this value."""
        if function not in DERIVATIVES:
            raise ValueError(f"{function} has no tangent")
        operations, result = _derivative(function)
        numbers = [x, value]
        for kind, arguments, detail in operations[len(numbers) :]:
            numbers.append(self.new(kind, *(numbers[n] for n in arguments), detail=detail))
        return numbers[result]

    def _number(self, value: float) -> int:
        return self.new("number", detail=value)

    def _value(self, coefficient: Coefficient | None) -> int:
        """Operation that gives a coefficient; zero where there is none."""
        if coefficient is None:
            return self._number(0.0)
        if coefficient.number is None:
            return self._number(-1.0 if coefficient.negative else 1.0)
        return (
            self.new("negate", coefficient.number) if coefficient.negative else coefficient.number
        )

    def _scaled(self, tangent: Combination, factor: int) -> Combination:
        """A tangent times the value of an operation."""
        return {
            own: Coefficient(
                c.negative, factor if c.number is None else self.new("multiply", c.number, factor)
            )
            for own, c in tangent.items()
        }

    def _added(self, a: Combination, b: Combination) -> Combination:
        total = dict(a)
        for own, c in b.items():
            if own not in total:
                total[own] = c
            elif total[own] == c.opposite:
                del total[own]
            else:
                both = self._value(total[own]), self._value(c)
                total[own] = Coefficient(False, self.new("add", *both))
        return total

    def _total(self, tangent: Combination) -> int:
        """Operation that gives a tangent, 0 where it is empty."""
        total: int | None = None
        # What is added comes first, so that nothing begins with a sign.
        for own, c in sorted(tangent.items(), key=lambda pair: pair[1].negative):
            term = own if c.number is None else self.new("multiply", c.number, own)
            if total is None:
                total = self.new("negate", term) if c.negative else term
            else:
                total = self.new("subtract" if c.negative else "add", total, term)
        return self._number(0.0) if total is None else total


def _opposite(tangent: Combination) -> Combination:
    return {own: c.opposite for own, c in tangent.items()}


@cache
def _derivative(function: str) -> tuple[list[Operation], int]:
    """Operations of a derivative, those of x and of the value first, and number of its result."""
    reader = Reader((), {"x": 0.0, "v": 0.0})
    result = reader.value(ast.parse(DERIVATIVES[function], mode="eval").body)
    return reader.operations, result
