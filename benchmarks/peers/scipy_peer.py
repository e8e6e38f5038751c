"""SciPy: `solve_ivp`, `odeint` and `root` on compiled functions, and the truck by `splu` alone."""

from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, callback, decades
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import root
from scipy.sparse.linalg import splu

METHODS = ("odeint", "LSODA", "Radau", "BDF", "DOP853")
RADIUS = 0.8  # spectral radius at infinity, as ours has it
CLOSE = 1e-6  # part of the largest static force below which Newton's method ends, likewise


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


def structure(case: Case) -> dict[str, Curve]:
    """Generalised-alpha method as in Chung and Hulbert (1993), Newton's in the port forces alone.

    The matrix is factored with the first call, as ours is.
    """
    system = case.model.system
    s, law, spacing = system.structure, system.law, case.maneuver.times[1]
    ports = s.ports.toarray()
    mass, stiffness = s.mass.tocsr(), s.stiffness.tocsr()
    damping = (s.damping_time * stiffness + s.dampers @ s.dampers.T).tocsr()
    am, af = (2.0 * RADIUS - 1.0) / (RADIUS + 1.0), RADIUS / (RADIUS + 1.0)
    gamma, beta = 0.5 - am + af, 0.25 * (1.0 - am + af) ** 2
    cq, cv, ca, cf = (matrix.tocsr() for matrix in s.outputs)
    eye, close = np.eye(ports.shape[1]), CLOSE * np.abs(law.static[1]).max()

    def make(h: float) -> Any:
        every = round(spacing / h)
        inputs = case.maneuver.at(np.linspace(0.0, case.maneuver.duration, every * 250 + 1))
        whole = (1.0 - am) * mass + (1.0 - af) * h * (gamma * damping + h * beta * stiffness)
        options = {"SymmetricMode": True}
        factor = splu(whole.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        response = (1.0 - af) * factor.solve(ports)
        compliance = h * h * beta * (ports.T @ response)

        def march() -> np.ndarray:
            q, v, a = np.zeros((3, s.size))
            f = law.at(ports.T @ q, ports.T @ v, inputs[0])[:, 0]
            found = [cf @ (f + law.static[1])]
            for k, u in enumerate(inputs[1:], start=1):
                q_free, v_free = q + h * v + h * h * (0.5 - beta) * a, v + h * (1.0 - gamma) * a
                forces = af * (ports @ f) - am * (mass @ a)
                forces -= damping @ ((1.0 - af) * v_free + af * v)
                forces -= stiffness @ ((1.0 - af) * q_free + af * q)
                free = factor.solve(forces)
                place = ports.T @ (q_free + h * h * beta * free)
                speed = ports.T @ (v_free + h * gamma * free)
                for _ in range(40):
                    moved = compliance @ f
                    force, by_place, by_speed = law.at(
                        place + moved, speed + gamma / (h * beta) * moved, u
                    ).T
                    slope = (by_place + gamma / (h * beta) * by_speed)[:, None] * compliance
                    change = np.linalg.solve(eye - slope, force - f)
                    f = f + change
                    if np.abs(change).max() <= close:
                        break
                before, a = a, free + response @ f
                q, v = q_free + h * h * beta * a, v_free + h * gamma * a
                if k % every == 0:
                    # The method's accelerations are those of af - am steps before.
                    now = a + (af - am) * (a - before)
                    found.append(cq @ q + cv @ v + ca @ now + cf @ (f + law.static[1]))
            return np.array(found)

        return march

    return {"SciPy splu, loop in Python": Curve(make, case.more, delivers="outputs")}
