"""SciPy: `solve_ivp`, `odeint` and `root` on the compiled functions of a model."""

from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, callback, decades
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import root

METHODS = ("odeint", "LSODA", "Radau", "BDF", "DOP853")


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states; the right-hand side is called from Python."""
    rhs = callback(case)

    def make(tolerance: float, method: str) -> Any:
        how: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * case.model.error_scale}

        def part(state: np.ndarray, times: np.ndarray, moves: bool) -> np.ndarray:
            if method == "odeint":
                more = {"tfirst": True, "args": (moves,), "mxstep": 100_000, "tcrit": times[-1:]}
                return odeint(rhs, state, times, **how, **more)
            copied = lambda t, x: rhs(t, x, moves).copy()  # noqa: E731  (SciPy keeps what it gets)
            return solve_ivp(copied, (times[0], times[-1]), state, method, times, **how).y.T

        return lambda: case.by_parts(part)

    how = decades(1e-3, 1e-8, 2), lambda states: states[:, case.lateral]
    return {f"SciPy {method}": Curve(partial(make, method=method), *how) for method in METHODS}


def mechanism(case: Case) -> dict[str, Curve]:
    """`root` at each sample from the one before, with the analytic Jacobian."""
    model, n = case.model, len(case.model.coordinates)
    residual, jacobian, outputs = map(model.bare, ("residual", "residual_jacobian", "outputs"))
    inputs = case.maneuver.at(case.maneuver.times)
    found, matrix, state = np.empty(n), np.empty((n, n + 1)), np.empty(n)

    def function(q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state[:] = q
        residual(state, u, found)
        jacobian(state, u, matrix)
        return found, matrix[:, :-1]

    def path(tolerance: float) -> np.ndarray:
        q, histories = model.start(), np.empty(case.reference.shape)
        for u, row in zip(inputs, histories, strict=True):
            q = root(function, q, (u,), jac=True, options={"xtol": tolerance}).x
            outputs(q, u, row)
        return histories

    make = lambda tolerance: partial(path, tolerance)  # noqa: E731
    return {"SciPy root": Curve(make, decades(1e-1, 1e-9, 1), delivers="outputs")}
