"""Order of a kernel's assignments that lets elementary functions be evaluated in batches.

A tire formula at four wheels needs dozens of arctangents, sines and cosines; one call each would
cost more than all the rest.  So assignments are put off until as many arguments as possible are
known, and these are handed to one vector loop.  In a batch the same quantity of all wheels stands
side by side: from there the compiler packs what comes before and after into vectors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import cast

import sympy as sp

from vehiclemor.codegen.vector_lanes import WIDTH
from vehiclemor.symbolic.program import Function

# Functions that have a vector loop -> the calls that it answers.
BATCHED: dict[str, tuple[type, ...]] = {"sincos": (sp.sin, sp.cos), "atan": (sp.atan,)}
# Assignments behind one another that tell whether two quantities are computed alike.
DEPTH = 4


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


def _shapes(function: Function) -> dict[sp.Symbol, str]:
    """How symbols are computed, a few assignments deep, whatever from."""
    shapes: dict[sp.Symbol, str] = {}
    for _ in range(DEPTH):
        shapes = {symbol: _shape(expression, shapes) for symbol, expression in function.assignments}
    return shapes


def _shape(expression: sp.Basic, shapes: Mapping[sp.Symbol, str]) -> str:
    """A short name of what is computed; signs and the order of operands don't count."""
    if isinstance(expression, sp.Symbol):
        return shapes.get(expression, "")
    if not expression.args:
        return str(abs(expression)) if isinstance(expression, sp.Number) else str(expression)
    parts = sorted(part for a in expression.args if (part := _shape(a, shapes)) != "1")
    if len(parts) == 1 and isinstance(expression, sp.Mul):
        return parts[0]
    return sha256(f"{type(expression).__name__}({','.join(parts)})".encode()).hexdigest()[:8]


def _alike(
    arguments: Sequence[sp.Symbol], shapes: Mapping[sp.Symbol, str]
) -> tuple[sp.Symbol, ...]:
    """Arguments in an order that puts those of all wheels side by side, in whole vectors first."""
    groups: dict[str, list[sp.Symbol]] = {}
    for argument in arguments:
        groups.setdefault(shapes.get(argument, ""), []).append(argument)
    ordered = sorted(groups.values(), key=lambda group: len(group) % WIDTH)
    return tuple(argument for group in ordered for argument in group)


def schedule(function: Function) -> list[Step]:
    """Assignments and batches in an order in which every argument is known when it is needed."""
    pending = list(function.assignments)
    assigned = {symbol for symbol, _ in pending}
    waiting = {symbol: set(expression.free_symbols) & assigned for symbol, expression in pending}
    called = {symbol: calls(expression) for symbol, expression in pending}
    shapes = _shapes(function)
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
                steps.append(Batch(name, _alike(arguments, shapes)))
                done |= {(name, argument) for argument in arguments}
        if not pending and all(call in done for call in at_end):
            return steps
