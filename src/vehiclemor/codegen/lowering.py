"""Kernels of a program: its SymPy expressions as operations, in exactly known numbers.

Every kernel has the arguments of its program, `_constants` and `_result`, which it fills.  The
kernel `constants` makes the array that the others read from `_parameters`.  Sums and products keep
the order in which SymPy prints them, small powers are products.

A tire formula at four wheels needs dozens of arctangents, sines and cosines; one call each would
cost more than all the rest.  So assignments are put off until as many arguments as possible are
known, and one vector loop takes these.  In a batch the same quantity of all wheels stands side by
side: from there the compiler packs the operations before and after into vectors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, cast

import sympy as sp

from vehiclemor.codegen.operations import KINDS, LANES, WIDTH, Kernel, Listing, Value
from vehiclemor.symbolic.program import Function, Program

# SymPy's name -> kind of operation.
RENAMED = {"Abs": "abs"}
# Powers that are products.
LARGEST_PRODUCT = 4
# Fewer calls of a function than this are evaluated one by one.
SMALLEST_BATCH = 3
# Functions that have a vector loop -> the calls whose values it gives.
BATCHED: dict[str, tuple[type, ...]] = {"sincos": (sp.sin, sp.cos), "atan": (sp.atan,)}
# Depth of assignments that are compared to decide whether two quantities are computed alike.
DEPTH = 4


def kernels_of(program: Program) -> dict[str, Kernel]:
    """Kernels of the functions of a program, and of its constants."""
    parameters = {"parameters": program.parameters}
    kernels = {"constants": _kernel("constants", parameters, program.constants)}
    for name, function in program.functions.items():
        kernels[name] = _kernel(name, _arguments(program), function)
    if "residual_jacobian" in kernels:
        kernels |= _product_kernels(program)
    return kernels


def _arguments(program: Program) -> Mapping[str, Sequence[sp.Expr]]:
    return program.arguments | {"constants": program.constants.results}


def _kernel(name: str, arguments: Mapping[str, Sequence[sp.Expr]], function: Function) -> Kernel:
    lowering = _Lowering()
    expressions = [e for _, e in function.assignments] + list(function.results)
    used = set().union(*(e.free_symbols for e in expressions))
    # With an underscore: a model's own names may be `result`.
    for argument, symbols in arguments.items():
        for index, symbol in enumerate(symbols):
            if symbol in used:
                lowering.known[symbol] = lowering.let(lowering.entry(f"_{argument}", index))
    for step in schedule(function):
        if isinstance(step, Batch):
            lowering.evaluate(step)
        else:
            lowering.known[step[0]] = lowering.let(lowering.value(step[1]))
    for index, expression in enumerate(function.results):
        lowering.store(index, lowering.value(expression))
    columns = function.shape[1] if len(function.shape) > 1 else 0
    return lowering.kernel(name, [*(f"_{a}" for a in arguments), "_result"], columns)


def _product_kernels(program: Program) -> dict[str, Kernel]:
    """Two kernels by which a Jacobian is multiplied with vectors.

    `jacobian_entries(q, u, constants, result)` gives the residual, then the entries of the Jacobian
    that are no structural constants; `jacobian_product(entries, column, result)` the product.
    """
    function, product = program.functions["residual_jacobian"], Listing()
    rows, columns = function.shape
    entries: list[sp.Expr] = []
    for i in range(rows):
        terms = []
        for j in range(columns - 1):
            entry = function.results[i * columns + j]
            if entry == 0:
                continue
            if entry not in (1, -1):
                factor = product.entry("_entries", rows + len(entries))
                terms.append(factor * product.entry("_column", j))
                entries.append(entry)
            else:
                column = product.entry("_column", j)
                terms.append(column if entry == 1 else -column)
        product.store(i, sum(terms[1:], terms[0]) if terms else 0.0)
    residual = [function.results[(i + 1) * columns - 1] for i in range(rows)]
    results = (*residual, *entries)
    listed = Function(function.assignments, results, (len(results),))
    kernels = (
        _kernel("jacobian_entries", _arguments(program), listed),
        product.kernel("jacobian_product", ("_entries", "_column", "_result")),
    )
    return {kernel.name: kernel for kernel in kernels}


class _Lowering(Listing):
    """Writes expressions; `known` are the values of symbols and of functions in batches."""

    def __init__(self) -> None:
        super().__init__()
        self.known: dict[sp.Basic, Value] = {}

    def evaluate(self, batch: Batch) -> None:
        """Write the evaluation of a function for several arguments at once."""
        calls = BATCHED[batch.name]
        if len(batch.arguments) < SMALLEST_BATCH:
            for argument in batch.arguments:
                value = self.let(self.new(batch.name, self.known[argument]))
                results = [value] if len(calls) == 1 else self.parts(value, len(calls))
                self.known |= {c(argument): r for c, r in zip(calls, results, strict=True)}
            return
        for first in range(0, len(batch.arguments), LANES):
            arguments = batch.arguments[first : first + LANES]
            padding = [self.number(0.0)] * (LANES - len(arguments))
            values = [*(self.known[argument] for argument in arguments), *padding]
            parts = self.parts(self.new("batch", *values, detail=batch.name), LANES * len(calls))
            for k, call in enumerate(calls):
                for lane, argument in enumerate(arguments):
                    self.known[call(argument)] = parts[LANES * k + lane]

    def value(self, expression: Any) -> Value:
        """Write an expression; `ValueError` if kernels have no operation of that kind."""
        if expression in self.known:
            return self.known[expression]
        match expression:
            case sp.Add():
                return self._sum(expression.as_ordered_terms())
            case sp.Mul():
                return self._product(expression)
            case sp.Pow():
                return self._power(expression.base, expression.exp)
            case sp.Piecewise():
                return self._choice(expression.args)
            case sp.Max() | sp.Min():
                return self._extreme(expression)
            case sp.Expr() if expression.is_number and not expression.args:
                return self.number(float(expression))
        name = getattr(expression, "rel_op", type(expression).__name__)
        kind = RENAMED.get(name, name)
        if KINDS.get(kind) != len(expression.args) or not expression.args:
            raise ValueError(f"{expression}: kernels have no {name}")
        return self.new(kind, *map(self.value, expression.args))

    def _sum(self, terms: Any) -> Value:
        total = self.value(terms[0])
        for term in terms[1:]:
            if term.as_coeff_Mul()[0].is_negative:
                total = total - self._product(term, opposite=True)
            else:
                total = total + self.value(term)
        return total

    def _product(self, expression: Any, opposite: bool = False) -> Value:
        """A product, or the opposite of one that has a negative sign."""
        number, rest = expression.as_coeff_Mul()
        negative = bool(number.is_negative)
        size = [] if abs(number) == 1 else [abs(number)]
        above, below = [], []
        for factor in [*size, *(rest.as_ordered_factors() if rest != 1 else [])]:
            base, exponent = factor.args if factor.is_Pow else (factor, sp.S.One)
            if exponent.is_Rational and exponent.is_negative:
                below.append((base, -exponent))
            else:
                above.append(factor)
        first, *others = above or [sp.S.One]
        total = self._opposite(first) if negative and not opposite else self.value(first)
        for factor in others:
            total = total * self.value(factor)
        if not below:
            return total
        divisor = self._power(*below[0])
        for base, exponent in below[1:]:
            divisor = divisor * self._power(base, exponent)
        return total / divisor

    def _opposite(self, factor: sp.Expr) -> Value:
        return self.number(-float(factor)) if factor.is_Number else -self.value(factor)

    def _power(self, base: Any, exponent: Any) -> Value:
        if abs(exponent) == sp.Rational(1, 2):
            root = self.new("sqrt", self.value(base))
            return root if exponent.is_positive else 1.0 / root
        if isinstance(exponent, sp.Integer) and 0 < abs(int(exponent)) <= LARGEST_PRODUCT:
            one, *others = [self.value(base) for _ in range(abs(int(exponent)))]
            for other in others:
                one = one * other
            return one if exponent.is_positive else 1.0 / one
        return self.new("power", self.value(base), self.value(exponent))

    def _choice(self, pairs: Iterable) -> Value:
        """The first expression whose condition holds; the last one holds always."""
        (expression, condition), *others = pairs
        if condition == True:  # noqa: E712 - SymPy's truth
            return self.value(expression)
        if not others:
            raise ValueError(f"{condition}: what holds otherwise?")
        if isinstance(condition, sp.And | sp.Or | sp.Not):
            sides = self.let(self.value(expression)), self.let(self._choice(others))
            return self._branch(condition, *sides)
        test = self.value(condition)
        return self.new("select", test, self.value(expression), self._choice(others))

    def _branch(self, condition: Any, then: Value, other: Value) -> Value:
        """One value where a condition holds, else the other."""
        if isinstance(condition, sp.Not):
            return self._branch(condition.args[0], other, then)
        if not isinstance(condition, sp.And | sp.Or):
            return self.new("select", self.value(condition), then, other)
        first, *rest = condition.args
        of_rest = self.let(self._branch(condition.func(*rest), then, other))
        if isinstance(condition, sp.And):
            return self._branch(first, of_rest, other)
        return self._branch(first, then, of_rest)

    def _extreme(self, expression: sp.Max | sp.Min) -> Value:
        """The largest or smallest argument; where 0 and x are equal, x alone changes Max(0, x)."""
        kind = ">" if isinstance(expression, sp.Max) else "<="
        one, *others = [self.let(self.value(argument)) for argument in expression.args]
        for other in others:
            one = self.let(self.new("select", self.new(kind, one, other), one, other))
        return one


@dataclass(frozen=True)
class Batch:
    """Evaluation of `sincos` or `atan` for several arguments at once."""

    name: str
    arguments: tuple[sp.Symbol, ...]


Step = tuple[sp.Symbol, sp.Expr] | Batch


def calls(expression: sp.Expr) -> list[tuple[str, sp.Symbol]]:
    """Batched functions that an expression calls, with their arguments."""
    distinct: dict[tuple[str, sp.Symbol], None] = {}
    for name, kinds in BATCHED.items():
        for call in sorted(expression.atoms(*kinds), key=str):
            argument = call.args[0]
            if not isinstance(argument, sp.Symbol):
                raise ValueError(f"{call}: name the argument on the tape first")
            distinct[name, argument] = None
    return list(distinct)


def _shapes(function: Function) -> dict[sp.Symbol, str]:
    """How symbols are computed, a few assignments deep, from any quantities."""
    shapes: dict[sp.Symbol, str] = {}
    for _ in range(DEPTH):
        shapes = {symbol: _shape(expression, shapes) for symbol, expression in function.assignments}
    return shapes


def _shape(expression: sp.Basic, shapes: Mapping[sp.Symbol, str]) -> str:
    """A short name of an expression's structure, without signs and the order of operands."""
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
    """Arguments in an order that puts those of all wheels side by side, full vectors first."""
    groups: dict[str, list[sp.Symbol]] = {}
    for argument in arguments:
        groups.setdefault(shapes.get(argument, ""), []).append(argument)
    ordered = sorted(groups.values(), key=lambda group: len(group) % WIDTH)
    return tuple(argument for group in ordered for argument in group)


def schedule(function: Function) -> list[Step]:
    """Assignments and batches in an order in which each argument is known before its use."""
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
