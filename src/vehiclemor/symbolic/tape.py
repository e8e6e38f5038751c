"""A tape: named intermediate results in single-assignment form over SymPy scalars.

A multibody model written as one nested expression per equation grows without bound, and so do its
derivatives.  On a tape every intermediate result along the kinematic chain gets a symbol, so that
expressions stay short and derivatives follow by the chain rule, entry by entry.
"""

from collections.abc import Iterable, Sequence
from typing import cast

import sympy as sp


class Tape:
    """Ordered single-assignment list of intermediate results.

    Derivatives are accumulated forwards: Griewank and Walther, *Evaluating Derivatives* (2nd ed.,
    SIAM 2008), chapter 3.
    """

    def __init__(self) -> None:
        self._definitions: dict[sp.Symbol, sp.Expr] = {}
        self._symbols: dict[sp.Expr, sp.Symbol] = {}

    @property
    def definitions(self) -> dict[sp.Symbol, sp.Expr]:
        """Symbol -> defining expression, in order of definition."""
        return dict(self._definitions)

    def let(self, expression: sp.Expr | float) -> sp.Expr:
        """The symbol that stands for an expression in earlier symbols and free ones.

        Numbers, symbols and negated symbols stay as they are: a name would only cost a line.
        """
        expression = sp.sympify(expression)
        if expression.is_Atom:
            return expression
        known = self._symbols.get(expression)
        if known is not None:
            return known
        negative = -expression
        if negative.is_Atom:
            return expression
        negated = self._symbols.get(negative)
        if negated is not None:
            return -negated
        symbol = sp.Symbol(f"_v{len(self._definitions)}", real=True)
        self._definitions[symbol] = expression
        self._symbols[expression] = symbol
        return symbol

    def jacobian(
        self, expressions: Sequence[sp.Expr], variables: Sequence[sp.Symbol]
    ) -> list[list[sp.Expr]]:
        """Analytic derivatives (m x n) of m expressions with respect to n free symbols."""
        derivatives: dict[sp.Symbol, dict[int, sp.Expr]] = {
            variable: {column: sp.Integer(1)} for column, variable in enumerate(variables)
        }
        for symbol in dependencies(expressions, self._definitions):
            row = self._chain_rule(self._definitions[symbol], derivatives)
            if row:
                derivatives[symbol] = row
        rows = [self._chain_rule(sp.sympify(e), derivatives) for e in expressions]
        columns = range(len(variables))
        return [[row.get(column, sp.Integer(0)) for column in columns] for row in rows]

    def _chain_rule(
        self, expression: sp.Expr, derivatives: dict[sp.Symbol, dict[int, sp.Expr]]
    ) -> dict[int, sp.Expr]:
        total: dict[int, sp.Expr] = {}
        for argument in free_symbols(expression):
            inner = derivatives.get(argument)
            if not inner:
                continue
            outer = expression.diff(argument)
            for column, derivative in inner.items():
                total[column] = total.get(column, sp.Integer(0)) + outer * derivative
        return {column: self.let(value) for column, value in total.items() if value != 0}


def free_symbols(expression: sp.Expr) -> list[sp.Symbol]:
    """Free symbols of an expression, sorted by name."""
    return sorted(cast("set[sp.Symbol]", expression.free_symbols), key=lambda symbol: symbol.name)


def dependencies(
    expressions: Iterable[sp.Expr], definitions: dict[sp.Symbol, sp.Expr]
) -> list[sp.Symbol]:
    """Symbols that the expressions depend on, each after those it depends on itself."""
    order: dict[sp.Symbol, None] = {}
    # Without recursion: chains of definitions may be longer than Python allows.
    pending: list[tuple[sp.Symbol, bool]] = []
    for expression in expressions:
        wanted = free_symbols(sp.sympify(expression))
        pending += [(symbol, False) for symbol in reversed(wanted)]
        while pending:
            symbol, complete = pending.pop()
            if symbol in order or symbol not in definitions:
                continue
            if complete:
                order[symbol] = None
                continue
            pending.append((symbol, True))
            inner = free_symbols(definitions[symbol])
            pending += [(s, False) for s in reversed(inner)]
    return list(order)
