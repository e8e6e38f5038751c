"""Order of a kernel's assignments that lets elementary functions be evaluated in batches.

A tire formula at four wheels needs dozens of arctangents, sines and cosines; one call each would
cost more than all the rest.  So assignments are put off until as many arguments as possible are
known, and these are handed to one vector loop.
"""

from dataclasses import dataclass
from typing import cast

import sympy as sp

from vehiclemor.symbolic.program import Function

# Functions that have a vector loop -> the calls that it answers.
BATCHED: dict[str, tuple[type, ...]] = {"sincos": (sp.sin, sp.cos), "atan": (sp.atan,)}


@dataclass(frozen=True)
class Batch:
    """Evaluation of `sincos` or `atan` for several arguments at once."""

    name: str
    arguments: tuple[sp.Symbol, ...]


Step = tuple[sp.Symbol, sp.Expr] | Batch


def calls(expression: sp.Expr) -> list[tuple[str, sp.Symbol]]:
    """Batched functions that an expression calls, with their arguments."""
    found: dict[tuple[str, sp.Symbol], None] = {}
    for name, kinds in BATCHED.items():
        for call in sorted(expression.atoms(*kinds), key=str):
            argument = call.args[0]
            if not isinstance(argument, sp.Symbol):
                raise ValueError(f"{call}: name the argument on the tape first")
            found[name, argument] = None
    return list(found)


def schedule(function: Function) -> list[Step]:
    """Assignments and batches in an order in which every argument is known when it is needed."""
    pending = list(function.assignments)
    assigned = {symbol for symbol, _ in pending}
    waiting = {symbol: set(expression.free_symbols) & assigned for symbol, expression in pending}
    called = {symbol: calls(expression) for symbol, expression in pending}
    at_end = [call for result in function.results for call in calls(result)]
    known: set[sp.Symbol] = set()
    done: set[tuple[str, sp.Symbol]] = set()
    steps: list[Step] = []
    while True:
        left = []
        for symbol, expression in pending:
            ready = waiting[symbol] <= known and all(call in done for call in called[symbol])
            if ready:
                steps.append((symbol, expression))
                known.add(symbol)
            else:
                left.append((symbol, expression))
        pending = left
        wanted = [call for symbol, _ in pending for call in called[symbol]] + at_end
        for name in BATCHED:
            arguments = tuple(
                dict.fromkeys(
                    cast("sp.Symbol", argument)
                    for kind, argument in wanted
                    if kind == name
                    and (kind, argument) not in done
                    and (argument not in assigned or argument in known)
                )
            )
            if arguments:
                steps.append(Batch(name, arguments))
                done |= {(name, argument) for argument in arguments}
        if not pending and all(call in done for call in at_end):
            return steps
