"""Straight-line functions run over the values of other systems: symbols, or arrays of a batch."""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

from vehiclemor.exporting.straight_line import StraightLine

OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


def _itself(value: Any) -> Any:
    return value


def evaluated(
    function: StraightLine,
    arrays: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
    let: Callable[[Any], Any] = _itself,
) -> list[Any]:
    """Results of a function.

    Parameters
    ----------
    arrays
        Name -> values of its entries, by number.
    functions
        Name -> what computes it, see `straight_line.FUNCTIONS`.
    let
        Value of an assignment -> what stands for it from there on.
    """
    known: dict[str, Any] = {}
    functions = {"pow": operator.pow, **functions}

    def value(node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=number):
                return number
            case ast.Name(name):
                return known[name]
            case ast.Subscript(ast.Name(array), ast.Constant(place)):
                return arrays[array][place]
            case ast.BinOp(left, kind, right) | ast.Compare(left, [kind], [right]):
                return OPERATORS[type(kind)](value(left), value(right))
            case ast.UnaryOp(ast.USub(), operand):
                return -value(operand)
            case ast.Call(ast.Name(name), arguments):
                return functions[name](*map(value, arguments))
        raise ValueError(f"{ast.unparse(node)}: not straight-line")

    for name, expression in function.assignments.items():
        known[name] = let(value(expression))
    return [value(expression) for expression in function.results]
