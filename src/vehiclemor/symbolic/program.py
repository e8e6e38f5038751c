"""Optimised straight-line programs: common subexpressions named once, parameter terms hoisted.

A program holds several functions over the same arguments.  What depends on parameters alone is
moved into one further function, `constants`, which runs once for a parameter set; the functions
that run at every time point read its results.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import sympy as sp

from vehiclemor.symbolic.tape import Tape, dependencies, free_symbols

Assignments = tuple[tuple[sp.Symbol, sp.Expr], ...]


@dataclass(frozen=True)
class Function:
    """Straight-line function: assignments in order, then results of a fixed shape."""

    assignments: Assignments
    results: tuple[sp.Expr, ...]
    shape: tuple[int, ...]


@dataclass(frozen=True)
class Program:
    """Functions over named arguments, with the constants that parameters determine.

    Attributes
    ----------
    arguments
        Argument name -> its scalar symbols, in order; the arguments of every function.
    parameters
        Symbols of the parameters, the argument of `constants`.
    constants
        The function that computes the hoisted constants from the parameters; its results are the
        symbols by which the others know them.
    functions
        Name -> function.
    """

    arguments: dict[str, tuple[sp.Symbol, ...]]
    parameters: tuple[sp.Symbol, ...]
    constants: Function
    functions: dict[str, Function]


def assemble(
    tape: Tape,
    arguments: Mapping[str, Sequence[sp.Symbol]],
    parameters: Sequence[sp.Symbol],
    results: Mapping[str, tuple[Sequence[sp.Expr], tuple[int, ...]]],
) -> Program:
    """Optimise the tape for a set of results.

    Parameters
    ----------
    tape
        Definitions of all intermediate results.
    arguments
        Argument name -> scalar symbols that change from call to call.
    parameters
        Scalar symbols that are constant over a run.
    results
        Function name -> (expressions, shape of the result in row-major order).

    Raises
    ------
    ValueError
        If a name of the model begins with an underscore: those are the generated names.  If results
        are no real expressions of the arguments and parameters, or don't fill their shape.
    """
    _check_names([*parameters, *(s for group in arguments.values() for s in group)])
    parameter_set = frozenset(parameters)
    results = {name: (_sympified(name, *result), result[1]) for name, result in results.items()}
    wanted = [expression for expressions, _ in results.values() for expression in expressions]
    definitions = tape.definitions
    order = dependencies(wanted, definitions)
    definitions, wanted = _share([(s, definitions[s]) for s in order], wanted)

    constant_definitions: dict[sp.Symbol, sp.Expr] = {}
    varying: dict[sp.Symbol, sp.Expr] = {}
    hoisted = _Hoisting(set(parameter_set), constant_definitions)
    for symbol in dependencies(wanted, definitions):
        expression = definitions[symbol]
        if expression.free_symbols <= hoisted.constant:
            constant_definitions[symbol] = expression
            hoisted.constant.add(symbol)
        else:
            varying[symbol] = hoisted.rewrite(expression)
    wanted = [hoisted.rewrite(expression) for expression in wanted]

    functions: dict[str, Function] = {}
    position = 0
    for name, (expressions, shape) in results.items():
        part = tuple(wanted[position : position + len(expressions)])
        position += len(expressions)
        used = dependencies(part, varying)
        functions[name] = Function(tuple((s, varying[s]) for s in used), part, shape)

    known = {symbol for group in arguments.values() for symbol in group} | varying.keys()
    read: dict[sp.Symbol, None] = {}
    for function in functions.values():
        for expression in [e for _, e in function.assignments] + list(function.results):
            for symbol in free_symbols(expression):
                if symbol in constant_definitions or symbol in parameter_set:
                    read[symbol] = None
                elif symbol not in known:
                    raise ValueError(f"{symbol} is neither an argument nor a parameter")
    symbols = tuple(read)
    constants = Function(
        tuple((s, constant_definitions[s]) for s in dependencies(symbols, constant_definitions)),
        symbols,
        (len(symbols),),
    )
    return Program(
        {name: tuple(symbols) for name, symbols in arguments.items()},
        tuple(parameters),
        constants,
        functions,
    )


def _check_names(symbols: Sequence[sp.Symbol]) -> None:
    for symbol in symbols:
        if symbol.name.startswith("_"):
            raise ValueError(f"{symbol.name}: names that begin with an underscore are reserved")


def _sympified(name: str, expressions: Sequence[object], shape: tuple[int, ...]) -> list[sp.Expr]:
    """Results of a function as expressions; plain numbers become SymPy's."""
    results = [sp.sympify(expression) for expression in expressions]
    if len(results) != math.prod(shape):
        raise ValueError(f"{name} has {len(results)} results, its shape {shape} another number")
    for expression in results:
        if not isinstance(expression, sp.Expr) or expression.has(
            sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I
        ):
            raise ValueError(f"{name}: {expression} is no real number")
    return cast("list[sp.Expr]", results)


def _share(
    assignments: list[tuple[sp.Symbol, sp.Expr]], wanted: list[sp.Expr]
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr]]:
    """Common subexpression elimination over all definitions and results together."""
    names = sp.numbered_symbols("_w", real=True)
    expressions = [expression for _, expression in assignments] + wanted
    shared, reduced = cast(
        "tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]",
        sp.cse(expressions, symbols=names, order="none"),
    )
    # What holds or not is no number: conditions stay where they are asked.
    definitions: dict[sp.Symbol, Any] = {}
    conditions: dict[Any, Any] = {}
    for symbol, expression in shared:
        number_or_not = expression.xreplace(conditions)
        kind = definitions if isinstance(number_or_not, sp.Expr) else conditions
        kind[symbol] = number_or_not
    complete: list[Any] = [expression.xreplace(conditions) for expression in reduced]
    definitions.update(zip((s for s, _ in assignments), complete, strict=False))
    return definitions, complete[len(assignments) :]


class _Hoisting:
    """Replaces the parameter-only factors and terms of an expression by constants."""

    def __init__(self, constant: set[sp.Symbol], definitions: dict[sp.Symbol, sp.Expr]) -> None:
        self.constant = constant
        self._definitions = definitions
        self._known: dict[sp.Expr, sp.Symbol] = {}

    def _constant(self, expression: sp.Expr) -> sp.Expr:
        if expression.is_Atom:
            return expression
        symbol = self._known.get(expression)
        if symbol is None:
            symbol = sp.Symbol(f"_h{len(self._known)}", real=True)
            self._known[expression] = symbol
            self._definitions[symbol] = expression
            self.constant.add(symbol)
        return symbol

    def rewrite(self, expression: sp.Expr) -> sp.Expr:
        """Expression with every maximal parameter-only part replaced by one symbol."""
        if expression.is_Atom:
            return expression
        if not isinstance(expression, sp.Expr):
            return expression.func(*map(self.rewrite, expression.args))
        if expression.free_symbols and expression.free_symbols <= self.constant:
            if (-expression).is_Atom:
                return expression
            return self._constant(expression)
        arguments = cast("tuple[sp.Expr, ...]", expression.args)
        if expression.is_Add or expression.is_Mul:
            fixed = [a for a in arguments if a.free_symbols <= self.constant]
            symbolic = any(a.free_symbols for a in fixed)
            if symbolic and len(fixed) > 1 and not (len(fixed) == 2 and -1 in fixed):
                rest = [self.rewrite(a) for a in arguments if a not in fixed]
                return expression.func(self._constant(expression.func(*fixed)), *rest)
        return expression.func(*[self.rewrite(a) for a in arguments])
