"""What all peers share: cases, the clock, and errors.

A comparison is a set of curves over one tolerance, or step size: error and seconds of each point.
Seconds are those of whole calls, states or outputs delivered, in interleaved rounds.
"""

import gc
import importlib
import math
import os
import statistics
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import vehiclemor as vm
from vehiclemor.inputs import steering

# Calls of a round, the first a warm-up, of what takes less than so many seconds.
REPEATS, SHORT = 4, 5e-3
# Seconds of a call -> rounds at most; and those beyond which no tighter tolerance is tried.
ROUNDS, TOO_LONG = {0.05: 9, 1.2: 2, math.inf: 1}, 4.5
# Above (times the loosest target) nothing is timed.
FAR_OFF = 10.0


class Curve(NamedTuple):
    """One way to compute a case: a scan over tolerances, the loosest first."""

    make: Callable[[float], Callable[[], Any]]  # a call that is ready to run again and again
    tolerances: Sequence[float]
    read: Callable[[Any], np.ndarray] = np.asarray  # of what is returned, for the reference
    delivers: str = "states"
    counts: Callable[[Any], int] | None = None  # of what is returned: calls of the rhs


@dataclass(frozen=True, eq=False)
class Case:
    """What is computed: a model, its maneuver and start, and the reference."""

    kind: str  # the function of a peer that is asked
    title: str
    unit: str
    targets: tuple[float, ...]  # errors for which peers are compared
    model: Any
    maneuver: Any
    reference: np.ndarray
    more: Any = None  # held inputs, signals of a batch, or step sizes of a structure
    per: tuple[int, str] = (1, "")  # what times are divided by
    scale: Any = 1.0  # of errors
    clock: str = "thread_time"  # of the process instead where a peer starts threads

    @property
    def start(self) -> np.ndarray:
        """State at rest in straight running."""
        return self.model.start("equilibrium")

    @property
    def racked(self) -> bool:
        """Whether the inputs are place, speed and acceleration of the rack."""
        return len(self.model.inputs) > 1

    @property
    def lateral(self) -> int:
        """Place of the lateral position among the states."""
        return int(self.model.planar[1])

    def by_parts(self, part: Callable[[np.ndarray, np.ndarray, bool], np.ndarray]) -> np.ndarray:
        """States of a run, integrated anew in each part: of a state, times, whether it steers."""
        times, parts = smooth_parts(self.maneuver)
        states = np.empty((len(times), len(self.start)))
        states[0] = self.start
        for first, last, moves in parts:
            states[first : last + 1] = part(states[first], times[first : last + 1], moves)
        return states

    def loop(self, step: Callable, state: Any, inputs: Iterable[Any]) -> np.ndarray:
        """Lateral position after each step, a call of Python: (state, input, dt) -> state."""
        found = np.empty(len(self.reference))
        for k, u in enumerate(inputs):
            state = step(state, u, 0.01)
            found[k] = state[self.lateral]
        return found


def smooth_parts(signal: Any) -> tuple[np.ndarray, list[tuple[int, int, bool]]]:
    """Times with the break points; first and last of each smooth part, whether it steers."""
    breaks = np.round(signal.break_points, 9)
    times = np.union1d(np.round(signal.times, 9), breaks)
    edges = [0, *np.searchsorted(times, breaks).tolist(), len(times) - 1]
    return times, list(zip(edges, edges[1:], (False, True, False), strict=False))


def decades(first: float, last: float, each: int = 4) -> list[float]:
    """Tolerances from the loosest to the tightest, so many in each decade."""
    count = round(math.log10(first / last) * each) + 1
    return np.geomspace(first, last, count).tolist()


def pulse(time_: Any, functions: Any, racked: bool, amplitude: Any = 1.0, speed: Any = 1.0) -> list:
    """Inputs of a lane change while the steering moves, by the functions of any library.

    Peers call back into it: `maneuver.at`, for arrays of times, would cost more than the car.
    """
    size, rate = pulse_shape(racked, amplitude, speed)
    a = rate * (time_ - steering.BEGIN)
    sine, sine_2 = functions.sin(a), functions.sin(2.0 * a)
    found = [size * (sine - 0.5 * sine_2)]
    if racked:
        found.append(size * rate * (functions.cos(a) - functions.cos(2.0 * a)))
        found.append(size * rate**2 * (2.0 * sine_2 - sine))
    return found


def pulse_shape(racked: bool, amplitude: Any = 1.0, speed: Any = 1.0) -> tuple[Any, Any]:
    """Size and angular frequency of a lane change."""
    size = steering.RACK_AMPLITUDE if racked else steering.LANE_CHANGE_AMPLITUDE
    return amplitude * size, 2.0 * math.pi * speed / steering.LANE_CHANGE_LENGTH


def callback(case: Case) -> Callable[[float, np.ndarray, bool], np.ndarray]:
    """The fastest documented right-hand side for Python: f(t, x, whether the steering moves)."""
    rhs, racked = case.model.bare("rhs"), case.racked
    rates, state, u = np.empty(len(case.start)), case.start, np.zeros(len(case.model.inputs))

    def function(t: float, x: np.ndarray, moves: bool) -> np.ndarray:
        state[:] = x  # what solvers pass may be read-only
        u[:] = pulse(t, math, racked) if moves else 0.0
        rhs(state, u, rates)
        return rates

    return function


def library(folder: str, *arguments: object) -> str:
    """Path of a shared library, by the C compiler of this machine."""
    path, compiler = f"{folder}/peer.so", os.environ.get("CC", "cc")
    command = [compiler, "-march=native", "-shared", "-fPIC", "-w", *arguments, "-o", path]
    subprocess.run(list(map(str, command)), check=True)  # noqa: S603
    return path


def collected(peers: Iterable[str], kind: str, *given: Case) -> tuple[dict, dict[str, str]]:
    """What the peers have of a kind by label, and name of a peer -> why it has none."""
    found, missing = {}, {}
    for name in peers:
        try:
            found |= getattr(importlib.import_module(name), kind)(*given)
        except ImportError as error:
            missing[name] = f"not installed ({error})"
        except Exception as error:  # noqa: BLE001  (what a peer raises is a row, no crash)
            missing[name] = f"failed: {type(error).__name__}: {error}".splitlines()[0]
    return found, missing


def measured(curves: Mapping[str, Curve], case: Case) -> dict[str, Any]:
    """Error and seconds of all points of all curves, timed in rounds over all of them."""
    clock, found, calls = getattr(time, case.clock), {}, []
    for label, curve in curves.items():
        points, ready = scanned(curve, case, clock)
        found[label] = {"delivers": curve.delivers, "points": points}
        calls += [(point, call, []) for point, call in zip(points, ready, strict=True)]
        print(f"  {label}: {len(ready)} points", flush=True)
    gc.collect()
    gc.disable()
    for turn in range(max(ROUNDS.values())):
        for point, call, seconds in calls:
            expected = point["seconds"]
            if turn < next(rounds for length, rounds in ROUNDS.items() if expected < length):
                seconds.append(seconds_of(call, expected, clock))
    gc.enable()
    for point, _, seconds in calls:
        point["seconds"] = min(seconds)
        point["spread"] = [min(seconds), statistics.median(seconds), max(seconds)]
    return found


def scanned(curve: Curve, case: Case, clock: Callable) -> tuple[list[dict], list[Callable]]:
    """Points of a curve with the seconds of a first call, and their calls; one that fails isn't."""
    points, ready = [], []
    for tolerance in curve.tolerances:
        try:
            call = curve.make(tolerance)
            call()
            began = clock()
            result = call()
            first = clock() - began
            off = (curve.read(result) - case.reference) / case.scale
            error = float(np.abs(off).max())
        except Exception as raised:  # noqa: BLE001  (as above)
            print(f"  {tolerance:.1e}: {type(raised).__name__}: {raised}"[:160])
            continue
        if not error < FAR_OFF * max(case.targets):
            continue
        points.append({"tolerance": tolerance, "error": error, "seconds": first})
        if curve.counts is not None:
            points[-1]["evaluations"] = int(curve.counts(result))
        ready.append(call)
        if first > TOO_LONG:
            break
    return points, ready


def seconds_of(call: Callable[[], Any], expected: float, clock: Callable[[], float]) -> float:
    """Seconds of a call; of a short one the median of some in a row, the first a warm-up."""
    seconds = []
    for _ in range(1 if expected > SHORT else REPEATS):
        began = clock()
        call()
        seconds.append(clock() - began)
    return statistics.median(seconds[1:] or seconds)


def lane_change(name: str) -> tuple[Any, Any]:
    """A vehicle and its maneuver."""
    model = vm.model(name)
    return model, vm.maneuver(model.definition.maneuver)


def vehicle(name: str) -> Case:
    """The lane change of a vehicle, lateral position at all output times."""
    model, maneuver = lane_change(name)
    exact = model.simulate(maneuver, "equilibrium", solver="dopri5", tolerance=1e-11)
    title = f"{name}, {maneuver.name}, {maneuver.duration:g} s"
    targets = 2e-2, 1e-3, 3e-5, 5e-6
    return Case("run", title, "m", targets, model, maneuver, exact["lateral_position"])


def held_steps(name: str) -> Case:
    """The same lane change in 500 steps of 10 ms, as a controller sends it: held inputs."""
    model, maneuver = lane_change(name)
    held = [np.array(u) for u in maneuver.at(np.arange(500) * 0.01)]
    title = f"{name}, 500 steps of 10 ms with held inputs, from Python"
    how = {"more": held, "per": (500, "step")}
    case = Case("steps", title, "m", (2e-2, 1e-3, 3e-5), model, maneuver, np.empty(500), **how)
    exact = vm.reduce(model, "full_order", solver="dopri5", tolerance=1e-11)
    return replace(case, reference=case.loop(exact.step, case.start, held))


def batch(name: str, runs: int = 200) -> Case:
    """Lane changes of other length and size, at all output times of the first 10 s."""
    model, maneuver = lane_change(name)
    maneuver = replace(maneuver, duration=10.0, samples=501)
    factors = np.random.default_rng(1).uniform([0.8, 0.5], [1.2, 1.2], (runs, 2))
    signals = [maneuver.perturbed(*pair) for pair in factors.tolist()]
    exact = vm.reduce(model, "full_order", solver="dopri5", tolerance=1e-10)
    found = vm.simulate_many(exact, signals, "equilibrium", outputs=["lateral_position"])
    title, reference = f"{name}, {runs} lane changes of 10 s", found["values"].values[:, :, 0]
    how = {"more": signals, "per": (runs, "run"), "clock": "process_time"}
    return Case("batch", title, "m", (2e-2, 1e-3, 3e-5), model, maneuver, reference, **how)


def mechanism() -> Case:
    """Kinematics of the double wishbone over 1001 samples."""
    model, maneuver = vm.model("double_wishbone"), vm.maneuver("sine_travel")
    exact = model.simulate(maneuver, tolerance=1e-14).outputs
    title = "double_wishbone, sine_travel, 1001 samples"
    return Case("mechanism", title, "m or rad", (1e-6, 1e-9, 1e-12), model, maneuver, exact)


def structure() -> Case:
    """Ride of the truck over a rough road, outputs as part of their ranges, by step size."""
    model = vm.model("flexible_truck")
    maneuver = replace(vm.maneuver("road"), duration=2.5, samples=251)
    exact = model.run(maneuver, step=10e-3 / 256).outputs
    title = f"flexible_truck, {model.size} coordinates, road, 2.5 s, by step size"
    given = "of an output's range", (2e-2, 5e-3, 2e-3), model, maneuver, exact
    steps = [10e-3 / count for count in (2, 4, 8, 16, 32)]
    return Case("structure", title, *given, steps, scale=np.ptp(exact, axis=0))


def cases() -> dict[str, Callable[[], Case]]:
    """Name of a comparison -> what makes its case."""
    found: dict[str, Callable[[], Case]] = {}
    for name in ("independent_suspension_vehicle", "high_fidelity_vehicle"):
        for ending, make in (("", vehicle), ("-steps", held_steps), ("-batch", batch)):
            found[f"{name}{ending}"] = partial(make, name)
    return found | {"double_wishbone": mechanism, "flexible_truck": structure}
