"""vehiclemor itself: the full order in its own integrators, limits watched in every run."""

from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, decades

import vehiclemor as vm

SOLVERS = ("ros34pw2", "etdrk4", "exponential_adams")


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states as peers do, and runs that deliver all outputs."""
    found, states = {}, case.model.definition.states
    column = case.model.outputs.index("lateral_position")
    for solver in SOLVERS:
        how: dict[str, Any] = {"start": "equilibrium", "solver": solver}

        def call(tolerance: float, names: tuple[str, ...] | None, how: dict = how) -> Any:
            simulate, maneuver = case.model.simulate, case.maneuver

            def whole() -> Any:
                trajectory = simulate(maneuver, tolerance=tolerance, outputs=names, **how)
                _ = trajectory.outputs  # histories are made when they are first read
                return trajectory

            return whole

        scan = decades(1e-1, 1e-8)
        found[f"ours {solver}"] = Curve(
            partial(call, names=states),
            scan,
            lambda r: r.outputs[:, case.lateral],
            counts=lambda r: r.counts["rhs_calls"],
        )
        read = lambda r: r.outputs[:, column]  # noqa: E731
        found[f"ours {solver}, outputs"] = Curve(
            partial(call, names=None), scan, read, "outputs", lambda r: r.counts["rhs_calls"]
        )
    return found


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python: a step of 10 ms with held inputs."""

    def make(tolerance: float, solver: str) -> Any:
        car = vm.reduce(case.model, "full_order", solver=solver, tolerance=tolerance)

        def loop() -> np.ndarray:
            state, found = case.start, np.empty(len(case.reference))
            for k, u in enumerate(case.more["held"]):
                state = car.step(state, u, 0.01)
                found[k] = state[case.lateral]
            return found

        return loop

    return {
        f"ours {solver}": Curve(partial(make, solver=solver), decades(1e-1, 1e-6, 2), np.asarray)
        for solver in SOLVERS[:2]
    }


def batch(case: Case) -> dict[str, Curve]:
    """All runs by `simulate_many`, in one thread."""

    def make(tolerance: float, solver: str) -> Any:
        car = vm.reduce(case.model, "full_order", solver=solver, tolerance=tolerance)
        names, signals = ["lateral_position"], case.more["signals"]
        return lambda: vm.simulate_many(car, signals, "equilibrium", outputs=names, jobs=1)

    read = lambda found: found["values"].values[:, :, 0]  # noqa: E731
    return {
        f"ours {solver}": Curve(
            partial(make, solver=solver), decades(1e-1, 1e-7, 2), read, "lateral position"
        )
        for solver in SOLVERS
    }


def mechanism(case: Case) -> dict[str, Curve]:
    """Newton's method at all samples."""

    def make(tolerance: float, solver: str) -> Any:
        how: dict[str, Any] = {"solver": solver, "tolerance": tolerance}
        return lambda: case.model.simulate(case.maneuver, **how).outputs

    return {
        f"ours {solver}": Curve(
            partial(make, solver=solver), decades(1e-1, 1e-9, 1), np.asarray, "outputs"
        )
        for solver in ("newton", "newton_lanes")
    }


def structure(case: Case) -> dict[str, Curve]:
    """The time loop of structures by step size."""

    def make(step: float) -> Any:
        return lambda: case.model.run(case.maneuver, step=step).outputs

    read = lambda y: y / case.more["ranges"]  # noqa: E731
    return {"ours": Curve(make, case.more["steps"], read, "outputs")}
