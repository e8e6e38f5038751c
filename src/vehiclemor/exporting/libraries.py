"""A system as a function of another library: CasADi or JAX."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.exporting.straight_line import FUNCTIONS, evaluated
from vehiclemor.exporting.systems import ExportedSystem

if TYPE_CHECKING:
    import casadi

# Where a library has another name.
OF_CASADI = {"abs": "fabs", "max": "fmax", "min": "fmin"}
OF_JAX = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
OF_JAX |= {"max": "fmax", "min": "fmin"}


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


OBJECTS = {"casadi": casadi_function, "jax": jax_function}
