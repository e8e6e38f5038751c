"""Measures models in use: steps, calls, batches, files, exports, closed loops, predictive control.

Usage: python paper/in_use.py [--results DIR]

Writes DIR/in_use.nc, named values with units, which `paper/facts.py` writes into the texts.  It
takes about three minutes and needs a C compiler and FMPy.  Times are CPU times of the thread,
minima over interleaved rounds, where nothing else is said.
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
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

import vehiclemor as vm
from vehiclemor.codegen.loops import Prepared
from vehiclemor.online.rom import ReducedOrderModel as Car
from vehiclemor.online.saved import shipped_folder
from vehiclemor.piecewise import quiet_ends
from vehiclemor.registry import component
from vehiclemor.study.provenance import attributes
from vehiclemor.study.store import read_dataset, write_dataset

if TYPE_CHECKING:
    import xarray as xr

ROOT = Path(__file__).resolve().parents[1]
FILE, TITLE = "in_use.nc", "Models in use"
# Short name of a vehicle -> its model, and a steering input that it is stepped with.
VEHICLES = {
    "gv": ("independent_suspension_vehicle", 0.02),
    "hfv": ("high_fidelity_vehicle", -0.003),
}
COARSE = {"solver": "ros34pw2", "tolerance": 2e-3}
# Ten seconds at 100 Hz.
TIMES = np.linspace(0.0, 10.0, 1001)
# Name -> value and unit.
Values = dict[str, tuple[float, str]]


def cars(short: str) -> dict[str, Car]:
    """The reduced model that ships, and the full one behind the same methods."""
    reduced = vm.rom(VEHICLES[short][0])
    return {"reduced": reduced, "full": vm.reduce(reduced.model, "full_order", **COARSE)}


def cpu(functions: dict[str, Callable[[], Any]], rounds: int = 15, spent: float = 4e-3) -> Values:
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
    return {name: (1e6 * seconds, "us") for name, seconds in least.items()}


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
            calls |= {
                f"{short} {kind} step": lambda car=car, x=x, u=u: car.step(x, u, 0.01),
                f"{short} {kind} rhs": lambda car=car, x=x, u=u: car.rhs(x, u),
                f"{short} {kind} jacobian": lambda car=car, x=x, u=u: car.jacobian(x, u),
                f"{short} {kind} differences": lambda car=car, x=x, u=u: central_differences(
                    car, x, u
                ),
                f"{short} {kind} outputs": lambda car=car, x=x, u=u: car.outputs(x, u),
                f"{short} {kind} trust": lambda car=car, x=x, u=u: car.trust(x, u),
            }
    return cpu(calls)


def runs() -> Values:
    """Whole calls with a signal that was never seen: outside of compiled loops, and by name."""
    number = iter(range(1_000_000))
    u = component("maneuver", "multisine").at(TIMES)

    def fresh() -> vm.Signal:
        return vm.Signal.from_samples(TIMES, u * (1.0 - 1e-6 * next(number)))

    inside, compiled = [0.0], Prepared.__call__

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
                car.simulate(signal, "equilibrium")
            call = time.thread_time() - made
            spent.append((made - began, call, call - inside[0]))
        parts = zip(("signal", "call", "Python"), np.min(spent, axis=0), strict=True)
        values |= {f"fresh {kind} {part}": (1e6 * seconds, "us") for part, seconds in parts}
    name = VEHICLES["gv"][0]
    return values | cpu(
        {
            "by name": lambda: vm.simulate(name),
            "by name, fresh": lambda: vm.simulate(name, maneuver=fresh()),
            "by name, fresh, no errors": lambda: vm.simulate(name, maneuver=fresh(), errors=False),
        }
    )


def batches() -> Values:
    """The ten thousand maneuvers of the handbook: wall clock, and the compiled loops in it."""
    count, rng = 10_000, np.random.default_rng(1)
    t = np.linspace(0.0, 10.0, 201)
    rate, phase = rng.uniform(0.5, 4.0, (count, 3, 1)), rng.uniform(0.0, 6.28, (count, 3, 1))
    onset = np.tanh(np.maximum(t - 1.0, 0.0)) ** 2
    signals = vm.Signals(t, 0.01 * onset * np.sin(rate * t + phase).sum(axis=1), hold="cubic")
    how: dict[str, Any] = {"outputs": ["lateral_position", "yaw", "Fz_FL"], "times": t[::2]}
    values: Values = {}
    for kind, car in cars("gv").items():
        vm.simulate_many(car, signals[:64], **how)
        for jobs in (1, 2):
            taken = []
            for _ in range(2):
                began, used = time.perf_counter(), time.process_time()
                found = vm.simulate_many(car, signals, **how, jobs=jobs)
                now = time.perf_counter() - began, time.process_time() - used
                taken.append((*now, float(found["seconds"].sum())))
            least = np.min(taken, axis=0)
            names = ("wall", "cpu", "loops")
            label = f"batch {kind} {jobs}"
            values |= {f"{label} {n}": (x, "s") for n, x in zip(names, least, strict=True)}
        handed = float((found["remark"] != "").sum())
        values[f"batch {kind} remarks"] = (handed, "1")
    return values


def scipy() -> Values:
    """One of such runs through SciPy on the compiled rates, at an error like ours."""
    from scipy.integrate import solve_ivp

    car = cars("gv")["full"]
    u = component("maneuver", "multisine").at(TIMES)[:, 0]
    signal, seen = vm.Signal.from_samples(TIMES, u, "cubic"), car.output_names
    place = seen.index("lateral_position")
    fine = car.model.simulate(signal, "equilibrium", tolerance=1e-10).outputs[:, place]

    def solve() -> Any:
        def rates(t: float, x: np.ndarray) -> np.ndarray:
            return car.rhs(x, [np.interp(t, TIMES, u)])

        at = np.linspace(0.0, 10.0, len(fine))
        return solve_ivp(rates, (0.0, 10.0), car.state(), "LSODA", at, rtol=1e-5, atol=1e-5)

    found = car.outputs(solve().y.T, np.interp(np.linspace(0, 10, len(fine)), TIMES, u)[:, None])
    own = car.reduced.simulate(signal, "equilibrium").outputs
    values: Values = {
        "scipy error": (np.abs(found[:, place] - fine).max(), "m"),
        "own error": (np.abs(own[:, place] - fine).max(), "m"),
    }
    return values | cpu(
        {
            "scipy run": solve,
            "own run": lambda: car.reduced.simulate(signal, "equilibrium"),
        },
        rounds=3,
    )


def files() -> Values:
    """The models that ship: load time and size."""
    paths = sorted(shipped_folder().glob("*.nc"))
    sizes: Values = {f"size {p.stem}": (p.stat().st_size / 1000.0, "kB") for p in paths}
    return sizes | cpu({f"load {p.stem}": lambda p=p: vm.load(p) for p in paths}, rounds=5)


def exports() -> Values:
    """C: steps of 1 ms with outputs, by the driver that is exported.  FMU: 5 s through FMPy."""
    import fmpy  # type: ignore[import-untyped]

    values: Values = {}
    for short, kind in (("gv", "reduced"), ("gv", "full"), ("hfv", "full")):
        car, label = cars(short)[kind], f"{short} {kind}"
        size = VEHICLES[short][1]
        t = np.linspace(0.0, 10.0, 10_001)
        kinds = [np.sin(t), np.cos(t), -np.sin(t)]
        u = size * np.column_stack(kinds[: len(car.inputs)])
        with tempfile.TemporaryDirectory() as name:
            folder = vm.export(car, "c", Path(name) / "c")
            parts = [f"vehiclemor_{part}.c" for part in ("model", "step", "driver")]
            command = ["cc", "-std=c99", "-O2", "-o", "driver", *parts, "-lm"]
            subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - fixed words
            rows = [f"{len(u) - 1} 0.001", *(" ".join(map(repr, row)) for row in u.tolist())]
            told = [
                subprocess.run(  # noqa: S603 - what was compiled just now
                    [folder / "driver"],
                    input="\n".join(rows),
                    capture_output=True,
                    text=True,
                    check=True,
                ).stderr.split()
                for _ in range(5)
            ]
            taken = 1e6 * np.min(np.array(told, float), axis=0)
            names = ("mean", "99.9 %", "largest")
            values |= {f"c {label} {n}": (x, "us") for n, x in zip(names, taken, strict=True)}
            unit = vm.export(car, "fmu", Path(name) / "car.fmu")
            values[f"fmu {label} size"] = (unit.stat().st_size / 1000.0, "kB")
            values |= through_fmpy(fmpy, unit, car, u[::10], f"fmu {label}")
    return values


def through_fmpy(fmpy: Any, unit: Path, car: Car, u: np.ndarray, label: str) -> Values:
    """Co-simulation of 5 s, inputs held for 10 ms, beside steps of our own."""
    fields = [("time", float), *((name, float) for name in car.inputs)]
    samples = 501
    rows = [(t, *row) for t, row in zip(TIMES[:samples], u[:samples], strict=True)]
    given = np.array(rows, dtype=fields)
    how = {"output": ["lateral_position"], "fmi_type": "CoSimulation", "validate": False}
    times = {"stop_time": 5.0, "step_size": 0.01, "output_interval": 0.01}

    def simulate() -> Any:
        return fmpy.simulate_fmu(str(unit), input=given, **times, **how)

    if car.method == "full_order":
        car = vm.reduce(car.model, "full_order", tolerance=1e-9)
    state = car.state()
    for k in range(samples - 1):
        state = car.step(state, u[k], 0.01)
    place = car.output_names.index("lateral_position")
    off = simulate()["lateral_position"][-1] - car.outputs(state, u[samples - 2])[place]
    values: Values = {f"{label} off": (abs(off), "m")}
    return values | cpu({f"{label} run": simulate}, rounds=3)


def closed_loops() -> Values:
    """The examples: a driver in the double lane change, and a steering column beside the car."""
    lanes = runpy.run_path(str(ROOT / "examples" / "double_lane_change.py"))
    values: Values = {}
    speed = 80.0 / 3.6
    for short, (name, _) in VEHICLES.items():
        reduced = vm.rom(name)
        full = vm.reduce(reduced.model, "full_order")
        start = vm.model(name, parameters={"initial_speed": speed}).start()
        (expected, _), (found, known) = (lanes["drive"](c, start, speed) for c in (full, reduced))
        samples = min(len(found), len(expected))
        off = np.abs(found[:samples] - expected[:samples]).max(axis=0)
        for output in ("longitudinal_position", "lateral_position"):
            column = full.output_names.index(output)
            values[f"driver {short} {output}"] = (1e3 * off[column], "mm")
        values[f"driver {short} indicator"] = (known, "1")
        whole = cpu({"": lambda r=reduced, s=start: lanes["drive"](r, s, speed)}, rounds=5)
        values[f"driver {short} round"] = (whole[""][0] / len(found), "us")
    drive = runpy.run_path(str(ROOT / "examples" / "steering_cosimulation.py"))["drive"]
    reduced = vm.rom(VEHICLES["gv"][0])
    full = vm.reduce(reduced.model, "full_order")
    place, finely = full.output_names.index("lateral_position"), drive(full, 2.5e-3)
    for step in (0.02, 0.01):
        off = np.abs(drive(full, step) - finely[:: round(step / 2.5e-3)]).max(axis=0)
        values[f"coupling {step:g}"] = (1e3 * off[place], "mm")
    off = np.abs(drive(reduced, 0.01) - drive(full, 0.01)).max(axis=0)
    return values | {"coupling reduced": (1e3 * off[place], "mm")}


def restarts() -> Values:
    """`pod` whose control periods begin at a measured state; NaN: diverged."""
    values: Values = {}
    for amplitude in (1.0, 1.2, 0.0, -1.0):
        for restart in ("own", "projected", "full_model"):
            changed = {"restart": restart, "amplitude": amplitude, "training": "nominal"}
            run = vm.simulate(VEHICLES["gv"][0], "pod", **changed)
            error = run["rms_error"].sel(output="lateral_position").item()
            values[f"restart {restart} {amplitude:g}"] = (error, "m")
    return values


def kinks() -> Values:
    """What stops at kinks cost and bring: error of the lateral position, attempted steps."""
    car, rng = vm.model(VEHICLES["gv"][0]), np.random.default_rng(1)
    smooth = component("maneuver", "multisine").at(TIMES)[:, 0]
    noise = np.abs(smooth).max() * rng.normal(size=len(TIMES))
    triangle = 0.02 / np.pi * np.arcsin(np.sin(0.2 * np.pi * (TIMES + 0.003)))
    place = car.outputs.index("lateral_position")
    values: Values = {}
    for label, u in {
        "smooth": smooth,
        "noise 0.1": smooth + 1e-3 * noise,
        "noise 1": smooth + 1e-2 * noise,
        "triangle": triangle,
    }.items():
        signal = vm.Signal.from_samples(TIMES, u)
        rests = [0, *np.flatnonzero(quiet_ends(TIMES, u[1:] != u[:-1])) + 1, len(u) - 1]
        ends = {"everywhere": np.arange(len(u)), "through": np.array(rests)}
        cut = {
            how: replace(signal, pieces=signal.pieces._replace(edges=TIMES[at], first=at), kept={})
            for how, at in ends.items()
        }
        fine = car.simulate(cut["everywhere"], "equilibrium", tolerance=1e-10).outputs
        for how, inputs in (("stops", signal), ("through", cut["through"])):
            run = car.simulate(inputs, "equilibrium", **COARSE)
            off = np.abs(run.outputs - fine).max(axis=0)[place]
            attempts = run.counts["steps"] + run.counts["rejected_steps"]
            values |= {f"{label} {how} error": (off, "m"), f"{label} {how} steps": (attempts, "1")}
    return values


def plans() -> Values:
    """The example of predictive control: cost of a plan, and how far the runs are apart."""
    example = runpy.run_path(str(ROOT / "examples" / "predictive_control.py"))
    control, drive = example["Controller"], example["drive"]
    reduced, full = vm.rom(example["MODEL"]), vm.reduce(example["MODEL"], "full_order")
    driven = {
        "reduced full": drive(control(reduced), full),
        "reduced reduced": drive(control(reduced), reduced),
        "full full": drive(control(full, 4), full),
    }
    values: Values = {}
    first = driven["reduced full"]["place"]
    for name, run in driven.items():
        apart = 1e3 * np.abs(run["place"] - first).max(axis=0)
        values |= {
            f"plan {name} time": (float(np.median(run["ms"])), "ms"),
            f"plan {name} predictions": (run["evaluations"].mean(), "1"),
            f"plan {name} along": (apart[0], "mm"),
            f"plan {name} sideways": (apart[1], "mm"),
            f"plan {name} yaw": (apart[2], "mrad"),
        }
    return values


def measured(folder: Path, anew: bool = False) -> xr.Dataset:
    """What the results folder holds; measured where it lacks it, or once more."""
    import xarray as xr

    path = folder / FILE
    if anew or not path.exists():
        values: Values = {}
        parts = (steps, runs, batches, scipy, files, exports, closed_loops, restarts, kinks, plans)
        for part in parts:
            began = time.perf_counter()
            values |= part()
            print(f"{part.__name__}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
        numbers, units = zip(*values.values(), strict=True)
        coordinates = {"name": list(values), "output_unit": ("name", list(units))}
        data = xr.Dataset({"value": ("name", np.array(numbers, float))}, coordinates)
        folder.mkdir(parents=True, exist_ok=True)
        write_dataset(data.assign_attrs(attributes(TITLE, "")), path)
    return read_dataset(path, "title", TITLE)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    measured(parser.parse_args().results, anew=True)


if __name__ == "__main__":
    main()
