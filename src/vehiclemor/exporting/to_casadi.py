"""A system as a function of CasADi."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.exporting.packages import needed
from vehiclemor.exporting.straight_line import FUNCTIONS, evaluated
from vehiclemor.exporting.system import ExportedSystem

if TYPE_CHECKING:
    import casadi


def casadi_function(system: ExportedSystem) -> casadi.Function:
    """Function (x, u, p) -> (dx, y) of states, inputs and parameters; columns.

    Raises
    ------
    InputError
        If CasADi isn't installed.
    """
    needed("casadi")
    import casadi

    functions = {name: getattr(casadi, name) for name in FUNCTIONS} | {"select": casadi.if_else}
    symbols = {name: casadi.SX.sym(name, system.sizes[name]) for name in "xup"}
    constants = evaluated(system.functions["constants"], symbols, functions)
    results = [
        casadi.vertcat(*evaluated(system.functions[name], symbols | {"c": constants}, functions))
        for name in ("derivative", "outputs")
    ]
    return casadi.Function(system.name, list(symbols.values()), results, [*"xup"], ["dx", "y"])
