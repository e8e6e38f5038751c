"""Directional derivatives of kernels, as kernels again.

The derivative of F(x, u, constants) in the directions `_seed_x`, `_seed_u`, ... is a kernel that
gives dF/dx seed_x + dF/du seed_u + ... by forward mode: beside each value stands its derivative in
the directions, the tangent (A. Griewank, A. Walther, Evaluating Derivatives, SIAM 2008, chapter 3).
What does not depend on a seeded argument has no tangent.  Of several directions at once the values
are computed once.

At a kink, such as that of |x| at 0, the derivative is that on the side of larger arguments; the
norm of a vector that is zero has the derivative zero.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.codegen.cache import cached_by_one_thread, digest_of, from_cache
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import (
    COMPARISONS,
    LANES,
    NAMED,
    SEED,
    VECTOR_STATEMENTS,
    Kernel,
    Listing,
    Operation,
    Value,
    uses,
)
from vehiclemor.codegen.sources import source_digest
from vehiclemor.short_repr import ShortRepr

# Directions that a derivative takes at once: what they share is computed once.
DIRECTIONS = 16
# Up to this number, directions are computed one by one: code for many takes longer to compile.
FEW = 4
# So are all directions of a result of more floats: a mass matrix would take half a minute.
LARGE = 100
# Depth of the longest expression without a named value inside.
SHALLOW = 12
# Function -> its derivative at the argument x, where the function has the value v.
SLOPES: dict[str, Callable[[Value, Value], Value]] = {
    # Finite at zero: a norm that is zero, whose square has the slope zero, has the slope zero too.
    # A choice would become a branch, and branches break up what is one long block.
    "sqrt": lambda _, v: 0.5 / (v + 1e-300),
    "sin": lambda x, _: np.cos(x),
    "cos": lambda x, _: -np.sin(x),
    "tan": lambda _, v: 1.0 + v * v,
    "asin": lambda x, _: 1.0 / np.sqrt(1.0 - x * x),
    "acos": lambda x, _: -1.0 / np.sqrt(1.0 - x * x),
    "atan": lambda x, _: 1.0 / (1.0 + x * x),
    "exp": lambda _, v: v,
    "log": lambda x, _: 1.0 / x,
    "sinh": lambda x, _: np.cosh(x),
    "cosh": lambda x, _: np.sinh(x),
    "tanh": lambda _, v: 1.0 - v * v,
    "abs": lambda x, _: x.listing.new("select", x >= 0.0, 1.0, -1.0),
}
# Operations without a tangent: they are constant between jumps, or their parts have the tangents.
WITHOUT_TANGENT = ("sincos", "batch", "floor", *COMPARISONS)
# Derivative of a value in the seeded directions; none where it is zero.
Tangent = Value | None


def derivative(kernel: Kernel, arguments: Sequence[str]) -> Kernel:
    """The derivative of a kernel along directions of some arguments, such as `_x`; kept on disk.

    It takes the kernel's arguments, then their seeds in this order, then the result, of the same
    shape.  `ValueError` if the kernel has an operation without a derivative.
    """

    def make() -> bytes:
        return json.dumps(asdict(_derived(kernel, arguments))).encode()

    parts = repr(kernel), *arguments, source_digest(("codegen",))
    content = from_cache(f"derivatives/{kernel.name}-{digest_of(parts)}.json", make)
    return Kernel.read(json.loads(content))


def _derived(kernel: Kernel, arguments: Sequence[str]) -> Kernel:
    *inputs, result = kernel.arguments
    if unknown := set(arguments) - set(inputs):
        raise ValueError(f"{kernel.name} has no argument {', '.join(sorted(unknown))}")
    listing = _ForwardMode(kernel.operations, arguments)
    for operation in kernel.operations:
        listing.add(operation)
    listing.name_shared_values()
    name = "".join([f"{kernel.name}_along", *arguments])
    seeds = [SEED + argument for argument in arguments]
    return listing.kernel(name, [*inputs, *seeds, result], kernel.columns)


class _ForwardMode(Listing):
    """Operations of a kernel and, beside each, those of its tangent."""

    def __init__(self, source: Sequence[Operation], seeded: Sequence[str]) -> None:
        super().__init__()
        self._source, self._seeded = source, seeded
        # By number of the kernel's operation.
        self._values: list[Value] = []
        self._tangents: list[Tangent] = []

    def add(self, operation: Operation) -> None:
        """Write the next operation of the kernel and its tangent."""
        kind, arguments, detail = operation
        if kind in VECTOR_STATEMENTS:
            raise ValueError(f"{kind} has no derivative")
        tangents = [self._tangents[n] for n in arguments]
        if kind == "store":
            self._values.append(self.new("store", _or_zero(tangents[0]), detail=detail))
            self._tangents.append(None)
            return
        value = self.new(kind, *[self._values[n] for n in arguments], detail=detail)
        self._values.append(value)
        self._tangents.append(self._tangent(operation, value, tangents))

    def name_shared_values(self) -> None:
        """Give names to values that are used more than once, and inside long expressions."""
        counts, depths = uses(self.operations), []
        for number, (kind, arguments, _) in enumerate(self.operations):
            depth = 1 + max((depths[n] for n in arguments), default=-1)
            if depth and (counts[number] > 1 or depth > SHALLOW):
                self.named.add(number)
            depths.append(0 if kind in NAMED or number in self.named else depth)

    def _tangent(self, operation: Operation, value: Value, tangents: Sequence[Tangent]) -> Tangent:
        kind, arguments, detail = operation
        if kind == "entry" and detail[0] in self._seeded:
            return self.entry(SEED + detail[0], detail[1])
        if kind == "part":
            return self._part_tangent(arguments[0], value, detail)
        if kind == "sums" and detail[0] in self._seeded:
            raise ValueError("sums with weights have no derivative along the weights")
        if kind in WITHOUT_TANGENT or all(tangent is None for tangent in tangents):
            return None
        if kind == "sums":
            return self.new("sums", *map(_or_zero, tangents), detail=detail)
        return _by_rule(kind, value, [self._values[n] for n in arguments], tangents)

    def _part_tangent(self, number: int, value: Value, index: int) -> Tangent:
        """Tangent of one of several results of an operation, by the operation's number."""
        kind, arguments, detail = self._source[number]
        if kind == "sums":
            sums = self._tangents[number]
            return None if sums is None else self.new("part", sums, detail=index)
        # A batch lists the sines, or arctangents, of all its arguments first, then the cosines.
        lanes = LANES if kind == "batch" else 1
        result, lane = divmod(index, lanes)
        tangent, argument = self._tangents[arguments[lane]], self._values[arguments[lane]]
        if tangent is None:
            return None
        if detail == "atan":
            return tangent * SLOPES["atan"](argument, value)
        if result == 0:
            cosine = self.new("part", self._values[number], detail=index + lanes)
            return tangent * cosine
        sine = self.new("part", self._values[number], detail=index - lanes)
        return -(tangent * sine)


def _by_rule(
    kind: str, value: Value, arguments: Sequence[Value], tangents: Sequence[Tangent]
) -> Tangent:
    """Tangent of a value by the rule of its operation, from its arguments and their tangents."""
    a, b, da, db = arguments[0], arguments[-1], tangents[0], tangents[-1]
    match kind:
        case "add":
            return _sum(da, db)
        case "subtract":
            return _difference(da, db)
        case "negate":
            return _difference(None, da)
        case "multiply":
            return _sum(_product(da, b), _product(db, a))
        case "divide":
            inverse = 1.0 / b
            if db is None:
                return _product(da, inverse)
            return _difference(_product(da, inverse), _product(db, value * inverse))
        case "power":
            if db is not None:
                raise ValueError("a varying exponent has no derivative: write exp(b log(a))")
            return _product(da, b * a ** (b - 1.0))
        case "select":
            return a.listing.new("select", a, _or_zero(tangents[1]), _or_zero(tangents[2]))
        case "atan2":
            inverse = 1.0 / (b * b + a * a)
            return _difference(_product(da, b * inverse), _product(db, a * inverse))
    if kind not in SLOPES:
        raise ValueError(f"{kind} has no derivative")
    return _product(da, SLOPES[kind](a, value))


def _or_zero(tangent: Tangent) -> Value | float:
    return 0.0 if tangent is None else tangent


def _product(tangent: Tangent, factor: Value) -> Tangent:
    return None if tangent is None else tangent * factor


def _sum(one: Tangent, other: Tangent) -> Tangent:
    if one is None:
        return other
    return one if other is None else one + other


def _difference(one: Tangent, other: Tangent) -> Tangent:
    if other is None:
        return one
    return -other if one is None else one - other


@dataclass(frozen=True, eq=False)
class JacobianProduct(ShortRepr):
    """Products of a kernel's Jacobian, by one of its arguments, with directions.

    The kernel is the directional derivative; size and width are numbers of floats of the result and
    of the argument.
    """

    kernel: Kernel
    size: int
    width: int

    @cached_property
    def acting(self) -> np.ndarray:
        """Indices of the argument that results depend on: the other columns are zero."""
        seed = self.kernel.arguments[-2]
        entries = [op.detail for op in self.kernel.operations if op.kind == "entry"]
        indices = {index for array, index in entries if array == seed}
        return np.array(sorted(indices), dtype=int)

    @cached_property
    def _unit_directions(self) -> np.ndarray:
        """Directions along the indices that act, then zeros up to full lanes."""
        units = np.zeros((_rows(len(self.acting)), self.width))
        units[np.arange(len(self.acting)), self.acting] = 1.0
        return units

    def columns(self, arrays: Sequence[np.ndarray], directions: np.ndarray) -> np.ndarray:
        """Products with directions (k, width), as rows (k, size), at the kernel's arguments."""
        seeds = np.zeros((_rows(len(directions)), self.width))
        seeds[: len(directions)] = directions
        return self._products(arrays, seeds)[: len(directions)]

    def jacobian(self, arrays: Sequence[np.ndarray]) -> np.ndarray:
        """Derivatives (size, width) by the entries of the argument."""
        columns = np.zeros((self.width, self.size))
        if len(self.acting):
            products = self._products(arrays, self._unit_directions)
            columns[self.acting] = products[: len(self.acting)]
        return np.ascontiguousarray(columns.T)

    def _products(self, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
        rows = len(seeds)
        lanes = 1 if rows <= FEW or self.size > LARGE else DIRECTIONS
        result = np.empty((rows, self.size))
        arguments = [*arrays, seeds[0], result[0]]
        for array, size in zip(arguments, self.kernel.sizes, strict=True):
            if array.size < size or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise TypeError(
                    f"{self.kernel.name}: {size} floats, not {array.dtype}{array.shape}"
                )
        function, pointers = _function(self.kernel, lanes), [a.ctypes.data for a in arguments]
        row_lengths = (self.width, self.size) if lanes > 1 else ()
        for _ in range(0, rows, lanes):
            function(*pointers, *row_lengths)
            # The next rows of seeds and of the result, the last two arguments.
            pointers[-2] += 8 * lanes * self.width
            pointers[-1] += 8 * lanes * self.size
        return result


def _rows(count: int) -> int:
    """Rows for so many directions: many of them fill their last lanes with zeros."""
    return count if count <= FEW else -(-count // DIRECTIONS) * DIRECTIONS


@cached_by_one_thread
def _function(kernel: Kernel, lanes: int) -> Callable[..., None]:
    """Machine code of a derivative as a C function; for many directions it takes row lengths."""
    kinds: list[Any] = [ctypes.c_void_p] * len(kernel.arguments)
    kinds += [ctypes.c_int64] * (2 if lanes > 1 else 0)
    return ctypes.CFUNCTYPE(None, *kinds)(Kernels([kernel]).address(kernel.name, lanes))


@cached_by_one_thread
def jacobian_product(kernel: Kernel, argument: str, size: int, width: int) -> JacobianProduct:
    """Of a kernel's result of `size` floats by an argument of `width`, such as `_x`."""
    return JacobianProduct(derivative(kernel, (argument,)), size, width)
