"""Sums with rows of weights, and statements on vectors, as instructions.

A kernel of a regression multiplies dozens of features by the coefficients of a handful of targets.
Written as scalars, nearly all of its time is spent there.  The statement

    a, b, c = weighted_sums(_constants, 7, (f0, f1, ...))

gives a = sum_j _constants[7 + width j] f_j, b = sum_j _constants[8 + width j] f_j, and so on; rows
of coefficients are padded to `width`, a multiple of the vectors' length.

Steps of integrators have statements on vectors in their arrays.  A vector is named by its first
entry, `_result[7]`; sizes and indices are integers.

    combine(to, n, a, x, b, y, ...)        to = a x + b y + ...; a, b are floats
    product(to, n, rows, x, columns, diagonal, a)  to = sum_j rows[j] x[columns[j]] + a x, a x only
                                           at the indices in diagonal
    execute(kernels, x, u, constants, to)  the first kernel of a list of addresses

Vectors of a product are padded, n = `padded(n)`.  Products of the same layout share a function.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.llvm_arithmetic import DOUBLE, FLAGS, VECTOR
from vehiclemor.codegen.operations import WIDTH, padded

WORD = ir.IntType(64)
POINTER = DOUBLE.as_pointer()
# Partial sums that take terms in turn, so that no addition waits for the previous one.
CHAINS = 2
# Sums that one loop over terms accumulates.
AT_ONCE = 12


def weighted_sums(
    builder: Any, coefficients: Any, terms: Iterable[Any], targets: int
) -> list[ir.Value]:
    """Write the sums; coefficients are rows of `padded(targets)` floats, one for each term."""
    chains: list[list[Any]] = [[None] * (padded(targets) // WIDTH) for _ in range(CHAINS)]
    totals = _added(builder, coefficients, terms, chains)
    lane = [ir.Constant(ir.IntType(32), k) for k in range(WIDTH)]
    return [builder.extract_element(totals[i // WIDTH], lane[i % WIDTH]) for i in range(targets)]


def _added(
    builder: Any, rows: Any, factors: Iterable[Any], chains: Sequence[list[Any]]
) -> list[Any]:
    """Total of rows times factors; chains of partial sums, by vector, take the terms in turn."""

    def add(sums: list[Any], v: int, part: Any) -> None:
        sums[v] = part if sums[v] is None else builder.fadd(sums[v], part, flags=FLAGS)

    for j, factor in enumerate(factors):
        wide, sums = spread(builder, factor), chains[j % len(chains)]
        for v in range(len(sums)):
            row = _load(builder, rows, (j * len(sums) + v) * WIDTH, VECTOR)
            add(sums, v, builder.fmul(row, wide, flags=FLAGS))
    total, *others = chains
    for other in others:
        for v, part in enumerate(other):
            if part is not None:
                add(total, v, part)
    return total


def sums_of_lanes(
    builder: Any, coefficients: Any, terms: Iterable[Any], targets: int
) -> list[ir.Value]:
    """Sums of terms that are vectors of samples, in loops: straight-line code compiles slowly."""
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
        columns = range(first, min(first + AT_ONCE, targets))
        sums = [builder.phi(kind) for _ in columns]
        row = builder.mul(j, word(padded(targets)))
        factor = builder.load(builder.gep(stored, [j]))
        for i, total in zip(columns, sums, strict=True):
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
    """A vector with the same value in all lanes."""
    undefined = ir.Constant(ir.VectorType(DOUBLE, width), ir.Undefined)
    single = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    first = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
    return builder.shuffle_vector(single, undefined, first)


def write(name: str, builder: Any, arguments: Sequence[Any], factors: Sequence[Any]) -> None:
    """Write a statement; arguments as above, vectors as pointers, factors apart."""
    match name, arguments:
        case "combine", [to, n, *vectors]:
            _combine(builder, to, n, factors, vectors)
        case "product", [to, n, rows, x, *shape]:
            builder.call(_product(builder.module, n, *shape), [to, rows, x])
        case "execute", [kernels, *pointers]:
            kind = ir.FunctionType(ir.VoidType(), [POINTER] * len(pointers))
            first = builder.load(builder.bitcast(kernels, WORD.as_pointer()))
            builder.call(builder.inttoptr(first, kind.as_pointer()), pointers, attrs=("nounwind",))


def _parts(n: int) -> list[tuple[int, Any]]:
    """First index and type of the parts in which a vector of n floats is loaded."""
    rest = n // WIDTH * WIDTH
    vectors: list[tuple[int, Any]] = [(index, VECTOR) for index in range(0, rest, WIDTH)]
    return vectors + [(index, DOUBLE) for index in range(rest, n)]


def _at(builder: Any, pointer: Any, index: int, kind: ir.Type) -> Any:
    moved = builder.gep(pointer, [WORD(index)])
    return moved if kind == DOUBLE else builder.bitcast(moved, kind.as_pointer())


def _load(builder: Any, pointer: Any, index: int, kind: ir.Type) -> Any:
    return builder.load(_at(builder, pointer, index, kind), align=8)


def _store(builder: Any, value: Any, pointer: Any, index: int) -> None:
    builder.store(value, _at(builder, pointer, index, value.type), align=8)


def _combine(builder: Any, to: Any, n: int, factors: Sequence[Any], vectors: Sequence[Any]) -> None:
    spread_factors = [spread(builder, factor) for factor in factors]
    for index, kind in _parts(n):
        total = None
        multipliers = factors if kind == DOUBLE else spread_factors
        for multiplier, pointer in zip(multipliers, vectors, strict=True):
            part = _load(builder, pointer, index, kind)
            part = builder.fmul(multiplier, part, flags=FLAGS)
            total = part if total is None else builder.fadd(total, part, flags=FLAGS)
        _store(builder, total, to, index)


def _product(
    module: Any, n: int, columns: Sequence[int], diagonal: Sequence[int], weight: float
) -> Any:
    """The function of a product, written once in a module."""
    name = f"product {n} {columns} {diagonal} {weight}"
    if name in module.globals:
        return module.globals[name]
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [POINTER] * 3), name)
    function.linkage = "internal"
    for attribute in ("nounwind", "noinline"):
        function.attributes.add(attribute)
    to, rows, x = function.args
    builder: Any = ir.IRBuilder(function.append_basic_block())
    vectors = n // WIDTH
    # Two partial sums in turn for short vectors: no addition waits for the previous one.
    chains: list[list[Any]] = [[None] * vectors for _ in range(2 if vectors <= 4 else 1)]
    for v in range(vectors):
        mask = [weight * (v * WIDTH + lane in diagonal) for lane in range(WIDTH)]
        if any(mask):
            first = _load(builder, x, v * WIDTH, VECTOR)
            chains[0][v] = builder.fmul(first, ir.Constant(VECTOR, mask), flags=FLAGS)
    factors = (builder.load(builder.gep(x, [WORD(column)])) for column in columns)
    sums = _added(builder, rows, factors, chains)
    totals = [ir.Constant(VECTOR, [0.0] * WIDTH) if t is None else t for t in sums]
    for v, total in enumerate(totals):
        _store(builder, total, to, v * WIDTH)
    builder.ret_void()
    return function
