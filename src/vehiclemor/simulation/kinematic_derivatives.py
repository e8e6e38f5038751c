"""Derivatives of a mechanism, whose coordinates follow from its inputs and parameters."""

from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.simulation.kernel_derivatives import By, chosen
from vehiclemor.simulation.model import Model

# What derivatives are of -> function of the equations, if it is one.
RESULTS = {"residual": "residual", "outputs": "outputs", "coordinates": ""}
# Largest gap (m or rad) between joints at which coordinates count as a solution.
CLOSED = 1e-6


def kinematic_derivatives(model: Model, q: Any, u: Any, by: By, of: str) -> np.ndarray:
    """Analytic derivatives at coordinates q (n,) and inputs.

    By the state: of the residual or of the outputs as functions of q.  By inputs or parameters: of
    the residual with q held, of coordinates and outputs with q following, dq = -Phi_q^-1 Phi_u du
    (implicit function theorem).

    Raises
    ------
    InputError
        If an argument is wrong, or the coordinates that are to follow don't close the joints.
    """
    function = chosen(of, RESULTS)
    if by == "state" and not function:
        raise InputError("derivatives of the coordinates are by inputs or parameters")
    if of == "residual" or by == "state":
        return model.jacobian_of(function, q, u, by)
    gap = float(np.abs(model.evaluated("residual", q, u)).max())
    if not gap < CLOSED:
        raise InputError(f"{model.name}: at these coordinates the joints are {gap:.3g} m apart")
    change = model.jacobian_of("residual", q, u, by)
    moved = -np.linalg.solve(model.evaluated("residual_jacobian", q, u)[:, :-1], change)
    if not function:
        return moved
    return (
        model.jacobian_of(function, q, u, by) + model.jacobian_of(function, q, u, "state") @ moved
    )
