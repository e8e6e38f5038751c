"""A system as an object of another library: a function of CasADi or JAX, expressions of SymPy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.exporting.straight_line import FUNCTIONS, evaluated
from vehiclemor.exporting.systems import ExportedSystem
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    import casadi
    import sympy as sp

# Where a library has another name.
OF_CASADI = {"abs": "fabs", "max": "fmax", "min": "fmin"}
OF_JAX = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
OF_JAX |= {"max": "fmax", "min": "fmin"}
OF_SYMPY = {"abs": "Abs", "max": "Max", "min": "Min"}


def _functions(library: Any, renamed: dict[str, str]) -> dict[str, Callable[..., Any]]:
    return {name: getattr(library, renamed.get(name, name)) for name in FUNCTIONS}


def _needed(package: str) -> None:
    if find_spec(package) is None:
        raise InputError(f"{package} is not installed: pip install 'vehiclemor[{package}]'")


def casadi_function(system: ExportedSystem) -> casadi.Function:
    """Function (x, u, p) -> (dx, y) of states, inputs and parameters; columns."""
    _needed("casadi")
    import casadi

    functions = _functions(casadi, OF_CASADI) | {"select": casadi.if_else}
    symbols = {name: casadi.SX.sym(name, system.sizes[name]) for name in "xup"}
    constants = evaluated(system.functions["constants"], symbols, functions)
    results = [
        casadi.vertcat(*evaluated(system.functions[name], symbols | {"c": constants}, functions))
        for name in ("derivative", "outputs")
    ]
    return casadi.Function(system.name, list(symbols.values()), results, [*"xup"], ["dx", "y"])


def jax_function(system: ExportedSystem) -> Callable[..., tuple[Any, Any]]:
    """Function (x, u, p) -> (dx, y) of arrays; for `jit`, `vmap`, `jacfwd` and so on.

    Without p it takes the model's parameters.  It is as accurate as its arguments: in double
    precision where `jax_enable_x64` is set.
    """
    _needed("jax")
    import jax.numpy as jnp  # pyright: ignore[reportMissingImports]  (an extra)

    functions = _functions(jnp, OF_JAX) | {"select": jnp.where}
    table = np.array(system.table)
    functions["entry"] = lambda row, offset: jnp.asarray(table)[row.astype(int) + offset]
    values = np.array(system.values)

    def function(x: Any, u: Any, p: Any = values) -> tuple[Any, Any]:
        arrays = {"x": x, "u": u, "p": p}
        arrays["c"] = evaluated(system.functions["constants"], arrays, functions)
        dx = evaluated(system.functions["derivative"], arrays, functions)
        return jnp.array(dx), jnp.array(evaluated(system.functions["outputs"], arrays, functions))

    function.__name__ = system.name
    return function


@dataclass(frozen=True, eq=False)
class Expressions(ShortRepr):
    """A system in symbols, with common subexpressions by name, as `sympy.cse` gives them.

    `sympy.lambdify([e.x, e.u, e.p], e.derivative, cse=lambda y: (e.assignments, [*e.derivative]))`
    makes a function that gives a list of numbers.

    x, u and p are symbols of states, inputs and parameters; assignments symbol -> expression in
    order, constants first; derivative and outputs columns.
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
    arrays: dict[str, list[Any]] = {}
    for array, listed in quantities.items():
        arrays[array] = [sp.Symbol(q.name, real=True) for q in listed]
    functions = _functions(sp, OF_SYMPY) | {"==": sp.Eq, "!=": sp.Ne}
    functions["select"] = lambda test, then, other: sp.Piecewise((then, test), (other, True))
    assignments: list[tuple[sp.Symbol, sp.Expr]] = []

    def let(value: sp.Expr) -> sp.Symbol:
        assignments.append((sp.Symbol(f"_{len(assignments)}", real=True), value))
        return assignments[-1][0]

    arrays["c"] = evaluated(system.functions["constants"], arrays, functions, let)
    derivative = sp.Matrix(evaluated(system.functions["derivative"], arrays, functions, let))
    outputs = sp.Matrix(evaluated(system.functions["outputs"], arrays, functions, let))
    return Expressions(arrays["x"], arrays["u"], arrays["p"], assignments, derivative, outputs)


OBJECTS = {"casadi": casadi_function, "jax": jax_function, "sympy": sympy_expressions}
