"""Directional derivatives of kernels, as kernels again.

The derivative of F(x, u, constants) in the directions `_seed_x`, `_seed_u`, ... is a kernel that
gives dF/dx seed_x + dF/du seed_u + ... (forward mode: A. Griewank, A. Walther, Evaluating
Derivatives, SIAM 2008, chapter 3).  The partial derivatives of operations are gathered in scalar
coefficients; what does not depend on a seeded argument leaves no operation.  Of several directions
at once values and coefficients are computed once.

Where a function has a kink, such as |x| at 0, it is the derivative on the side of larger arguments;
the norm of a vector that is zero has the derivative zero.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.cache import digest_of, fetched, once
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import (
    COMPARISONS,
    NAMED,
    SEED,
    VECTOR_STATEMENTS,
    Kernel,
    Listing,
    Value,
    function,
    uses,
)
from vehiclemor.codegen.sources import source_digest
from vehiclemor.codegen.vector_lanes import DIRECTIONS, LANES
from vehiclemor.short_repr import ShortRepr

# So few directions are taken one by one: the code for many takes longer to compile.
FEW = 4
# Expressions without a name inside are less deep.
SHALLOW = 12
# Function -> its derivative at the argument x, where it has the value v.
SLOPES: dict[str, Callable[[Value, Value], Value]] = {
    # Finite at zero: there a norm, whose square has the slope zero, has it too.  A choice would
    # become a branch, and branches break up what is one long block.
    "sqrt": lambda _, v: 0.5 / (v + 1e-300),
    "sin": lambda x, _: function("cos", x),
    "cos": lambda x, _: -function("sin", x),
    "tan": lambda _, v: 1.0 + v * v,
    "asin": lambda x, _: 1.0 / function("sqrt", 1.0 - x * x),
    "acos": lambda x, _: -1.0 / function("sqrt", 1.0 - x * x),
    "atan": lambda x, _: 1.0 / (1.0 + x * x),
    "exp": lambda _, v: v,
    "log": lambda x, _: 1.0 / x,
    "sinh": lambda x, _: function("cosh", x),
    "cosh": lambda x, _: function("sinh", x),
    "tanh": lambda _, v: 1.0 - v * v,
    "abs": lambda x, _: x.listing.new("select", x.listing.new(">=", x, 0.0), 1.0, -1.0),
}
# These have no derivative of their own, or their parts have.
WITHOUT = ("sincos", "batch", "sums", "floor", *COMPARISONS)


class Coefficient(NamedTuple):
    """A scalar that a derivative is multiplied by: a value, 1 if there is none."""

    negative: bool = False
    value: Value | None = None

    @property
    def opposite(self) -> Coefficient:
        """With the other sign."""
        return Coefficient(not self.negative, self.value)


# Derivatives that a value's own is a sum of, each with its coefficient.
Combination = Mapping[Value, Coefficient]


def derivative(kernel: Kernel, arguments: Sequence[str]) -> Kernel:
    """The derivative of a kernel along directions of some arguments, such as `_x`; kept on disk.

    It takes the kernel's arguments, then their seeds in this order, then the result, of the same
    shape.  `ValueError` if the kernel has what has no derivative.
    """

    def make() -> bytes:
        return json.dumps(asdict(_derived(kernel, arguments))).encode()

    parts = repr(kernel), *arguments, source_digest(("codegen",))
    return Kernel.read(
        json.loads(fetched(f"derivatives/{kernel.name}-{digest_of(parts)}.json", make))
    )


def _derived(kernel: Kernel, arguments: Sequence[str]) -> Kernel:
    *given, result = kernel.arguments
    if unknown := set(arguments) - set(given):
        raise ValueError(f"{kernel.name} has no argument {', '.join(sorted(unknown))}")
    found = _Derivatives(kernel, arguments)
    for number in range(len(kernel.operations)):
        found.add(number)
    found.name()
    head = [*given, *(SEED + name for name in arguments), result]
    name = "".join([f"{kernel.name}_along", *arguments])
    return found.kernel(name, head, kernel.columns)


class _Derivatives(Listing):
    """Operations of a kernel and, beside them, of the derivatives of their values."""

    def __init__(self, kernel: Kernel, seeded: Sequence[str]) -> None:
        super().__init__()
        self._given, self._seeded = kernel.operations, seeded
        self._values: list[Value] = []
        self._derivatives: list[Combination] = []
        self._seeds: dict[tuple[str, int], Value] = {}
        self._sums: dict[int, Value] = {}
        shared = {number for number, count in enumerate(uses(kernel.operations)) if count > 1}
        self._shared = shared.union(kernel.named)

    def add(self, number: int) -> None:
        """An operation of the kernel, the next one, and its derivative."""
        kind, arguments, detail = self._given[number]
        along = [self._derivatives[n] for n in arguments]
        if kind in VECTOR_STATEMENTS:
            raise ValueError(f"{kind} has no derivative")
        found: Combination = {}
        if kind == "store":
            own = self.new("store", self._total(along[0]), detail=detail)
        else:
            own = self.new(kind, *(self._values[n] for n in arguments), detail=detail)
            found = self._derivative(number, own, along)
        if len(found) > 1 and number in self._shared:
            found = {self._total(found): Coefficient()}
        self._values.append(own)
        self._derivatives.append(found)

    def name(self) -> None:
        """Give names to what is used more than once, and to the inside of long expressions."""
        counts, depths = uses(self.operations), []
        for number, (kind, arguments, _) in enumerate(self.operations):
            depth = 1 + max((depths[n] for n in arguments), default=-1)
            if depth and (counts[number] > 1 or depth > SHALLOW):
                self.named.add(number)
            depths.append(0 if kind in NAMED or number in self.named else depth)

    def _derivative(self, number: int, own: Value, along: Sequence[Combination]) -> Combination:
        kind, arguments, detail = self._given[number]
        match kind:
            case "entry" if detail[0] in self._seeded:
                if detail not in self._seeds:
                    self._seeds[detail] = self.entry(SEED + detail[0], detail[1])
                return {self._seeds[detail]: Coefficient()}
            case "part":
                return self._of_part(arguments[0], own, detail)
            case "sums" if detail[0] in self._seeded:
                raise ValueError("sums with weights have no derivative along the weights")
            case "sums" if any(along):
                changes = [self._total(change) for change in along]
                self._sums[number] = self.new("sums", *changes, detail=detail)
        if kind in WITHOUT or not any(along):
            return {}
        return self._of_value(kind, own, [self._values[n] for n in arguments], along)

    def _of_part(self, whole: int, own: Value, place: int) -> Combination:
        """Derivative of one of several results."""
        kind, arguments, detail = self._given[whole]
        if kind == "sums":
            if whole not in self._sums:
                return {}
            return {self.new("part", self._sums[whole], detail=place): Coefficient()}
        # Results of a batch are one function's of all arguments, then the other's.
        result, lane = divmod(place, LANES) if kind == "batch" else (place, 0)
        change = self._derivatives[arguments[lane]]
        if not change:
            return {}
        if detail == "atan":
            slope = SLOPES["atan"](self._values[arguments[lane]], own)
            return self._scaled(change, slope)
        step = LANES if kind == "batch" else 1
        other = place + step if result == 0 else place - step
        slope = self.new("part", self._values[whole], detail=other)
        found = self._scaled(change, slope)
        return found if result == 0 else _opposite(found)

    def _of_value(
        self, kind: str, own: Value, given: Sequence[Value], along: Sequence[Combination]
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
                inverse = 1.0 / b
                found = self._scaled(of_a, inverse)
                if not of_b:
                    return found
                return self._added(found, _opposite(self._scaled(of_b, own * inverse)))
            case "power":
                if of_b:
                    raise ValueError("a varying exponent has no derivative: write exp(b log(a))")
                return self._scaled(of_a, b * function("power", a, b - 1.0))
            case "select":
                return self._chosen(given[0], along[1], along[2])
            case "atan2":
                inverse = 1.0 / (b * b + a * a)
                along_a = self._scaled(of_a, b * inverse)
                return self._added(along_a, _opposite(self._scaled(of_b, a * inverse)))
        if kind not in SLOPES:
            raise ValueError(f"{kind} has no derivative")
        return self._scaled(of_a, SLOPES[kind](a, own))

    def _chosen(self, test: Value, then: Combination, other: Combination) -> Combination:
        found = {}
        for change in {**then, **other}:
            sides = [self._value(side.get(change)) for side in (then, other)]
            found[change] = Coefficient(False, self.new("select", test, *sides))
        return found

    def _value(self, coefficient: Coefficient | None) -> Value:
        """A coefficient; zero where there is none."""
        if coefficient is None:
            return self.number(0.0)
        if coefficient.value is None:
            return self.number(-1.0 if coefficient.negative else 1.0)
        return -coefficient.value if coefficient.negative else coefficient.value

    def _scaled(self, change: Combination, factor: Value) -> Combination:
        """A derivative times a value."""
        return {
            own: Coefficient(c.negative, factor if c.value is None else c.value * factor)
            for own, c in change.items()
        }

    def _added(self, a: Combination, b: Combination) -> Combination:
        total = dict(a)
        for own, c in b.items():
            if own not in total:
                total[own] = c
            elif total[own] == c.opposite:
                del total[own]
            else:
                total[own] = Coefficient(False, self._value(total[own]) + self._value(c))
        return total

    def _total(self, change: Combination) -> Value:
        """The value of a derivative, 0 where it is empty."""
        total: Value | None = None
        # What is added comes first, so that nothing begins with a sign.
        for own, c in sorted(change.items(), key=lambda pair: pair[1].negative):
            term = own if c.value is None else c.value * own
            if total is None:
                total = -term if c.negative else term
            else:
                total = total - term if c.negative else total + term
        return self.number(0.0) if total is None else total


def _opposite(change: Combination) -> Combination:
    return {own: c.opposite for own, c in change.items()}


@dataclass(frozen=True, eq=False)
class Sensitivity(ShortRepr):
    """Products of a kernel's Jacobian, by one of its arguments, with directions.

    The kernel is the directional derivative; size and width are numbers of floats of the result and
    of the argument.
    """

    kernel: Kernel
    size: int
    width: int

    @cached_property
    def acting(self) -> np.ndarray:
        """Places of the argument on which results depend; the others' columns are zero."""
        seed = self.kernel.arguments[-2]
        entries = [op.detail for op in self.kernel.operations if op.kind == "entry"]
        return np.unique(np.array([place for array, place in entries if array == seed], dtype=int))

    @cached_property
    def _units(self) -> np.ndarray:
        """Directions along the places that matter, filled up."""
        units = np.zeros((_rows(len(self.acting)), self.width))
        units[np.arange(len(self.acting)), self.acting] = 1.0
        return units

    def columns(self, arrays: Sequence[np.ndarray], directions: np.ndarray) -> np.ndarray:
        """Products with directions (k, width), as rows (k, size), at the kernel's own arguments."""
        seeds = np.zeros((_rows(len(directions)), self.width))
        seeds[: len(directions)] = directions
        return self._products(arrays, seeds)[: len(directions)]

    def jacobian(self, arrays: Sequence[np.ndarray]) -> np.ndarray:
        """Derivatives (size, width) by the entries of the argument."""
        found = np.zeros((self.width, self.size))
        if len(self.acting):
            found[self.acting] = self._products(arrays, self._units)[: len(self.acting)]
        return np.ascontiguousarray(found.T)

    def _products(self, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
        rows, lanes = len(seeds), 1 if len(seeds) <= FEW else DIRECTIONS
        result = np.empty((rows, self.size))
        given = [*arrays, seeds[0], result[0]]
        for array, size in zip(given, self.kernel.sizes, strict=True):
            if array.size < size or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise TypeError(
                    f"{self.kernel.name}: {size} floats, not {array.dtype}{array.shape}"
                )
        function, pointers = _function(self.kernel, lanes), [array.ctypes.data for array in given]
        for _ in range(0, rows, lanes):
            function(*pointers, *((self.width, self.size) if lanes > 1 else ()))
            pointers[-2] += 8 * lanes * self.width
            pointers[-1] += 8 * lanes * self.size
        return result


def _rows(count: int) -> int:
    return count if count <= FEW else -(-count // DIRECTIONS) * DIRECTIONS


@once
def _function(kernel: Kernel, lanes: int) -> Callable[..., None]:
    """Machine code of a derivative as a C function; for many directions it is told their length."""
    kinds: list[Any] = [ctypes.c_void_p] * len(kernel.arguments)
    kinds += [ctypes.c_int64] * (2 if lanes > 1 else 0)
    return ctypes.CFUNCTYPE(None, *kinds)(Kernels([kernel]).address(kernel.name, lanes))


@once
def sensitivity(kernel: Kernel, argument: str, size: int, width: int) -> Sensitivity:
    """Of a kernel's result of `size` floats to an argument of `width`, such as `_x`."""
    return Sensitivity(derivative(kernel, (argument,)), size, width)
