"""Operations as LLVM instructions of floats, or of vectors of floats.

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

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.elementary import elementary_operations
from vehiclemor.codegen.operations import COMPARISONS, WIDTH, padded

FLAGS = ("contract",)
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, WIDTH)
# A float plus this has no digits after the point.
SHIFT = 1.5 * 2.0**52
LANE = ir.IntType(32)
INTRINSICS = {name: f"llvm.{name}" for name in ("sqrt", "log", "sin", "cos", "floor")} | {
    "abs": "llvm.fabs"
}
BINARY = {"add": "fadd", "subtract": "fsub", "multiply": "fmul", "divide": "fdiv"}
# Functions of the C library.
LIBRARY = ("tan", "asin", "acos", "atan2", "sinh", "cosh", "tanh")
WORD = ir.IntType(64)
POINTER = DOUBLE.as_pointer()
# Partial sums that take terms in turn, so that no addition waits for the previous one.
CHAINS = 2
# Sums that one loop over terms accumulates.
AT_ONCE = 12


# --- arithmetic and functions ---------------------------------------------------------------------


def arithmetic(builder: Any, kind: str, arguments: Sequence[Any]) -> Any:
    """Write an operation of values of one type, floats or vectors; `ValueError` of other kinds."""
    of = arguments[0].type
    if kind in BINARY:
        return getattr(builder, BINARY[kind])(*arguments, flags=FLAGS)
    if kind == "negate":
        return builder.fneg(*arguments, flags=FLAGS)
    if kind == "select":
        return builder.select(*arguments)
    if kind in COMPARISONS:
        # An inequality holds where one side is not a number; other comparisons don't.
        compare = builder.fcmp_unordered if kind == "!=" else builder.fcmp_ordered
        return compare(kind, *arguments)
    if kind in INTRINSICS:
        return builder.call(_function(builder, INTRINSICS[kind], of), arguments)
    if kind == "power":
        return builder.call(_function(builder, "llvm.pow", of, of), arguments)
    if kind == "power_of_two":
        return _power_of_two(builder, arguments[0])
    if kind in LIBRARY:
        return _library(builder, kind, arguments)
    raise ValueError(f"{kind}: there are no instructions of it")


def constant(kind: Any, number: float) -> ir.Constant:
    """A number as a float, or in all lanes."""
    return ir.Constant(kind, number if kind == DOUBLE else [number] * kind.count)


def elementary(builder: Any, name: str, argument: Any) -> tuple[Any, ...]:
    """Results of a function of this package of a float or a vector."""
    operations, results = elementary_operations(name)
    values = [argument]
    for kind, numbers, detail in operations[1:]:
        if kind == "number":
            values.append(constant(argument.type, detail))
        else:
            values.append(arithmetic(builder, kind, [values[n] for n in numbers]))
    return tuple(values[number] for number in results)


def _library(builder: Any, name: str, arguments: Sequence[Any]) -> Any:
    kind = arguments[0].type
    function = _declared(builder, name, DOUBLE, [DOUBLE] * len(arguments))
    if kind == DOUBLE:
        return builder.call(function, arguments)
    results = ir.Constant(kind, ir.Undefined)
    for lane in range(kind.count):
        single = builder.call(function, [builder.extract_element(a, LANE(lane)) for a in arguments])
        results = builder.insert_element(results, single, LANE(lane))
    return results


def _power_of_two(builder: Any, number: Any) -> Any:
    # The last bits of the sum are the integer, also a negative one.
    integer = ir.IntType(64)
    if number.type != DOUBLE:
        integer = ir.VectorType(integer, number.type.count)
    bits = builder.bitcast(builder.fadd(number, constant(number.type, SHIFT)), integer)
    biased = builder.add(bits, _integer(integer, 1023))
    return builder.bitcast(builder.shl(biased, _integer(integer, 52)), number.type)


def _function(builder: Any, name: str, *kinds: Any) -> Any:
    """An LLVM function of floats or vectors, by its name without the suffix of its type."""
    suffix = "f64" if kinds[0] == DOUBLE else f"v{kinds[0].count}f64"
    return _declared(builder, f"{name}.{suffix}", kinds[0], kinds)


def _declared(builder: Any, name: str, returned: ir.Type, kinds: Sequence[ir.Type]) -> Any:
    """An outside function, declared once in a module."""
    known = builder.module.globals
    if name not in known:
        return ir.Function(builder.module, ir.FunctionType(returned, kinds), name)
    return known[name]


def _integer(kind: Any, number: int) -> ir.Constant:
    return ir.Constant(kind, number if kind == ir.IntType(64) else [number] * kind.count)


# --- sums with rows of weights, and statements on vectors -----------------------------------------


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
