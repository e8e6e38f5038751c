"""Kernels as assignments of scalar expressions alone, in which every name is assigned once.

The text of a kernel also has batches of elementary functions and weighted sums, which are for the
vector units; here they are written out.  What is left are numbers, names, entries of the arguments,
`+ - * /`, comparisons and calls: short enough for any printer or interpreter.
"""

import ast
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from vehiclemor.codegen.kernel_statements import SEED, KernelText, places
from vehiclemor.codegen.kernels import KernelSource
from vehiclemor.codegen.tangent import tangent_source
from vehiclemor.codegen.vector_lanes import LANES, padded

# Names of C's library, of which other systems have their own.  Besides these there are `pow`,
# `select(test, then, otherwise)`, and `entry(row, place)` of a table.
FUNCTIONS = (
    *("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("atan2", "fabs", "fmax", "fmin", "floor"),
)
RENAMED = {"abs": "fabs", "np.abs": "fabs", "np.floor": "floor", "max": "fmax", "min": "fmin"}
# Function that has batches -> what gives its results.
BATCHES = {"sincos": ("sin", "cos"), "atan": ("atan",)}


class StraightLine(NamedTuple):
    """A function of arrays.

    Attributes
    ----------
    assignments
        Name -> expression, in order.
    results
        Expressions of the results, row by row.
    """

    assignments: dict[str, ast.expr]
    results: Sequence[ast.expr]

    def named(self, name: str) -> "StraightLine":
        """The same with a name for each result, for those who read it several times."""
        assignments, results = dict(self.assignments), list(self.results)
        for i, result in enumerate(self.results):
            if not isinstance(result, ast.Name | ast.Constant | ast.Subscript):
                results[i] = ast.Name(f"{name}_{i}")
                assignments[f"{name}_{i}"] = result
        return StraightLine(assignments, results)

    def followed_by(self, results: Sequence[ast.expr]) -> "StraightLine":
        """The same with further results."""
        return StraightLine(self.assignments, [*self.results, *results])

    def pruned(self) -> "StraightLine":
        """The same without assignments that no result needs."""
        needed = {n.id for e in self.results for n in ast.walk(e) if isinstance(n, ast.Name)}
        kept: dict[str, ast.expr] = {}
        for name, expression in reversed(self.assignments.items()):
            if name in needed:
                kept[name] = expression
                needed |= {n.id for n in ast.walk(expression) if isinstance(n, ast.Name)}
        return StraightLine(dict(reversed(kept.items())), self.results)

    def read(self, array: str) -> set[int]:
        """Places of the entries of an array that the results depend on."""
        used = self.pruned()
        return {
            places(node)[0]
            for expression in (*used.assignments.values(), *used.results)
            for node in ast.walk(expression)
            if isinstance(node, ast.Subscript) and ast.unparse(node.value) == array
        }


def straight_line(
    text: str, given: Mapping[str, Sequence[ast.expr]], before: StraightLine | None = None
) -> StraightLine:
    """A kernel's text written out.

    Parameters
    ----------
    given
        Argument as the text names it -> expression of each of its entries.
    before
        What these expressions need.
    """
    kernel = KernelText(text)
    reader = _Reader(given, {} if before is None else dict(before.assignments))
    for statement in kernel.statements:
        reader.read(statement, kernel)
    return StraightLine(reader.assignments, [reader.results[i] for i in sorted(reader.results)])


def tangent_line(
    source: KernelSource,
    given: Mapping[str, Sequence[ast.expr]],
    seeds: Mapping[str, Sequence[ast.expr]],
    before: StraightLine | None = None,
) -> StraightLine:
    """The derivative of a kernel along seeds of some of its arguments, see `tangent_text`."""
    moved = {name: seed for name, seed in seeds.items() if name in source.arguments}
    text = tangent_source(source, tuple(moved)).text
    return straight_line(
        text, {**given} | {SEED + name: seed for name, seed in moved.items()}, before
    )


def entries(name: str, count: int) -> list[ast.expr]:
    """Expressions of the entries of an array."""
    return [ast.Subscript(ast.Name(name), ast.Constant(i)) for i in range(count)]


def numbers(values: Iterable[float]) -> list[ast.expr]:
    """Expressions of numbers."""
    return [ast.Constant(float(value)) for value in values]


def call(name: str, *arguments: ast.expr) -> ast.expr:
    """Expression of a call."""
    return ast.Call(ast.Name(name), list(arguments), [])


def negative(value: ast.expr) -> ast.expr:
    """Minus a value; in C two signs in a row are a decrement."""
    match value:
        case ast.Constant(value=float() as number):
            return ast.Constant(-number)
        case ast.UnaryOp(ast.USub(), operand):
            return operand
    return ast.UnaryOp(ast.USub(), value)


class _Reader:
    """Reads the statements of a kernel one after the other."""

    def __init__(
        self, given: Mapping[str, Sequence[ast.expr]], assignments: dict[str, ast.expr]
    ) -> None:
        self._given, self.assignments = given, assignments
        self.results: dict[int, ast.expr] = {}
        # What the text's names and scratch space stand for by now.
        self._known: dict[str, ast.expr] = {}
        self._work: dict[int, ast.expr] = {}
        self._copies: dict[str, int] = {}

    def read(self, statement: ast.stmt, kernel: KernelText) -> None:
        match statement:
            case ast.Assign([ast.Name(target)], expression):
                self._let(target, self._value(expression))
            case ast.Assign([ast.Subscript(ast.Name("_work")) as target], expression):
                self._work[places(target)[0]] = self._value(expression)
            case ast.Assign([ast.Subscript(ast.Name("_result")) as target], expression):
                self.results[kernel.flat(places(target))] = self._value(expression)
            case ast.Assign([ast.Tuple(targets)], ast.Call(ast.Name("sincos_one"), [argument])):
                angle = self._value(argument)
                for target, name in zip(targets, BATCHES["sincos"], strict=True):
                    self._let(ast.unparse(target), call(name, angle))
            case ast.Assign(
                [ast.Tuple(targets)],
                ast.Call(
                    ast.Name("weighted_sums"),
                    [ast.Name(array), ast.Constant(int() as first), ast.Tuple(terms)],
                ),
            ):
                factors = [self._named("term", self._value(term)) for term in terms]
                rows = self._given[array][first:]
                for column, target in enumerate(targets):
                    weights = rows[column :: padded(len(targets))]
                    pairs = zip(weights, factors, strict=False)
                    products = [p for weight, factor in pairs if (p := _product(weight, factor))]
                    self._let(ast.unparse(target), _total(products))
            case ast.Expr(ast.Call(ast.Name(name), [_, ast.Constant(int() as first)])) if (
                batch := name.removesuffix("_batch")
            ) in BATCHES:
                for part, function in enumerate(BATCHES[batch], 1):
                    for place in range(first, first + LANES):
                        self._work[place + part * LANES] = call(function, self._work[place])
            case _:
                raise ValueError(f"{ast.unparse(statement)}: not straight-line")

    def _let(self, name: str, value: ast.expr) -> None:
        """Give a name of the text to a value; names and numbers need none of their own."""
        self._known[name] = self._named(name, value)

    def _named(self, name: str, value: ast.expr) -> ast.expr:
        if isinstance(value, ast.Name | ast.Constant):
            return value
        # A letter first: names of the text may be reserved words elsewhere.
        own = unused = f"v_{name.lstrip('_')}"
        while unused in self.assignments:
            self._copies[own] = self._copies.get(own, 0) + 1
            unused = f"{own}_{self._copies[own]}"
        self.assignments[unused] = value
        return ast.Name(unused)

    def _value(self, node: ast.expr) -> ast.expr:
        match node:
            case ast.Constant(value=int() | float() as number):
                return ast.Constant(float(number))
            case ast.Name(name):
                return self._known[name]
            case ast.Subscript(ast.Name("_work")):
                return self._work[places(node)[0]]
            case ast.Subscript(ast.Name(array)):
                return self._given[array][places(node)[0]]
            case ast.BinOp(left, ast.Pow(), right):
                return call("pow", self._value(left), self._value(right))
            case ast.BinOp(left, operator, right):
                return ast.BinOp(self._value(left), operator, self._value(right))
            case ast.UnaryOp(ast.USub(), operand):
                return negative(self._value(operand))
            case ast.Compare(left, [operator], [right]):
                return ast.Compare(self._value(left), [operator], [self._value(right)])
            case ast.IfExp(test, then, otherwise):
                return call("select", *map(self._value, (test, then, otherwise)))
            case ast.Call(function, arguments):
                name = ast.unparse(function)
                name = RENAMED.get(name, name.removeprefix("math."))
                if name in FUNCTIONS:
                    return call(name, *map(self._value, arguments))
        raise ValueError(f"{ast.unparse(node)}: not straight-line")


def _product(weight: ast.expr, factor: ast.expr) -> ast.expr | None:
    """A weight times a factor; nothing where it is zero, the number alone where one of both is."""
    match weight, factor:
        case (ast.Constant(value=0.0), _):
            return None
        case (_, ast.Constant(value=1.0)):
            return weight
    return ast.BinOp(weight, ast.Mult(), factor)


def _total(terms: Sequence[ast.expr]) -> ast.expr:
    """Sum of terms in pairs: shallow for whoever walks through it, and rounded less."""
    if len(terms) < 2:
        return terms[0] if terms else ast.Constant(0.0)
    half = len(terms) // 2
    return ast.BinOp(_total(terms[:half]), ast.Add(), _total(terms[half:]))
