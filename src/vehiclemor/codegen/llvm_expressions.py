"""Expressions of straight-line kernels as LLVM instructions of floats, or of vectors of floats."""

import ast
import inspect
from collections.abc import Callable, Sequence
from functools import cache
from types import ModuleType
from typing import Any

from llvmlite import ir

from vehiclemor.codegen import arctangent, exponential, sincos
from vehiclemor.codegen.weighted_sums import DOUBLE, FLAGS

# A float plus this has no digits after the point.
SHIFT = 1.5 * 2.0**52
LANE = ir.IntType(32)
SOURCES: dict[str, ModuleType] = {
    "sincos": sincos,
    "atan": arctangent,
    "exp": exponential,
}
LLVM_FUNCTIONS = {
    "math.sqrt": "llvm.sqrt",
    "math.log": "llvm.log",
    "math.sin": "llvm.sin",
    "math.cos": "llvm.cos",
    "math.fabs": "llvm.fabs",
    "abs": "llvm.fabs",
    "np.abs": "llvm.fabs",
    "np.floor": "llvm.floor",
}
# Functions of the C library, with as many arguments as Python's.
LIBRARY = ("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")
COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}


class Expressions:
    """Writes the instructions of expressions of floats, or of vectors of floats."""

    def __init__(self, builder: Any) -> None:
        self._builder = builder

    def value(self, node: ast.expr, names: Callable[[ast.expr], Any], kind: ir.Type) -> Any:
        """Value of an expression; `names` gives those of its names and array entries."""
        match node:
            case ast.Constant(value=float() as number):
                return _constant(kind, number)
            case ast.Name() | ast.Subscript():
                return names(node)
            case ast.BinOp(left, operator, right):
                left = self.value(left, names, kind)
                right = self.value(right, names, kind)
                return self._binary(node, operator, left, right)
            case ast.UnaryOp(ast.USub(), ast.Constant(value=float() as number)):
                return _constant(kind, -number)
            case ast.UnaryOp(ast.USub(), operand):
                return self._builder.fneg(self.value(operand, names, kind), flags=FLAGS)
            case ast.IfExp(test, body, orelse):
                return self._builder.select(
                    self.value(test, names, kind),
                    self.value(body, names, kind),
                    self.value(orelse, names, kind),
                )
            case ast.Compare(left, [operator], [right]) if type(operator) in COMPARISONS:
                # An inequality holds where one side is not a number; other comparisons don't.
                unordered = isinstance(operator, ast.NotEq)
                compare = self._builder.fcmp_unordered if unordered else self._builder.fcmp_ordered
                return compare(
                    COMPARISONS[type(operator)],
                    self.value(left, names, kind),
                    self.value(right, names, kind),
                )
            case ast.Call(function, arguments, []):
                return self._call(
                    node, ast.unparse(function), [self.value(a, names, kind) for a in arguments]
                )
        raise ValueError(f"{ast.unparse(node)}: {type(node).__name__} is not straight-line")

    def elementary(self, name: str, argument: Any) -> tuple[Any, ...]:
        """Results of `sincos` or `atan` of a float or a vector, from the text of the function."""
        constants, function = _elementary(name)
        values: dict[str, Any] = {function.args.args[0].arg: argument}

        def read(node: ast.expr) -> Any:
            if isinstance(node, ast.Name) and node.id in values:
                return values[node.id]
            if isinstance(node, ast.Name) and node.id in constants:
                return _constant(argument.type, constants[node.id])
            raise ValueError(f"{ast.unparse(node)}: unknown in {name}")

        for statement in function.body:
            match statement:
                case ast.Assign([ast.Name(target)], expression):
                    values[target] = self.value(expression, read, argument.type)
                case ast.Return(ast.Tuple(elements)):
                    return tuple(self.value(e, read, argument.type) for e in elements)
                case ast.Return(ast.expr() as expression):
                    return (self.value(expression, read, argument.type),)
                case _:
                    raise ValueError(f"{ast.unparse(statement)}: not straight-line")
        raise ValueError(f"{name} returns nothing")

    def _binary(self, node: ast.expr, operator: ast.operator, left: Any, right: Any) -> Any:
        match operator:
            case ast.Add():
                return self._builder.fadd(left, right, flags=FLAGS)
            case ast.Sub():
                return self._builder.fsub(left, right, flags=FLAGS)
            case ast.Mult():
                return self._builder.fmul(left, right, flags=FLAGS)
            case ast.Div():
                return self._builder.fdiv(left, right, flags=FLAGS)
            case ast.Pow():
                power = _function(self._builder, "llvm.pow", left.type, left.type)
                return self._builder.call(power, [left, right])
        raise ValueError(f"{ast.unparse(node)}: {type(operator).__name__} is not straight-line")

    def _call(self, node: ast.expr, name: str, arguments: list[Any]) -> Any:
        if name in LLVM_FUNCTIONS and len(arguments) == 1:
            kind = arguments[0].type
            return self._builder.call(
                _function(self._builder, LLVM_FUNCTIONS[name], kind), arguments
            )
        if name in {"atan", "math.exp"} and len(arguments) == 1:
            return self.elementary(name.removeprefix("math."), arguments[0])[0]
        if name == "power_of_two" and len(arguments) == 1:
            return self._power_of_two(arguments[0])
        if name.removeprefix("math.") in LIBRARY and name.startswith("math."):
            return self._library(name.removeprefix("math."), arguments)
        raise ValueError(f"{ast.unparse(node)}: {name} is not straight-line")

    def _library(self, name: str, arguments: list[Any]) -> Any:
        builder, kind = self._builder, arguments[0].type
        function = _declared(builder, name, DOUBLE, [DOUBLE] * len(arguments))
        if kind == DOUBLE:
            return builder.call(function, arguments)
        results = ir.Constant(kind, ir.Undefined)
        for lane in range(kind.count):
            single = [builder.extract_element(a, LANE(lane)) for a in arguments]
            single = builder.call(function, single)
            results = builder.insert_element(results, single, LANE(lane))
        return results

    def _power_of_two(self, number: Any) -> Any:
        # The last bits of the sum are the whole number, also a negative one.
        builder, whole = self._builder, ir.IntType(64)
        if number.type != DOUBLE:
            whole = ir.VectorType(whole, number.type.count)
        bits = builder.bitcast(builder.fadd(number, _constant(number.type, SHIFT)), whole)
        biased = builder.add(bits, _whole(whole, 1023))
        return builder.bitcast(builder.shl(biased, _whole(whole, 52)), number.type)


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


def _constant(kind: Any, number: float) -> ir.Constant:
    return ir.Constant(kind, number if kind == DOUBLE else [number] * kind.count)


def _whole(kind: Any, number: int) -> ir.Constant:
    return ir.Constant(kind, number if kind == ir.IntType(64) else [number] * kind.count)


@cache
def _elementary(name: str) -> tuple[dict[str, float], ast.FunctionDef]:
    """Constants of an elementary function's module, and the function without its docstring."""
    module = SOURCES[name]
    tree = ast.parse(inspect.getsource(module))
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == name)
    function.body = function.body[1:]
    return {k: v for k, v in vars(module).items() if isinstance(v, float)}, function
