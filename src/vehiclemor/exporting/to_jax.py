"""A system as a function of JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vehiclemor.exporting.packages import needed
from vehiclemor.exporting.straight_line import FUNCTIONS, evaluated
from vehiclemor.exporting.system import ExportedSystem

# Where JAX has another name.
RENAMED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
RENAMED |= {"fabs": "abs"}


def jax_function(system: ExportedSystem) -> Callable[..., tuple[Any, Any]]:
    """Function (x, u, p=own values) -> (dx, y) of arrays; for `jit`, `vmap`, `jacfwd` and so on.

    It is as accurate as its arguments: in double precision where `jax_enable_x64` is set.

    Raises
    ------
    InputError
        If JAX isn't installed.
    """
    needed("jax")
    import jax.numpy as jnp  # pyright: ignore[reportMissingImports]  (an extra)

    functions = {name: getattr(jnp, RENAMED.get(name, name)) for name in FUNCTIONS}
    functions["select"] = jnp.where
    table = np.array(system.table)
    functions["entry"] = lambda row, place: jnp.asarray(table)[row.astype(int) + place]
    values = np.array(system.values)

    def function(x: Any, u: Any, p: Any = values) -> tuple[Any, Any]:
        arrays = {"x": x, "u": u, "p": p}
        arrays["c"] = evaluated(system.functions["constants"], arrays, functions)
        dx = evaluated(system.functions["derivative"], arrays, functions)
        return jnp.array(dx), jnp.array(evaluated(system.functions["outputs"], arrays, functions))

    function.__name__ = system.name
    return function
