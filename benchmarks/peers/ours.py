"""vehiclemor itself: the full order in its own integrators, limits watched in every run."""

from functools import partial
from typing import Any

import numpy as np
from clock import Case, Curve, decades

import vehiclemor as vm

SOLVERS = ("etdrk4", "dopri5")


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states as peers do, and runs that deliver all outputs."""
    lateral = case.model.outputs.index("lateral_position")

    def make(tolerance: float, solver: str, names: tuple[str, ...] | None) -> Any:
        how: dict[str, Any] = {"solver": solver, "tolerance": tolerance, "outputs": names}

        def whole() -> Any:
            trajectory = case.model.simulate(case.maneuver, "equilibrium", **how)
            _ = trajectory.outputs  # histories are made when they are first read
            return trajectory

        return whole

    def curve(solver: str, names: tuple[str, ...] | None, column: int, delivers: str) -> Curve:
        made, read = partial(make, solver=solver, names=names), lambda r: r.outputs[:, column]
        return Curve(made, decades(1e-1, 1e-8), read, delivers, lambda r: r.counts["rhs_calls"])

    found = {}
    for solver in SOLVERS:
        names = case.model.definition.states
        found[f"ours {solver}"] = curve(solver, names, case.lateral, "states")
        found[f"ours {solver}, outputs"] = curve(solver, None, lateral, "outputs")
    return found


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python: a step of 10 ms with held inputs."""

    def make(tolerance: float, solver: str) -> Any:
        step = vm.reduce(case.model, "full_order", solver=solver, tolerance=tolerance).step
        return lambda: case.loop(step, case.start, case.more)

    scan = decades(1e-1, 1e-6, 2)
    return {f"ours {solver}": Curve(partial(make, solver=solver), scan) for solver in SOLVERS}


def batch(case: Case) -> dict[str, Curve]:
    """All runs by `simulate_many`, in one thread."""

    def make(tolerance: float, solver: str) -> Any:
        car = vm.reduce(case.model, "full_order", solver=solver, tolerance=tolerance)
        how: dict[str, Any] = {"outputs": ["lateral_position"], "jobs": 1}
        return lambda: vm.simulate_many(car, case.more, "equilibrium", **how)

    how = decades(1e-1, 1e-7, 2), lambda found: found["values"].values[:, :, 0], "lateral position"
    return {f"ours {solver}": Curve(partial(make, solver=solver), *how) for solver in SOLVERS}


def mechanism(case: Case) -> dict[str, Curve]:
    """Newton's method at all samples."""

    def make(tolerance: float, solver: str) -> Any:
        how: dict[str, Any] = {"solver": solver, "tolerance": tolerance}
        return lambda: case.model.simulate(case.maneuver, **how).outputs

    how, solvers = (decades(1e-1, 1e-9, 1), np.asarray, "outputs"), ("newton", "newton_lanes")
    return {f"ours {solver}": Curve(partial(make, solver=solver), *how) for solver in solvers}


def structure(case: Case) -> dict[str, Curve]:
    """The time loop of structures by step size."""

    def make(step: float) -> Any:
        return lambda: case.model.run(case.maneuver, step=step).outputs

    return {"ours": Curve(make, case.more, delivers="outputs")}
