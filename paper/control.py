"""Measures models in control: optimal plans, a loop at 20 Hz, a thousand rollouts.

Usage: python paper/control.py [--results DIR]

Writes DIR/models/braking_car.nc, a fitted car, and DIR/control.nc, named values with units, which
`paper/measured_numbers.py` reads, in a few minutes.  Times are CPU times of one thread, CasADi's
expressions interpreted where nothing else is said.
"""

from __future__ import annotations

import argparse
import runpy
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import chdir
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
from in_use import Values, store
from reduced_models import fitted_once

import vehiclemor as vm
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.simulation.run_timer import one_thread

Models = dict[str, tuple[Any, int]]
EXAMPLES = Path(__file__).parents[1] / "examples"
MODEL = "independent_suspension_vehicle"
# Periods that are tried as horizons in the loop until one is too long, and the loop's length in s.
HORIZONS, LOOP = (5, 10, 15, 20, 30, 40, 60), 0.5
# Periods of the plan whose generated C is compiled.
COMPILED = 30
# Of rollouts: steps a period that are tried, errors of a position (m) that are allowed, calls.
PARTS, NEAR, ROUNDS = (1, 2, 3, 4, 5, 10, 20), (5e-4, 1e-3, 1e-2), 15


def example(name: str) -> Any:
    """Names of an example, which runs nothing."""
    return SimpleNamespace(**runpy.run_path(str(EXAMPLES / f"{name}.py")))


def models(braking: ReducedOrderModel) -> Models:
    """Label -> model, and Runge-Kutta steps a period, none for collocation; full ones come first.

    The last two brake too.
    """
    reduced = vm.rom(MODEL)
    full, braked = (vm.reduce(car.model, "full_order") for car in (reduced, braking))
    track = vm.reduce(reduced.model, "linear_single_track")
    steered = {"full": (full, 0), "reduced": (reduced, 1), "track": (track, 1)}
    return steered | {"braked full": (braked, 0), "braked reduced": (braking, 1)}


def plans(known: Models) -> Iterator[tuple[str, float]]:
    """Optimal lane change of 60 periods: seconds, unknowns, distance to the full car's plan.

    With the bytes of the C that CasADi writes of its functions.
    """
    planning, found = example("optimal_control"), {}
    for label, (car, steps) in known.items():
        planner = planning.Planner(car, steps=steps)
        found[label], seconds = planner.plan(planner.start())
        apart = np.abs(found[label] - found[full_of(label)]).max(axis=1)
        yield f"{label} plan, s", seconds
        yield f"{label} unknowns, 1", len(planner.guess)
        yield from zip((f"{label} off, rad", f"{label} braking off, m/s^2"), apart, strict=False)
        with TemporaryDirectory() as folder, chdir(folder):
            planner.solver.generate_dependencies("plan.c")
            yield f"{label} generated, B", Path("plan.c").stat().st_size
    yield "largest steering, rad", float(np.abs(found["full"]).max())


def full_of(label: str) -> str:
    """Label of the full model that a model plans for."""
    return "braked full" if label.startswith("braked") else "full"


def otherwise(known: Models) -> Iterator[tuple[str, float]]:
    """The full car's plan by five Runge-Kutta steps a period, the reduced one's by collocation."""
    for label, how, steps in (("full", "shooting", 5), ("reduced", "collocation", 0)):
        planner = example("optimal_control").Planner(known[label][0], steps=steps)
        yield f"{label} {how}, s", planner.plan(planner.start())[1]


def loops(known: Models) -> Iterator[tuple[str, float]]:
    """Longest horizon whose usual plan fits into a period, with the full car as plant; its times.

    Of a model that has none the times are those of the shortest horizon.
    """
    planning = example("optimal_control")
    for label, (car, steps) in known.items():
        fits, best = 0, np.zeros(0)
        for periods in HORIZONS:
            plant = known[full_of(label)][0]
            _, seconds = planning.drive(planning.Planner(car, periods, steps), plant, LOOP)
            if not best.size:
                best = seconds
            if np.median(seconds) > planning.PERIOD:
                break
            fits, best = periods, seconds
        yield f"{label} fits, 1", fits
        yield f"{label} usual, s", float(np.median(best))
        yield f"{label} longest, s", float(best.max())


def compiled(known: Models) -> Iterator[tuple[str, float]]:
    """The reduced car's usual plan in the loop by CasADi's C, and interpreted."""
    import casadi as ca

    planning = example("optimal_control")
    car, steps = known["reduced"]
    planner = planning.Planner(car, COMPILED, steps)
    solvers = {"interpreted": planner.solver}
    with TemporaryDirectory() as folder, chdir(folder):
        planner.solver.generate_dependencies("plan.c")
        command = ["cc", "-w", "-O1", "-fPIC", "-shared", "-o", "plan.so", "plan.c", "-lm"]
        subprocess.run(command, check=True)  # noqa: S603  (a C compiler)
        solvers["compiled"] = ca.nlpsol("plan", "ipopt", "./plan.so", planning.QUIET)
    for how, solver in solvers.items():
        planner.solver, planner.guess = solver, None
        _, seconds = planning.drive(planner, known["full"][0], LOOP)
        yield f"reduced {how} usual, s", float(np.median(seconds))


def rollouts(_: Models) -> Iterator[tuple[str, float]]:
    """Rollouts of 2 s a second of one core: whole runs, and the fastest fixed steps by error."""
    sampling = example("sampled_plans")
    random = np.random.default_rng(1)
    size = sampling.PLANS, sampling.KNOTS + 1
    steering = sampling.SPREAD * random.normal(size=size).cumsum(axis=1)
    steering -= steering[:, :1]

    def whole_runs(car: Any, **how: Any) -> Any:
        signals = vm.many_signals(sampling.TIMES, steering, output_step=sampling.PERIOD)
        return vm.simulate_many(car, signals, outputs=sampling.SEEN, jobs=1, **how)

    reduced = vm.rom(MODEL)
    exact = whole_runs(reduced.model)["values"].values
    strongest = vm.reduce(reduced.model, "full_order", preset="strongest")
    for label, car in (("reduced", reduced), ("full", strongest)):
        yield f"{label} rollouts, 1/s", rate(partial(whole_runs, car, trust="off"))
        fastest = dict.fromkeys(NEAR, (0.0, 0.0))
        for integrator, parts in product(("rk4", "ros2"), PARTS):
            options = {"step": sampling.PERIOD / parts, "integrator": integrator}
            rollouts = vm.export(car, "rollouts", outputs=sampling.SEEN, **options)
            call = partial(rollouts, car.state(), steering, sampling.PERIOD)
            error = np.abs(call() - exact).max()
            for near in (near for near in NEAR if error <= near):
                fastest[near] = max(fastest[near], (rate(call), options["step"]))
        for near, found in fastest.items():
            for name, value in zip((", 1/s", " step, s"), found, strict=True):
                yield f"{label} rollouts within {1e3 * near:g} mm{name}", value


def rate(call: Callable[[], Any]) -> float:
    """Rollouts a second of CPU time, at best."""
    seconds = []
    for _ in range(ROUNDS):
        began = time.process_time()
        call()
        seconds.append(time.process_time() - began)
    return example("sampled_plans").PLANS / min(seconds)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    results = parser.parse_args().results
    values: Values = {}
    with one_thread():
        path = results / "models" / "braking_car.nc"
        known = models(fitted_once(path, example("optimal_control").braking_car))
        for part in (plans, rollouts, loops, compiled, otherwise):
            values |= dict(part(known))
            store(values, "Models in control", results / "control.nc")


if __name__ == "__main__":
    main()
