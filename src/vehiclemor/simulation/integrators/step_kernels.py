"""A kernel that takes steps of a system with a frozen Jacobian.

With two or four dozen states the loops around the stages would take as long as the right-hand side.
This kernel does a step of `etdrk4` in vectors of known length and executes the right-hand side by
its address.  Vectors that stored operators are applied to stand in a frame: the
heading is turned to zero, and left and right are replaced by sum and difference.  A vehicle equals
its mirror image: in these its Jacobian at straight running has two diagonal blocks, of motions that
the mirror leaves and of motions that it reverses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.operations import Kernel, Listing, Value, padded
from vehiclemor.simulation.integrators import etdrk4

# Vectors that a step hands back.
RESULTS = ("new", "rates", "error")
# Wheels that the mirror exchanges, as parts of names.
SWAPPED = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}
# Entries of a Jacobian, in SI units, below which they are rounding of its differences.
ROUNDING = 1e-5
# Coordinates of a diagonal block: each a sum of states times signs.
Block = tuple[tuple[tuple[int, float], ...], ...]


def partners(names: Sequence[str]) -> np.ndarray:
    """Number of the state that each becomes in the mirror; the same if it has no partner."""
    numbers = {name: i for i, name in enumerate(names)}
    images = []
    for name in names:
        image = "_".join(SWAPPED.get(part, part) for part in name.split("_"))
        images.append(numbers.get(image, numbers[name]))
    return np.array(images, dtype=np.int64)


def signs(jacobian: np.ndarray, partner: np.ndarray) -> np.ndarray | None:
    """Signs (n,) with which J (n, n) equals its mirror image; none if there are no such signs.

    S J S = J for (S x)_i = signs[i] x[partner[i]] fixes the signs of states that are coupled
    against one another; each group of coupled states may be reversed together.
    """
    image = jacobian[np.ix_(partner, partner)]
    coupled = (np.abs(jacobian) > ROUNDING) & (np.abs(image) > ROUNDING)
    relation = np.where(coupled, np.sign(jacobian * image), 0.0)
    # Either of a pair has the same sign, so that S S is the identity.
    relation[np.arange(len(partner)), partner] = 1.0
    sign_of = np.zeros(len(partner))
    for first in range(len(partner)):
        waiting = [] if sign_of[first] else [(first, 1.0)]
        while waiting:
            i, sign = waiting.pop()
            if not sign_of[i]:
                sign_of[i] = sign
                related = relation[i] + relation[:, i] * (relation[i] == 0.0)
                waiting += [(j, sign * related[j]) for j in np.flatnonzero(related)]
    reflected = sign_of[:, None] * image * sign_of
    return sign_of if np.abs(reflected - jacobian).max(initial=0.0) <= ROUNDING else None


def mirror_blocks(partner: np.ndarray, sign: np.ndarray) -> tuple[Block, ...]:
    """Coordinates that the mirror leaves, and those that it reverses, as sums of states."""
    blocks: list[Block] = []
    for parity in (1.0, -1.0):
        rows: list[tuple[tuple[int, float], ...]] = []
        for i, j in enumerate(partner.tolist()):
            if i < j:
                rows.append(((i, 1.0), (j, parity * float(sign[i]))))
            elif i == j and sign[i] == parity:
                rows.append(((i, 1.0),))
        blocks.append(tuple(rows))
    return tuple(block for block in blocks if block)


class Frame(NamedTuple):
    """Coordinates in which operators are stored.

    Each block has coordinates, sums of one or two states with signs, and columns, numbers of those
    that the right-hand side depends on.  Rotating are the heading and pairs of states that turn
    with it; they may be none.
    """

    blocks: tuple[Block, ...]
    columns: tuple[tuple[int, ...], ...]
    rotating: tuple[int, ...]

    @property
    def transform(self) -> np.ndarray:
        """Matrix (n, n) from states to coordinates, block after block."""
        rows = [row for block in self.blocks for row in block]
        matrix = np.zeros((len(rows), len(rows)))
        for i, row in enumerate(rows):
            for state, weight in row:
                matrix[i, state] = weight
        return matrix

    def diagonal(self, jacobian: np.ndarray) -> list[np.ndarray]:
        """Diagonal blocks of a Jacobian (n, n) in these coordinates."""
        transform = self.transform
        in_frame = np.linalg.solve(transform.T, (transform @ jacobian).T).T
        ends = np.cumsum([0, *(len(block) for block in self.blocks)])
        return [in_frame[a:b, a:b] for a, b in pairwise(ends)]

    @property
    def inverse(self) -> np.ndarray:
        """Matrix (n, n) from coordinates to states: rows of the transform are orthogonal."""
        transform = self.transform
        return transform.T / np.count_nonzero(transform, axis=1)

    @property
    def plain(self) -> bool:
        """Whether coordinates are the states."""
        states = sum(len(block) for block in self.blocks)
        same = tuple(((i, 1.0),) for i in range(states))
        return self.blocks == (same,) and not self.rotating

    @property
    def offsets(self) -> list[int]:
        """Where each block begins in a vector, and the length of a vector."""
        return np.cumsum([0, *(padded(len(block)) for block in self.blocks)]).tolist()

    def entries(self, table: int) -> list[int]:
        """First entry of each block of a table, and that of the next table."""
        sizes = [len(c) * padded(len(b)) for c, b in zip(self.columns, self.blocks, strict=True)]
        return (np.cumsum([0, *sizes]) + table * sum(sizes)).tolist()

    def packed(self, tables: Sequence[np.ndarray]) -> np.ndarray:
        """Operators (step sizes, 1, entries) of each block's transposed (sizes, tables, n, n)."""
        parts = []
        for table, columns in zip(tables, self.columns, strict=True):
            n = table.shape[-1]
            wide = ((0, 0), (0, 0), (0, 0), (0, padded(n) - n))
            rows = np.pad(table[:, :, list(columns)], wide)
            parts.append(rows.reshape(*table.shape[:2], -1))
        return np.ascontiguousarray(np.concatenate(parts, axis=2).reshape(len(parts[0]), 1, -1))


class _Step(Listing):
    """Operations of a step; vectors beside those given stand one after the other in the result."""

    def __init__(self, frame: Frame, given: Sequence[str], scalars: int) -> None:
        super().__init__()
        self.frame = frame
        self.n = n = sum(len(block) for block in frame.blocks)
        # Of a vector of coordinates, and room for any.
        self.width = frame.offsets[-1]
        self.stride = max(padded(n), self.width)
        self.vectors = {name: ("_x", k * n) for k, name in enumerate(given)}
        first = len(given) * n
        self.inputs, self.used = first + scalars, 0
        self.scalars = [self.let(self.entry("_x", first + k)) for k in range(scalars)]
        # State that turns with the heading -> its partner, and whether that is the second.
        self.partners: dict[int, tuple[int, bool]] = {}
        if frame.rotating:
            heading = self.entry(*self.at("y", frame.rotating[0]))
            self.sine, self.cosine = self.parts(self.new("sincos", heading), 2)
            for a, b in zip(frame.rotating[1::2], frame.rotating[2::2], strict=True):
                self.partners |= {a: (b, True), b: (a, False)}

    def at(self, name: str, entry: int = 0) -> tuple[str, int]:
        """Array and number of an entry of a vector."""
        if name not in self.vectors:
            self.vectors[name] = ("_result", self.used)
            self.used += padded(self.n) if name in RESULTS else self.stride
        array, first = self.vectors[name]
        return array, first + entry

    def sum(self, to: str, *terms: tuple[Value | float, str], n: int = 0) -> None:
        """A vector as the sum of factors times vectors, of coordinates by default."""
        detail = self.at(to), n or self.width, *(self.at(name) for _, name in terms)
        self.new("combine", *(factor for factor, _ in terms), detail=detail)

    def rates(self, state: str, inputs: int, to: str) -> None:
        """The right-hand side at a state and the inputs that begin at a number."""
        given = self.at(state), ("_x", self.inputs + inputs), ("_constants", 0)
        self.new("execute", detail=(("_kernels", 0), *given, self.at(to)))

    def turned(self, read: Callable[[int], Value], state: int, back: bool) -> Value:
        """A state with the heading turned to zero, or back, of what reads states."""
        if state not in self.partners:
            return read(state)
        other, first = self.partners[state]
        along, across = self.cosine * read(state), self.sine * read(other)
        return along - across if first == back else along + across

    def enter(self, to: str, vector: str) -> None:
        """Coordinates of a vector of states; the same vector if they are the states."""
        if self.frame.plain:
            self.vectors[to] = self.vectors[vector]
            return

        def read(state: int) -> Value:
            return self.entry(*self.at(vector, state))

        for first, block in zip(self.frame.offsets, self.frame.blocks, strict=False):
            for k in range(padded(len(block))):
                row = block[k] if k < len(block) else ()
                terms = [w * self.turned(read, i, back=False) for i, w in row]
                self.store(self.at(to, first + k)[1], _total(terms) if terms else 0.0)

    def leave(self, to: str, coordinates: str, start: str = "") -> None:
        """States of a vector of coordinates, added to another vector of states."""
        if self.frame.plain:
            self.sum(to, *[(1.0, name) for name in (start, coordinates) if name], n=self.n)
            return
        inverse, entries = self.frame.inverse, list[int]()
        for first, block in zip(self.frame.offsets, self.frame.blocks, strict=False):
            entries += range(first, first + len(block))

        def read(state: int) -> Value:
            terms = []
            for k in np.flatnonzero(inverse[state]).tolist():
                coordinate = self.entry(*self.at(coordinates, entries[k]))
                terms.append(float(inverse[state, k]) * coordinate)
            return _total(terms)

        for i in range(self.n):
            value = self.turned(read, i, back=True)
            if start:
                value = self.entry(*self.at(start, i)) + value
            self.store(self.at(to, i)[1], value)

    def product(self, to: str, table: int, vector: str, weight: float) -> None:
        """A stored operator times a vector of coordinates."""
        frame, entries = self.frame, self.frame.entries(table)
        for first, block, columns, rows in zip(
            frame.offsets, frame.blocks, frame.columns, entries, strict=False
        ):
            other = tuple(i for i in range(len(block)) if i not in columns)
            arrays = self.at(to, first), padded(len(block)), ("_u", rows), self.at(vector, first)
            self.new("product", detail=(*arrays, columns, other, weight))

    def step_kernel(self, name: str) -> Kernel:
        """The kernel; it needs room in the result for all vectors, as long as they are padded."""
        arguments = ("_x", "_u", "_constants", "_result", "_kernels")
        kernel = self.kernel(name, arguments)
        x, u, constants, _, kernels = kernel.sizes
        return replace(kernel, sizes=(x, u, constants, self.used, kernels))


def _total(terms: Sequence[Value]) -> Value:
    return sum(terms[1:], terms[0])


@lru_cache(maxsize=8)
def exponential_step(frame: Frame, inputs: int) -> Kernel:
    """A step of `etdrk4`: first argument (y, f, both a step before, numbers, inputs of two stages).

    The numbers are h, stretch, three weights of the quadrature and the share of the defect; the
    second argument the tables of the step.  Result: (new, rates there, error).
    """
    step = _Step(frame, etdrk4.ARGUMENTS, len(etdrk4.NUMBERS))
    n, (h, stretch, at_past, at_half, at_end, share) = step.n, step.scalars
    for name in RESULTS:
        step.at(name)

    def product(to: str, table: int, vector: str) -> None:
        step.product(to, table, vector, etdrk4.AT_ZERO[table])

    against, half_h = step.let(-stretch), step.let(0.5 * h)
    step.enter("f1", "f")
    product("half", etdrk4.HALF_FIRST, "f1")
    product("full", etdrk4.FIRST, "f1")
    step.sum("v", (h, "half"))
    for k in range(4):
        if k == 1:
            product("p", etdrk4.HALF_SECOND, "d0")
            step.sum("v", (h, "half"), (h, "p"))
        elif k == 2:
            product("p", etdrk4.SECOND, "d1")
            step.sum("v", (h, "full"), (h, "p"))
        elif k == 3:
            step.sum("both", (1.0, "d0"), (1.0, "d1"))
            product("p", etdrk4.MIDDLE, "both")
            product("q", etdrk4.LAST, "d2")
            step.sum("v", (h, "full"), (h, "p"), (h, "q"))
        product("p", etdrk4.JACOBIAN, "v")
        state = "new" if k == 3 else "middle"
        step.leave(state, "v", "y")
        step.rates(state, 0 if k < 2 else inputs, "rates")
        step.enter("entered", "rates")
        step.sum(f"d{k}", (1.0, "entered"), (-1.0, "f1"), (against, "p"))
    step.sum("middle", (1.0, "y"), (-1.0, "y_past"), n=n)
    step.enter("moved", "middle")
    product("p", etdrk4.JACOBIAN, "moved")
    step.sum("middle", (1.0, "f"), (-1.0, "f_past"), n=n)
    step.enter("changed", "middle")
    pair, weight_half = step.let(h * etdrk4.ERROR_SHARE), step.let(half_h * at_half)
    weight_end, weight_past = step.let(h * at_end), step.let(h * at_past)
    weight_linear, share_half = step.let(weight_past * against), step.let(-0.5 * share)
    share_linear = step.let(0.125 * share * stretch * h)
    change = ((pair, "d3"), (-pair, "d2"), (weight_half, "both"), (weight_end, "d3"))
    step.sum("v", *change, (weight_past, "changed"), (weight_linear, "p"))
    product("q", etdrk4.LAST, "v")
    product("p", etdrk4.JACOBIAN, "full")
    step.sum("v", (share, "half"), (share_half, "full"), (share_linear, "p"))
    step.leave("middle", "q")
    step.leave("error", "v")
    for i in range(n):
        one, other = (step.entry(*step.at(name, i)) for name in ("error", "middle"))
        step.store(step.at("error", i)[1], abs(one) + abs(other))
    return step.step_kernel("etdrk4_step")
