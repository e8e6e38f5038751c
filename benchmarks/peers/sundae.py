"""scikit-sundae: CVODE and IDA of SUNDIALS, with functions in Python."""

import math
from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, callback, decades, pulse
from sksundae.cvode import CVODE
from sksundae.ida import IDA


def run(case: Case) -> dict[str, Curve]:
    """CVODE on the right-hand side, and IDA on the equations before elimination."""
    read = lambda states: states[:, case.lateral]  # noqa: E731
    found = {"scikit-sundae CVODE": Curve(partial(cvode, case), decades(1e-3, 1e-9, 2), read)}
    if "descriptor" in case.model.equations.shapes:
        label = "scikit-sundae IDA, descriptor form"
        found[label] = Curve(partial(ida, case), decades(1e-3, 1e-8, 2), read)
    return found


def cvode(case: Case, tolerance: float) -> Any:
    """BDF, dense Jacobian by differences."""
    rhs = callback(case)
    how = {"rtol": tolerance, "atol": tolerance * case.model.error_scale}

    def part(state: np.ndarray, times: np.ndarray, moves: bool) -> np.ndarray:
        def rates(t: float, x: np.ndarray, dx: np.ndarray) -> None:
            dx[:] = rhs(t, x, moves)

        return CVODE(rates, method="BDF", max_num_steps=100_000, **how).solve(times, state).y

    return lambda: case.by_parts(part)


def ida(case: Case, tolerance: float) -> Any:
    """M v' - C^T lambda = F, C v' = gamma, q' = v: index 1, by the model's stabilised constraints.

    The unknowns are q, v and lambda.
    """
    rows, n = case.model.bare("descriptor"), len(case.model.coordinates)
    c = case.model.equations.shapes["descriptor"][0] - n
    table, state, u = np.empty((n + c, n + 1)), case.start, np.zeros(len(case.model.inputs))
    scale = np.append(case.model.error_scale, np.full(c, 1e3))  # forces are of kN
    how = {"rtol": tolerance, "atol": tolerance * scale, "max_num_steps": 100_000}
    how["algebraic_idx"] = np.arange(2 * n, 2 * n + c)

    def equations(t: float, x: np.ndarray, moves: bool) -> tuple[np.ndarray, ...]:
        state[:], u[:] = x[: 2 * n], pulse(t, math, True) if moves else 0.0
        rows(state, u, table)
        return table[:n, :n], table[:n, n], table[n:, :n], table[n:, n]

    def part(begin: np.ndarray, times: np.ndarray, moves: bool) -> np.ndarray:
        def residual(t: float, y: np.ndarray, dy: np.ndarray, result: np.ndarray) -> None:
            mass, force, constraint, gamma = equations(t, y, moves)
            rates = dy[n : 2 * n]
            result[:n] = dy[:n] - y[n : 2 * n]
            result[n : 2 * n] = mass @ rates - force - y[2 * n :] @ constraint
            result[2 * n :] = constraint @ rates - gamma

        mass, force, constraint, gamma = equations(times[0], begin, moves)
        whole = np.block([[mass, -constraint.T], [constraint, np.zeros((c, c))]])
        solved = np.linalg.solve(whole, np.append(force, gamma))
        y, dy = np.append(begin, solved[n:]), np.concatenate([begin[n:], solved[:n], np.zeros(c)])
        return IDA(residual, **how).solve(times, y, dy).y[:, : 2 * n]

    return lambda: case.by_parts(part)


def steps(case: Case) -> dict[str, Curve]:
    """A solver that starts afresh at each step."""
    rhs, state, rates = case.model.bare("rhs"), case.start, np.empty(len(case.start))
    held, span = np.zeros(len(case.model.inputs)), np.array([0.0, 0.01])

    def function(_: float, x: np.ndarray, dx: np.ndarray) -> None:
        state[:] = x
        rhs(state, held, rates)
        dx[:] = rates

    def make(tolerance: float) -> Any:
        solver = CVODE(function, rtol=tolerance, atol=tolerance * case.model.error_scale)

        def step(x: np.ndarray, u: np.ndarray, _: float) -> np.ndarray:
            held[:] = u
            return solver.solve(span, x).y[-1]

        return lambda: case.loop(step, case.start, case.more)

    return {"scikit-sundae CVODE": Curve(make, decades(1e-2, 1e-8, 2))}
