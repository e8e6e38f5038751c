"""Sums of many terms with the same weights' layout, as vector instructions.

A kernel of a regression multiplies dozens of features by the coefficients of a handful of targets.
Written out as scalars that is the whole cost of it.  The statement

    a, b, c = weighted_sums(_constants, 7, (f0, f1, ...))

gives a = sum_j _constants[7 + width j] f_j, b the same one place further on, and so on; rows of
coefficients are padded to `width`, a multiple of the vectors' length.
"""

from collections.abc import Iterable
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.vector_lanes import WIDTH, padded

FLAGS = ("contract",)
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, WIDTH)
# Sums in turn, so that no addition waits for the one before it.
CHAINS = 2
# Sums of lanes that a loop makes at once.
AT_ONCE = 12


def weighted_sums(
    builder: Any, coefficients: Any, terms: Iterable[Any], targets: int
) -> list[ir.Value]:
    """Write the sums; coefficients are rows of `padded(targets)` floats, one for each term."""
    vectors = padded(targets) // WIDTH
    chains: list[list[Any]] = [[None] * vectors for _ in range(CHAINS)]
    for j, term in enumerate(terms):
        factor = spread(builder, term, WIDTH)
        sums = chains[j % CHAINS]
        for v in range(vectors):
            place = builder.gep(
                coefficients, [ir.Constant(ir.IntType(64), (j * vectors + v) * WIDTH)]
            )
            row = builder.load(builder.bitcast(place, VECTOR.as_pointer()), align=8)
            product = builder.fmul(row, factor, flags=FLAGS)
            before = sums[v]
            sums[v] = product if before is None else builder.fadd(before, product, flags=FLAGS)
    totals = []
    for v in range(vectors):
        parts = [chain[v] for chain in chains if chain[v] is not None]
        total = parts[0]
        for part in parts[1:]:
            total = builder.fadd(total, part, flags=FLAGS)
        totals.append(total)
    lane = [ir.Constant(ir.IntType(32), place) for place in range(WIDTH)]
    return [builder.extract_element(totals[i // WIDTH], lane[i % WIDTH]) for i in range(targets)]


def sums_of_lanes(
    builder: Any, coefficients: Any, terms: Iterable[Any], targets: int
) -> list[ir.Value]:
    """The same where terms are vectors of samples, in loops: written out it compiles slowly."""
    factors = list(terms)
    kind, count, word = factors[0].type, len(factors), ir.IntType(64)
    with builder.goto_entry_block():
        stored = builder.alloca(kind, count)
    for j, factor in enumerate(factors):
        builder.store(factor, builder.gep(stored, [word(j)]))
    totals: list[Any] = []
    for first in range(0, targets, AT_ONCE):
        before, body = builder.block, builder.append_basic_block()
        builder.branch(body)
        builder.position_at_end(body)
        j = builder.phi(word)
        j.add_incoming(word(0), before)
        own = range(first, min(first + AT_ONCE, targets))
        sums = [builder.phi(kind) for _ in own]
        row = builder.mul(j, word(padded(targets)))
        factor = builder.load(builder.gep(stored, [j]))
        for i, total in zip(own, sums, strict=True):
            weight = builder.load(builder.gep(coefficients, [builder.add(row, word(i))]))
            product = builder.fmul(spread(builder, weight, kind.count), factor, flags=FLAGS)
            totals.append(builder.fadd(total, product, flags=FLAGS))
            total.add_incoming(ir.Constant(kind, [0.0] * kind.count), before)
            total.add_incoming(totals[-1], body)
        following = builder.add(j, word(1))
        j.add_incoming(following, body)
        after = builder.append_basic_block()
        builder.cbranch(builder.icmp_unsigned("<", following, word(count)), body, after)
        builder.position_at_end(after)
    return totals


def spread(builder: Any, value: Any, width: int = WIDTH) -> Any:
    """A vector with the same value in all places."""
    nowhere = ir.Constant(ir.VectorType(DOUBLE, width), ir.Undefined)
    single = builder.insert_element(nowhere, value, ir.Constant(ir.IntType(32), 0))
    first = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
    return builder.shuffle_vector(single, nowhere, first)
