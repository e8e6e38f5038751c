"""SciPy: `solve_ivp`, `odeint` and `root` on the compiled functions of a model."""

from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, callback, decades
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import root

METHODS = ("LSODA", "Radau", "BDF", "DOP853")


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states; the right-hand side is called from Python."""
    rhs, scale = callback(case), case.model.error_scale

    def make(tolerance: float, method: str) -> Any:
        how: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * scale}

        def part(state: np.ndarray, times: np.ndarray, moves: bool) -> np.ndarray:
            if method == "odeint":
                more = {"tfirst": True, "mxstep": 100_000, "tcrit": times[-1:]}
                return odeint(rhs(moves), state, times, **how, **more)
            copied = lambda t, x: rhs(moves)(t, x).copy()  # noqa: E731  (SciPy keeps what it gets)
            span = times[0], times[-1]
            return solve_ivp(copied, span, state, method, times, **how).y.T

        return lambda: case.by_parts(part)

    read, scan = (lambda states: states[:, case.lateral]), decades(1e-3, 1e-8, 2)
    labels = {"SciPy odeint": "odeint"} | {f"SciPy {method}": method for method in METHODS}
    return {
        label: Curve(partial(make, method=method), scan, read) for label, method in labels.items()
    }


def mechanism(case: Case) -> dict[str, Curve]:
    """`root` at each sample from the one before, with the analytic Jacobian."""
    model, (times, n) = case.model, (case.maneuver.times, len(case.model.coordinates))
    residual, jacobian = model.bare("residual"), model.bare("residual_jacobian")
    outputs, inputs = model.bare("outputs"), case.maneuver.at(times)
    found, matrix, state = np.empty(n), np.empty((n, n + 1)), np.empty(n)

    def make(tolerance: float) -> Any:
        def function(q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            state[:] = q
            residual(state, u, found)
            jacobian(state, u, matrix)
            return found, matrix[:, :-1]

        def path() -> np.ndarray:
            q, histories = model.start(), np.empty(case.reference.shape)
            for u, row in zip(inputs, histories, strict=True):
                q = root(function, q, (u,), jac=True, options={"xtol": tolerance}).x
                outputs(q, u, row)
            return histories

        return path

    return {"SciPy root": Curve(make, decades(1e-1, 1e-9, 1), np.asarray, "outputs")}
