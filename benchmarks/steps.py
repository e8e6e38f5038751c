"""Exported C at fixed steps: how long a step may be, what it costs, and what memory it takes.

Usage: python benchmarks/steps.py [--results DIR] [--again] [--arm]

A lane change at several speeds, with inputs known at the ends of the steps, against the accurate
full model.  Writes DIR/steps.json, which `paper/measured_numbers.py` reads, and prints tables; what
is stored is not measured again unless asked for.  The full car is exported at the speed that it
runs at, so that the linearly implicit step has the Jacobian of that speed.  With `--arm` the steps
are counted on emulated Cortex processors too, see `arm`.
"""

import argparse
import ctypes
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import vehiclemor as vm
from vehiclemor.error_measures import max_abs, rms
from vehiclemor.files import write_text
from vehiclemor.provenance import machine
from vehiclemor.study.plans.protocol import load_protocol

MANEUVERS = {
    "independent_suspension_vehicle": "lane_change",
    "high_fidelity_vehicle": "rack_lane_change",
}
RELAXED = "relaxation_vehicle"
# Held steering of steps that are counted, in rad, or of the rack in m.
ARM_STEERING = {"independent_suspension_vehicle": 0.02, "high_fidelity_vehicle": 0.003}
SPEEDS, NOMINAL = (5.0, 10.0, 20.0, 30.0), 20.0
DURATION = 10.0
# Steps in s that divide the duration; each implicit one is compiled on its own.
STEPS = {
    "rk4": (5e-4, 1e-3, 2e-3, 4e-3, 5e-3, 8e-3, 10e-3, 12.5e-3, 20e-3, 25e-3, 50e-3, 100e-3),
    "ros2": (2e-3, 5e-3, 10e-3, 20e-3, 25e-3, 50e-3, 100e-3),
}
# Outputs that a controller reads in every step.
READ = ("lateral_position", "yaw_rate", "lateral_speed")
# A run follows the reference if its position is never farther off, in m.
FAR = 1.0
# Parts of the bounds at which models are compared.
LEVELS = (1.0, 0.2)
ROUNDS, CALLS = 9, 5
RUNNER = """
#define _POSIX_C_SOURCE 199309L
#include <time.h>
#include "vehiclemor_model.h"

double run(const double *start, const double *inputs, long steps, double h, double *results)
{
    vehiclemor_real x[VEHICLEMOR_STATES], y[VEHICLEMOR_OUTPUTS], c[VEHICLEMOR_CONSTANTS + 1];
    vehiclemor_real u[2][VEHICLEMOR_INPUTS];
    struct timespec begin, end;
    long n;
    int i;
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] = (vehiclemor_real)start[i];
    for (i = 0; i < VEHICLEMOR_INPUTS; i++)
        u[0][i] = (vehiclemor_real)inputs[i];
    vehiclemor_constants(vehiclemor_parameters, c);
    vehiclemor_outputs(x, u[0], c, y);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begin);
    for (n = 0;; n++) {
        for (i = 0; i < VEHICLEMOR_OUTPUTS; i++)
            *results++ = y[i];
        if (n == steps)
            break;
        for (i = 0; i < VEHICLEMOR_INPUTS; i++)
            u[(n + 1) % 2][i] = (vehiclemor_real)inputs[(n + 1) * VEHICLEMOR_INPUTS + i];
        vehiclemor_step(x, u[n % 2], u[(n + 1) % 2], c, (vehiclemor_real)h);
        vehiclemor_outputs(x, u[(n + 1) % 2], c, y);
    }
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    return (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
}
"""
COMPILER = shutil.which("gcc") or "gcc"
MODEL, STEP = "vehiclemor_model", "vehiclemor_step"


class Subject(NamedTuple):
    """A model at a speed: what is exported, its first state, and the run it is judged by."""

    model: Any
    start: np.ndarray
    reference: Any


class Program:
    """Exported C as a shared library with a loop around the step."""

    def __init__(self, model: Any, optimised: str, **options: Any) -> None:
        self.outputs, self.temporary = options["outputs"], tempfile.TemporaryDirectory()
        self.folder = vm.export(model, "c", Path(self.temporary.name) / "c", **options)
        (self.folder / "runner.c").write_text(RUNNER)
        flags = ["-std=c99", optimised, "-fPIC", "-fstack-usage"]
        for name in (MODEL, STEP, "runner"):
            self._call(COMPILER, *flags, "-c", f"{name}.c")
        objects = [f"{name}.o" for name in (MODEL, STEP, "runner")]
        self._call(COMPILER, "-shared", "-o", "program.so", *objects, "-lm")
        self.code = ctypes.CDLL(str(self.folder / "program.so")).run
        self.code.restype = ctypes.c_double

    def _call(self, *command: str) -> str:
        done = subprocess.run(  # noqa: S603  (compiler and its tools)
            command, cwd=self.folder, check=True, capture_output=True, text=True
        )
        return done.stdout

    def run(self, start: np.ndarray, inputs: np.ndarray, step: float) -> tuple[float, np.ndarray]:
        """CPU seconds, and outputs (steps + 1, outputs) along inputs at the ends of steps."""
        results = np.empty((len(inputs), len(self.outputs)))
        given = (np.ascontiguousarray(array, float) for array in (start, inputs))
        start_at, inputs_at, results_at = (
            array.ctypes.data_as(ctypes.c_void_p) for array in (*given, results)
        )
        steps = ctypes.c_long(len(inputs) - 1)
        seconds = self.code(start_at, inputs_at, steps, ctypes.c_double(step), results_at)
        return seconds, results

    @property
    def memory(self) -> dict[str, int]:
        """Bytes of code and constants of model and step, and of the deepest stack of a step."""
        sizes = self._call("size", f"{MODEL}.o", f"{STEP}.o").splitlines()[1:]
        used = {}
        for name in (MODEL, STEP):
            for line in (self.folder / f"{name}.su").read_text().splitlines():
                function, count, _ = line.split("\t")
                used[function.rsplit(":", 1)[1]] = int(count)
        inside = max(used[f"vehiclemor_{name}"] for name in ("derivative", "outputs"))
        inside = max(inside, used.get("vehiclemor_solve", 0))
        code = sum(sum(map(int, line.split()[:2])) for line in sizes)
        return {"code": code, "stack": used["vehiclemor_step"] + inside}


@cache
def full_run(vehicle: str, name: str, speed: float) -> tuple[Any, Any, Any]:
    """Model at a speed, its maneuver, and the accurate run at every half millisecond."""
    car = vm.model(name, {"initial_speed": speed})
    # No more lateral acceleration than at the nominal speed.
    maneuver = vm.maneuver(MANEUVERS[vehicle], amplitude=min(1.0, (NOMINAL / speed) ** 2))
    times = np.linspace(0.0, DURATION, 20001)
    return car, maneuver, car.simulate(maneuver, times=times, tolerance=1e-10)


def subjects(vehicle: str, speed: float) -> dict[str, Subject]:
    """Label -> what is compared at a speed."""
    car, _, reference = full_run(vehicle, vehicle, speed)
    rom, track = vm.rom(vehicle), vm.reduce(car, "linear_single_track")
    start = car.start()
    found = {"full": Subject(car, start, reference)}
    if vehicle == "independent_suspension_vehicle":
        relaxed, _, own = full_run(vehicle, RELAXED, speed)
        found["relaxed tires (itself)"] = Subject(relaxed, relaxed.start(), own)
        found["relaxed tires"] = Subject(relaxed, relaxed.start(), reference)
    found["reduced"] = Subject(rom, rom.state(start), reference)
    found["single track"] = Subject(track, track.state(start), reference)
    return found


def inputs_of(vehicle: str, speed: float, step: float) -> np.ndarray:
    """Inputs at the ends of steps."""
    maneuver = full_run(vehicle, vehicle, speed)[1]
    return maneuver.at(np.linspace(0.0, DURATION, round(DURATION / step) + 1))


def score(vehicle: str, subject: Subject, results: np.ndarray, step: float) -> dict[str, float]:
    """Largest error as a multiple of its bound, and distance to the reference in m."""
    bounds, scores = load_protocol(f"predictive-{vehicle}").definition.bounds, []
    names = list(bounds)
    wanted = subject.reference.chosen(names).outputs[:: round(step / 5e-4)]
    errors = results[:, : len(names)] - wanted
    if not np.isfinite(errors).all():
        return {"score": float("inf"), "distance": float("inf")}
    for column, bound in zip(errors.T, bounds.values(), strict=True):
        measure = {"max": max_abs, "rms": rms}[bound.measure]
        scores.append(float(measure(column[:, None])[0]) / bound.bound)
    places = [names.index(f"{direction}_position") for direction in ("longitudinal", "lateral")]
    return {"score": max(scores), "distance": float(np.abs(errors[:, places]).max())}


def scan(vehicle: str, speed: float) -> list[dict[str, Any]]:
    """Errors of all models, integrators and steps at a speed."""
    rows, outputs = [], tuple(load_protocol(f"predictive-{vehicle}").definition.bounds)
    for label, subject in subjects(vehicle, speed).items():
        for integrator, steps in STEPS.items():
            program = None
            for step in steps:
                if program is None or integrator == "ros2":
                    options = {"step": step, "integrator": integrator, "outputs": outputs}
                    program = Program(subject.model, "-O1", **options)
                inputs = inputs_of(vehicle, speed, step)
                with np.errstate(all="ignore"):
                    _, results = program.run(subject.start, inputs, step)
                    errors = score(vehicle, subject, results, step)
                case = {"model": label, "integrator": integrator, "speed": speed, "step": step}
                rows.append(case | errors)
    return rows


def costs(vehicle: str) -> list[dict[str, Any]]:
    """Time of a step with three outputs, and memory, of all that is compared."""
    rows, runs = [], []
    step = 0.005
    for label, subject in subjects(vehicle, NOMINAL).items():
        for integrator in STEPS:
            for precision in ("double", "single"):
                case = {"integrator": integrator, "precision": precision}
                program = Program(subject.model, "-O3", step=step, outputs=READ, **case)
                rows.append({"model": label} | case | program.memory)
                runs.append((program, subject.start))
    inputs, best = inputs_of(vehicle, NOMINAL, step), [float("inf")] * len(runs)
    for _ in range(ROUNDS):
        for i, (program, start) in enumerate(runs):
            seconds = min(program.run(start, inputs, step)[0] for _ in range(CALLS))
            best[i] = min(best[i], seconds)
    for row, seconds in zip(rows, best, strict=True):
        row["nanoseconds"] = 1e9 * seconds / (len(inputs) - 1)
    return rows


def on_arm(vehicle: str) -> dict[str, Any]:
    """Instructions of a step with three outputs, and memory, on Cortex processors.

    Empty, with a line that says so, where tools are missing.
    """
    # Beside this file where it is a script; who reads its numbers does not need it.
    import arm

    if missing := arm.missing():
        print(f"no Cortex processor is emulated: {missing} not installed")
        return {}
    rows, exported, held = [], subjects(vehicle, NOMINAL), ARM_STEERING[vehicle]
    for model, integrator, name in product(("full", "reduced"), STEPS, arm.PROCESSORS):
        options = {"integrator": integrator, "step": 0.005, "outputs": READ}
        cost = arm.cost(exported[model].model, arm.PROCESSORS[name], held, **options)
        rows.append({"model": model, "integrator": integrator, "processor": name} | cost)
    return {"about": arm.about(), "rows": rows}


def longest(rows: list[dict[str, Any]], measure: str, limit: float) -> float:
    """Longest step for which it and all shorter ones keep a limit; 0 if there is none."""
    found = 0.0
    for row in sorted(rows, key=lambda row: row["step"]):
        if not row[measure] <= limit:
            break
        found = row["step"]
    return found


def reached(part: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Of each model, integrator, speed and part of the bounds the longest step, in s.

    With the time of a simulated second, in us; both are 0 where no step keeps the bounds.
    """
    for cost in part["costs"]:
        case = {name: cost[name] for name in ("model", "integrator")}
        for speed, level in product(SPEEDS, LEVELS) if cost["precision"] == "double" else ():
            wanted = case | {"speed": speed}
            rows = [row for row in part["scan"] if wanted.items() <= row.items()]
            step = longest(rows, "score", level)
            time = 1e-3 * cost["nanoseconds"] / step if step else 0.0
            more = {"follows": longest(rows, "distance", FAR), "least": _least(rows, "score")}
            yield wanted | {"level": level, "step": step, "time": time} | more


def fastest(part: dict[str, Any], model: str, speed: float, level: float) -> dict[str, Any]:
    """The integrator that takes the least time within a part of the bounds; empty if none does."""
    wanted = {"model": model, "speed": speed, "level": level}.items()
    rows = [row for row in reached(part) if wanted <= row.items() and row["step"]]
    return min(rows, key=lambda row: row["time"], default={})


def tables(vehicle: str, part: dict[str, Any]) -> str:
    """Tables of a vehicle."""
    lines = [f"## {vehicle}", "", part["about"], ""]
    heads = ["model", "integrator", "precision", "ns a step", "code B", "stack B"]
    lines += [_row(heads), _row(["---"] * len(heads))]
    for cost in part["costs"]:
        numbers = [f"{cost[name]:.0f}" for name in ("nanoseconds", "code", "stack")]
        lines.append(_row([*(cost[name] for name in heads[:3]), *numbers]))
    heads = ["speed m/s", "model", "integrator", "follows to 1 m: ms", "part of bounds", "ms"]
    heads += ["us a simulated s", "least error, bounds"]
    lines += ["", _row(heads), _row(["---"] * len(heads))]
    for row in sorted(reached(part), key=lambda row: row["speed"]):
        cells = [f"{row['speed']:g}", row["model"], row["integrator"], f"{1e3 * row['follows']:g}"]
        cells += [f"{row['level']:g}", f"{1e3 * row['step']:g}" if row["step"] else "none"]
        lines.append(_row([*cells, f"{row['time']:.3g}", f"{row['least']:.2g}"]))
    lines += ["", _row(["speed m/s", "part of bounds", "fastest full", "fastest reduced", "gain"])]
    lines.append(_row(["---"] * 5))
    for speed, level in product(SPEEDS, LEVELS):
        both = [fastest(part, model, speed, level) for model in ("full", "reduced")]
        form = "{time:.3g} us ({integrator}, {step:g} s)"
        cells = [form.format(**row) if row else "none" for row in both]
        gain = f"{both[0]['time'] / both[1]['time']:.1f}" if all(both) else ""
        lines.append(_row([f"{speed:g}", f"{level:g}", *cells, gain]))
    if part.get("arm"):
        lines += ["", part["arm"]["about"], "", _row(part["arm"]["rows"][0])]
        lines.append(_row(["---"] * len(part["arm"]["rows"][0])))
        lines += [_row(row.values()) for row in part["arm"]["rows"]]
    return "\n".join(lines)


def _least(rows: list[dict[str, Any]], measure: str) -> float:
    return min(row[measure] for row in rows)


def _row(cells: Iterable[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def about() -> str:
    """Compiler, its options and processor."""
    version = subprocess.run(  # noqa: S603
        [COMPILER, "--version"], capture_output=True, text=True, check=True
    ).stdout.splitlines()[0]
    cpu = re.sub(r"\s+", " ", machine())
    how = f"CPU time, minimum of {ROUNDS} rounds; {len(READ)} outputs"
    return f"{version}, -std=c99 -O3; {cpu}; {how}"


def main() -> None:
    """Measure what is not stored, then print the tables."""
    parser = argparse.ArgumentParser(description="exported C at fixed steps")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--again", action="store_true", help="measure what is stored once more")
    parser.add_argument("--arm", action="store_true", help="count on emulated Cortex processors")
    given = parser.parse_args()
    path = given.results / "steps.json"
    content = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for vehicle in MANEUVERS:
        if given.again or vehicle not in content:
            part: dict[str, Any] = {"about": about(), "costs": costs(vehicle), "scan": []}
            for speed in SPEEDS:
                part["scan"] += scan(vehicle, speed)
            content[vehicle] = part
        if given.arm:
            content[vehicle]["arm"] = on_arm(vehicle)
        write_text(path, json.dumps(content, indent=1) + "\n")
        print(tables(vehicle, content[vehicle]), end="\n\n")


if __name__ == "__main__":
    main()
