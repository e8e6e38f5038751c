"""Arithmetic and elementary functions as LLVM instructions of floats, or of vectors of floats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen.elementary import elementary_operations
from vehiclemor.codegen.operations import COMPARISONS, WIDTH

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
