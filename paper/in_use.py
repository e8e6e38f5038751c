"""Measures models in use: steps, calls, batches, files, exports, closed loops, predictive control.

Usage: python paper/in_use.py [--results DIR]

Writes DIR/in_use.nc, named values with units, which `paper/measured_numbers.py` reads.  It takes
about a minute and needs a C compiler and FMPy.  Times are CPU times of the thread, minima over
interleaved rounds, where nothing else is said.
"""

from __future__ import annotations

import argparse
import runpy
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import vehiclemor as vm
from vehiclemor.codegen.loops import Prepared
from vehiclemor.files import make_folder
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.provenance import attributes
from vehiclemor.reduction.reduced_model import ReducedOrderModel as Car
from vehiclemor.reduction.reduced_model import shipped_folder
from vehiclemor.registry import component

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
# `name, unit` -> value.
Values = dict[str, float]
# Short name of a vehicle -> its model, and a steering input that it is stepped with.
VEHICLES = {
    "gv": ("independent_suspension_vehicle", 0.02),
    "hfv": ("high_fidelity_vehicle", -0.003),
}
COARSE = {"solver": "ros34pw2", "tolerance": 2e-3}
# Ten seconds at 100 Hz.
TIMES = np.linspace(0.0, 10.0, 1001)
MULTISINE = component("maneuver", "multisine").at(TIMES)
ASIDE = "lateral_position"


def cars(short: str) -> dict[str, Car]:
    """The reduced model that ships, and the full one behind the same methods."""
    reduced = vm.rom(VEHICLES[short][0])
    return {"reduced": reduced, "full": vm.reduce(reduced.model, "full_order", **COARSE)}


def cpu(functions: dict[str, Callable[[], Any]], rounds: int = 30, spent: float = 4e-3) -> Values:
    """CPU time of calls in us: each is called for so many seconds a round."""
    counts = {}
    for name, function in functions.items():
        function()
        began = time.thread_time()
        function()
        counts[name] = max(1, int(spent / (time.thread_time() - began + 1e-7)))
    least = dict.fromkeys(functions, np.inf)
    for _ in range(rounds):
        for name, function in functions.items():
            began = time.thread_time()
            for _ in range(counts[name]):
                function()
            least[name] = min(least[name], (time.thread_time() - began) / counts[name])
    return {f"{name}, us": 1e6 * seconds for name, seconds in least.items()}


def central_differences(car: Car, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """What a user without `jacobian` would call."""
    steps = np.diag(6e-6 * np.maximum(np.abs(state), 1.0))
    sides = [car.rhs(state + h, inputs) - car.rhs(state - h, inputs) for h in steps]
    return np.stack(sides, axis=1) / (2.0 * steps.diagonal())


def steps() -> Values:
    """Single calls: step, rates, derivatives, outputs, trust."""
    calls: dict[str, Callable[[], Any]] = {}
    for short, (_, steering) in VEHICLES.items():
        for kind, car in cars(short).items():
            u = np.zeros(len(car.inputs))
            u[0] = steering
            x = car.step(car.state(), u, 1.0)
            calls[f"{short} {kind} step"] = partial(car.step, x, u, 0.01)
            calls[f"{short} {kind} differences"] = partial(central_differences, car, x, u)
            for name in ("rhs", "jacobian", "outputs", "trust"):
                calls[f"{short} {kind} {name}"] = partial(getattr(car, name), x, u)
    return cpu(calls)


def runs() -> Values:
    """Whole calls with a signal that was never seen: outside of compiled loops, and by name."""
    number, inside, compiled = iter(range(1_000_000)), [0.0], Prepared.__call__

    def fresh(hold: str = "linear") -> vm.Signal:
        return vm.Signal.from_samples(TIMES, MULTISINE * (1.0 - 1e-6 * next(number)), hold)

    def timed(loop: Prepared) -> Any:
        began = time.thread_time()
        result = compiled(loop)
        inside[0] += time.thread_time() - began
        return result

    values: Values = {}
    for kind, car in cars("gv").items():
        spent = []
        for _ in range(60):
            inside[0], began = 0.0, time.thread_time()
            signal = fresh()
            made = time.thread_time()
            with patch.object(Prepared, "__call__", timed):
                run = car.simulate(signal, "equilibrium")
                assert run.outputs is not None
            call = time.thread_time() - made
            spent.append((made - began, call, call - inside[0], made - began + call - run.seconds))
        parts = ("signal", "call", "Python", "beyond")
        for part, seconds in zip(parts, np.min(spent, axis=0), strict=True):
            values[f"fresh {kind} {part}, us"] = 1e6 * seconds
    simulate = partial(vm.simulate, VEHICLES["gv"][0])
    return values | cpu(
        {
            "cubic signal": partial(fresh, "cubic"),
            "by name": simulate,
            "by name with a fresh signal": lambda: simulate(maneuver=fresh()),
            "by name without errors": lambda: simulate(maneuver=fresh(), errors=False),
        }
    )


def batches() -> Values:
    """The ten thousand maneuvers of the task: wall clock, compiled loops, errors of some."""
    count, rng = 10_000, np.random.default_rng(1)
    t = np.linspace(0.0, 10.0, 201)
    rate, phase = rng.uniform(0.5, 4.0, (count, 3, 1)), rng.uniform(0.0, 6.28, (count, 3, 1))
    onset = np.tanh(np.maximum(t - 1.0, 0.0)) ** 2
    signals = vm.many_signals(t, 0.01 * onset * np.sin(rate * t + phase).sum(axis=1), hold="cubic")
    how: dict[str, Any] = {"outputs": ["lateral_position", "yaw", "Fz_FL"], "times": t[::2]}
    some = partial(vm.simulate_many, signals=signals[:100], outputs=ASIDE, times=t[::2])
    exact = some(vm.reduce(VEHICLES["gv"][0], "full_order", tolerance=1e-8))["values"]
    values: Values = {}
    for kind, car in cars("gv").items():
        values[f"batch {kind} off, m"] = float(abs(some(car)["values"] - exact).max())
        for jobs in (1, 2):
            taken = []
            for _ in range(2):
                began = time.perf_counter()
                found = vm.simulate_many(car, signals, **how, jobs=jobs)
                taken.append((time.perf_counter() - began, float(found["seconds"].sum())))
            for part, seconds in zip(("wall", "loops"), np.min(taken, axis=0), strict=True):
                values[f"batch {kind} {jobs} {part}, s"] = seconds
    return values


def scipy() -> Values:
    """One run through SciPy on the compiled rates, at an error like ours."""
    from scipy.integrate import solve_ivp

    car, u = cars("gv")["full"], MULTISINE[:, 0]
    signal, place = vm.Signal.from_samples(TIMES, u, "cubic"), car.output_names.index(ASIDE)

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        return car.rhs(x, [np.interp(t, TIMES, u)])

    solve = partial(
        solve_ivp, rates, (0.0, 10.0), car.state(), "LSODA", TIMES, rtol=1e-5, atol=1e-5
    )

    def own() -> np.ndarray:
        return car.reduced.simulate(signal, "equilibrium").outputs

    fine = car.model.simulate(signal, "equilibrium", TIMES, tolerance=1e-10).outputs[:, place]
    found = car.outputs(solve().y.T, u[:, None])[:, place]
    ours = car.model.simulate(signal, "equilibrium", TIMES, **COARSE).outputs[:, place]
    values = {"scipy off, m": np.abs(found - fine).max(), "own off, m": np.abs(ours - fine).max()}
    return values | cpu({"scipy run": solve, "own run": own}, rounds=3)


def files() -> Values:
    """The models that ship: load time and size."""
    paths = sorted(shipped_folder().glob("*.nc"))
    sizes = {f"size {path.stem}, kB": path.stat().st_size / 1000.0 for path in paths}
    return sizes | cpu({f"load {path.stem}": partial(vm.load, path) for path in paths}, rounds=5)


def exports() -> Values:
    """C: steps of 1 ms with outputs, by the driver that is exported.  FMU: 5 s through FMPy."""
    values: Values = {}
    t = np.linspace(0.0, 10.0, 10_001)
    for short, kind in (("gv", "reduced"), ("gv", "full"), ("hfv", "full")):
        car, label = cars(short)[kind], f"{short} {kind}"
        kinds = [np.sin(t), np.cos(t), -np.sin(t)]
        u = VEHICLES[short][1] * np.column_stack(kinds[: len(car.inputs)])
        with tempfile.TemporaryDirectory() as name:
            folder = vm.export(car, "c", Path(name) / "c")
            parts = [f"vehiclemor_{part}.c" for part in ("model", "step", "driver")]
            command = ["cc", "-std=c99", "-O2", "-o", "driver", *parts, "-lm"]
            subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - fixed words
            rows = [f"{len(u) - 1} 0.001", *(" ".join(map(repr, row)) for row in u.tolist())]
            how: dict[str, Any] = {"capture_output": True, "text": True, "check": True}
            driver = partial(subprocess.run, folder / "driver", input="\n".join(rows), **how)
            told = np.array([driver().stderr.split() for _ in range(5)], float).min(axis=0)
            for part, seconds in zip(("mean", "99.9 %", "largest"), told, strict=True):
                values[f"c {label} {part}, us"] = 1e6 * seconds
            unit = vm.export(car, "fmu", Path(name) / "car.fmu")
            values[f"fmu {label} size, kB"] = unit.stat().st_size / 1000.0
            values |= through_fmpy(unit, car, u[::10], f"fmu {label}")
    return values


def through_fmpy(unit: Path, car: Car, u: np.ndarray, label: str) -> Values:
    """Co-simulation of 5 s, inputs held for 10 ms, beside steps of our own."""
    from fmpy import simulate_fmu  # type: ignore[import-untyped]

    steps = 500
    fields = [("time", float), *((name, float) for name in car.inputs)]
    given = np.array([(t, *row) for t, row in zip(TIMES, u, strict=True)][: steps + 1], fields)
    times = {"stop_time": 5.0, "step_size": 0.01, "output_interval": 0.01}
    how = {"output": [ASIDE], "fmi_type": "CoSimulation", "validate": False}
    simulate = partial(simulate_fmu, str(unit), input=given, **times, **how)
    if car.method == "full_order":
        car = vm.reduce(car.model, "full_order", tolerance=1e-9)
    state = car.state()
    for k in range(steps):
        state = car.step(state, u[k], 0.01)
    own = car.outputs(state, u[steps - 1])[car.output_names.index(ASIDE)]
    values = {f"{label} off, m": abs(simulate()[ASIDE][-1] - own)}
    return values | cpu({f"{label} run": simulate}, rounds=3)


def closed_loops() -> Values:
    """The example of a driver in the double lane change."""
    example = runpy.run_path(str(EXAMPLES / "double_lane_change.py"))
    drive, speed = example["drive"], example["SPEED"]
    values: Values = {}
    for short, (name, _) in VEHICLES.items():
        reduced = vm.rom(name)
        full = vm.reduce(reduced.model, "full_order")
        start = vm.model(name, parameters={"initial_speed": speed}).start()
        expected, found = (drive(car, start)[0] for car in (full, reduced))
        samples = min(len(found), len(expected))
        off = np.abs(found[:samples] - expected[:samples]).max(axis=0)
        for output in ("longitudinal_position", ASIDE):
            values[f"driver {short} {output}, mm"] = 1e3 * off[full.output_names.index(output)]
        whole = cpu({"whole": partial(drive, reduced, start)}, rounds=5)["whole, us"]
        values[f"driver {short} round, us"] = whole / len(found)
    return values


def restarts() -> Values:
    """`pod` whose control periods begin at a measured state; NaN: diverged."""
    values: Values = {}
    for amplitude in (1.0, 1.2, 0.0, -1.0):
        for restart in ("own", "projected", "full_model"):
            changed = {"restart": restart, "amplitude": amplitude, "training": "nominal"}
            run = vm.simulate(VEHICLES["gv"][0], "pod", **changed)
            error = run["rms_error"].sel(output=ASIDE).item()
            values[f"restart {restart} {amplitude:g}, m"] = error
    return values


def kinks() -> Values:
    """What stops at kinks cost and bring: error of the lateral position, attempted steps."""
    car, rng, smooth = vm.model(VEHICLES["gv"][0]), np.random.default_rng(1), MULTISINE[:, 0]
    noise = np.abs(smooth).max() * rng.normal(size=len(TIMES))
    triangle = 0.02 / np.pi * np.arcsin(np.sin(0.2 * np.pi * (TIMES + 0.003)))
    signals = {"smooth": smooth, "triangle": triangle}
    signals |= {f"noise {part:g}": smooth + 0.01 * part * noise for part in (0.1, 1.0)}
    values: Values = {}
    for label, u in signals.items():
        signal = vm.Signal.from_samples(TIMES, u)

        def ending(rows: np.ndarray, signal: vm.Signal = signal) -> vm.Signal:
            pieces = signal.pieces._replace(edges=TIMES[rows], first=rows)
            return replace(signal, pieces=pieces, kept={})

        stops, moves = signal.pieces.first[1:-1], u[1:] != u[:-1]
        rests = stops[moves[stops - 1] != moves[stops]]
        through = ending(np.concatenate([[0], rests, [len(u) - 1]]))
        everywhere = ending(np.arange(len(u)))
        fine = car.simulate(everywhere, "equilibrium", tolerance=1e-10).outputs
        for how, inputs in (("stops", signal), ("through", through)):
            run = car.simulate(inputs, "equilibrium", **COARSE)
            off = np.abs(run.outputs - fine).max(axis=0)[car.outputs.index(ASIDE)]
            values[f"{label} {how} error, m"] = off
            values[f"{label} {how} steps, 1"] = run.counts["steps"] + run.counts["rejected_steps"]
    return values


def plans() -> Values:
    """The example of predictive control: cost of a plan, and how far the runs are apart."""
    example = runpy.run_path(str(EXAMPLES / "predictive_control.py"))
    control, drive = example["Controller"], example["drive"]
    reduced, full = vm.rom(example["MODEL"]), vm.reduce(example["MODEL"], "full_order")
    driven = {
        "reduced full": drive(control(reduced), full),
        "reduced reduced": drive(control(reduced), reduced),
        "full full": drive(control(full, 4), full),
    }
    values: Values = {}
    for name, run in driven.items():
        values[f"plan {name} time, ms"] = float(np.median(run["ms"]))
        values[f"plan {name} predictions, 1"] = run["evaluations"].mean()
        apart = np.abs(run["place"] - driven["reduced full"]["place"]).max(axis=0)
        for part, size in zip(("along, mm", "sideways, mm", "yaw, mrad"), apart, strict=True):
            values[f"plan {name} {part}"] = 1e3 * size
    return values


def measured(path: Path) -> None:
    """Measure every part, and keep the values with their units."""
    import xarray as xr

    values: Values = {}
    for part in (steps, runs, batches, scipy, files, exports, closed_loops, restarts, kinks, plans):
        began = time.perf_counter()
        values |= part()
        print(f"{part.__name__}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
    names, units = zip(*(name.rsplit(", ", 1) for name in values), strict=True)
    coordinates = {"name": list(names), "output_unit": ("name", list(units))}
    data = xr.Dataset({"value": ("name", [*map(float, values.values())])}, coordinates)
    make_folder(path.parent)
    write_dataset(data.assign_attrs(attributes("Models in use", "")), path)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    measured(parser.parse_args().results / "in_use.nc")


if __name__ == "__main__":
    main()
