"""Sums of many terms with the same weights' layout, and statements on vectors, as instructions.

A kernel of a regression multiplies dozens of features by the coefficients of a handful of targets.
Written out as scalars that is the whole cost of it.  The statement

    a, b, c = weighted_sums(_constants, 7, (f0, f1, ...))

gives a = sum_j _constants[7 + width j] f_j, b the same one place further on, and so on; rows of
coefficients are padded to `width`, a multiple of the vectors' length.

Steps of integrators have statements on whole vectors in their arrays.  A vector is given by its
first place, `_result[7]`; sizes and places are whole numbers.

    combine(to, n, a, x, b, y, ...)        to = a x + b y + ...; a, b are floats
    product(to, n, rows, x, columns, kept, a)  to = sum_j rows[j] x[columns[j]] + a x, a x only at
                                           places in kept
    execute(kernels, x, u, constants, to)  the first kernel of a list of addresses

Vectors of a product have whole lanes, n = `padded(n)`; it is a function of its own, called wherever
it is needed.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.llvm_arithmetic import DOUBLE, FLAGS, VECTOR
from vehiclemor.codegen.vector_lanes import WIDTH, padded

WORD = ir.IntType(64)
POINTER = DOUBLE.as_pointer()
# Sums in turn, so that no addition waits for the one before it.
CHAINS = 2
# Sums of lanes that a loop makes at once.
AT_ONCE = 12


def weighted_sums(
    builder: Any, coefficients: Any, terms: Iterable[Any], targets: int
) -> list[ir.Value]:
    """Write the sums; coefficients are rows of `padded(targets)` floats, one for each term."""
    chains: list[list[Any]] = [[None] * (padded(targets) // WIDTH) for _ in range(CHAINS)]
    totals = _added(builder, coefficients, terms, chains)
    lane = [ir.Constant(ir.IntType(32), place) for place in range(WIDTH)]
    return [builder.extract_element(totals[i // WIDTH], lane[i % WIDTH]) for i in range(targets)]


def _added(
    builder: Any, rows: Any, factors: Iterable[Any], chains: Sequence[list[Any]]
) -> list[Any]:
    """Rows of whole vectors times factors, added to sums in turn; the total of these."""

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


def write(name: str, builder: Any, arguments: Sequence[Any], factors: Sequence[Any]) -> None:
    """Write a statement; arguments are as above, pointers for vectors, without factors."""
    match name, arguments:
        case "combine", [to, n, *places]:
            _combine(builder, to, n, factors, places)
        case "product", [to, n, rows, x, *shape]:
            builder.call(_product(builder.module, n, *shape), [to, rows, x])
        case "execute", [kernels, *pointers]:
            kind = ir.FunctionType(ir.VoidType(), [POINTER] * len(pointers))
            first = builder.load(builder.bitcast(kernels, WORD.as_pointer()))
            builder.call(builder.inttoptr(first, kind.as_pointer()), pointers, attrs=("nounwind",))


def _parts(n: int) -> list[tuple[int, Any]]:
    """First places and types of what a vector of n floats is taken in."""
    whole = n // WIDTH * WIDTH
    vectors: list[tuple[int, Any]] = [(place, VECTOR) for place in range(0, whole, WIDTH)]
    return vectors + [(place, DOUBLE) for place in range(whole, n)]


def _at(builder: Any, pointer: Any, place: int, kind: ir.Type) -> Any:
    moved = builder.gep(pointer, [WORD(place)])
    return moved if kind == DOUBLE else builder.bitcast(moved, kind.as_pointer())


def _load(builder: Any, pointer: Any, place: int, kind: ir.Type) -> Any:
    return builder.load(_at(builder, pointer, place, kind), align=8)


def _store(builder: Any, value: Any, pointer: Any, place: int) -> None:
    builder.store(value, _at(builder, pointer, place, value.type), align=8)


def _combine(builder: Any, to: Any, n: int, factors: Sequence[Any], places: Sequence[Any]) -> None:
    wide = [spread(builder, factor) for factor in factors]
    for place, kind in _parts(n):
        total = None
        for one, many, pointer in zip(factors, wide, places, strict=True):
            part = _load(builder, pointer, place, kind)
            part = builder.fmul(one if kind == DOUBLE else many, part, flags=FLAGS)
            total = part if total is None else builder.fadd(total, part, flags=FLAGS)
        _store(builder, total, to, place)


def _product(
    module: Any, n: int, columns: Sequence[int], kept: Sequence[int], weight: float
) -> Any:
    """The function of a product, written once in a module."""
    name = f"product {n} {columns} {kept} {weight}"
    if name in module.globals:
        return module.globals[name]
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [POINTER] * 3), name)
    function.linkage = "internal"
    for attribute in ("nounwind", "noinline"):
        function.attributes.add(attribute)
    to, rows, x = function.args
    builder: Any = ir.IRBuilder(function.append_basic_block())
    vectors = n // WIDTH
    # Two sums in turn where few stand beside one another: no addition waits for the one before.
    chains: list[list[Any]] = [[None] * vectors for _ in range(2 if vectors <= 4 else 1)]
    for v in range(vectors):
        mask = [weight * (v * WIDTH + lane in kept) for lane in range(WIDTH)]
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
