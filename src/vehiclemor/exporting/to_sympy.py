"""A system as expressions of SymPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from vehiclemor.exporting.straight_line import FUNCTIONS, evaluated
from vehiclemor.exporting.system import ExportedSystem
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    import sympy as sp

# Where SymPy has another name.
RENAMED = {"fabs": "Abs", "fmax": "Max", "fmin": "Min"}


@dataclass(frozen=True, eq=False)
class Expressions(ShortRepr):
    """A system in symbols, with common subexpressions by name, as `sympy.cse` gives them.

    `sympy.lambdify([e.x, e.u, e.p], e.derivative, cse=lambda y: (e.assignments, [*e.derivative]))`
    makes a function that gives a list of numbers.

    Attributes
    ----------
    x, u, p
        Symbols of states, inputs and parameters.
    assignments
        Symbol -> expression, in order: constants first, then what rates and outputs need.
    derivative, outputs
        Columns.
    """

    repr_fields = ("x", "u")

    x: list[sp.Symbol]
    u: list[sp.Symbol]
    p: list[sp.Symbol]
    assignments: list[tuple[sp.Symbol, sp.Expr]]
    derivative: sp.Matrix
    outputs: sp.Matrix


def sympy_expressions(system: ExportedSystem) -> Expressions:
    """The system in symbols that are called as its quantities are."""
    import sympy as sp

    quantities = {"x": system.states, "u": system.inputs, "p": system.parameters}
    arrays: dict[str, list[Any]] = {
        array: [sp.Symbol(q.name, real=True) for q in listed]
        for array, listed in quantities.items()
    }
    functions = {name: getattr(sp, RENAMED.get(name, name)) for name in FUNCTIONS}
    functions["select"] = lambda test, then, other: sp.Piecewise((then, test), (other, True))
    assignments: list[tuple[sp.Symbol, sp.Expr]] = []

    def let(value: sp.Expr) -> sp.Symbol:
        assignments.append((sp.Symbol(f"_{len(assignments)}", real=True), value))
        return assignments[-1][0]

    found = {}
    for name in ("constants", "derivative", "outputs"):
        found[name] = evaluated(system.functions[name], arrays, functions, let)
        arrays["c"] = found["constants"]
    derivative, outputs = (sp.Matrix(found[name]) for name in ("derivative", "outputs"))
    return Expressions(arrays["x"], arrays["u"], arrays["p"], assignments, derivative, outputs)
