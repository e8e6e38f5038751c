"""Statements of kernels on whole vectors in their arrays, for steps of integrators.

A vector is given by its first place, `_result[7]`; sizes and places are whole numbers.

    combine(to, n, a, x, b, y, ...)        to = a x + b y + ...; a, b are floats
    magnitudes(to, n, x, y)                to = |x| + |y|
    product(to, n, rows, x, columns, kept, a)  to = sum_j rows[j] x[columns[j]] + a x, a x only at
                                           places in kept
    execute(kernels, x, u, constants, to)  the first kernel of a list of addresses

Vectors of a product have whole lanes, n = `padded(n)`; it is a function of its own, called wherever
it is needed.
"""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.llvm_arithmetic import arithmetic
from vehiclemor.codegen.vector_lanes import WIDTH
from vehiclemor.codegen.weighted_sums import DOUBLE, FLAGS, VECTOR, spread

WORD = ir.IntType(64)
POINTER = DOUBLE.as_pointer()


def write(name: str, builder: Any, arguments: Sequence[Any], factors: Sequence[Any]) -> None:
    """Write a statement; arguments are as above, pointers for vectors, without factors."""
    match name, arguments:
        case "combine", [to, n, *places]:
            _combine(builder, to, n, factors, places)
        case "magnitudes", [to, n, *terms]:
            _magnitudes(builder, to, n, terms)
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


def _magnitudes(builder: Any, to: Any, n: int, terms: Sequence[Any]) -> None:
    for place, kind in _parts(n):
        one, other = (
            arithmetic(builder, "abs", [_load(builder, term, place, kind)]) for term in terms
        )
        _store(builder, builder.fadd(one, other, flags=FLAGS), to, place)


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

    def add(sums: list[Any], v: int, part: Any) -> None:
        sums[v] = part if sums[v] is None else builder.fadd(sums[v], part, flags=FLAGS)

    for v in range(vectors):
        mask = [weight * (v * WIDTH + lane in kept) for lane in range(WIDTH)]
        if any(mask):
            first = _load(builder, x, v * WIDTH, VECTOR)
            add(chains[0], v, builder.fmul(first, ir.Constant(VECTOR, mask), flags=FLAGS))
    for j, column in enumerate(columns):
        factor = spread(builder, builder.load(builder.gep(x, [WORD(column)])))
        for v in range(vectors):
            row = _load(builder, rows, j * n + v * WIDTH, VECTOR)
            add(chains[j % len(chains)], v, builder.fmul(row, factor, flags=FLAGS))
    for other in chains[1:]:
        for v, part in enumerate(other):
            if part is not None:
                add(chains[0], v, part)
    totals = [ir.Constant(VECTOR, [0.0] * WIDTH) if t is None else t for t in chains[0]]
    for v, total in enumerate(totals):
        _store(builder, total, to, v * WIDTH)
    builder.ret_void()
    return function
