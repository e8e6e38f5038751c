"""What all peers share: what is to be computed, the clock, errors, and the file of what was found.

A comparison is a set of curves over one tolerance, or step size: error and seconds of each point.
Seconds are those of whole calls, states or outputs delivered, in interleaved rounds.
"""

import gc
import importlib
import json
import math
import os
import shutil
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import vehiclemor as vm
from vehiclemor.files import write_text
from vehiclemor.inputs import steering
from vehiclemor.registry import component

# Calls of a round, the first a warm-up, of what takes less than so many seconds.
REPEATS, SHORT = 4, 5e-3
# Seconds of a call -> rounds at most; and those beyond which no tighter tolerance is tried.
ROUNDS, TOO_LONG = {0.05: 9, 1.2: 2, math.inf: 1}, 4.5
# Where peers have what they generate compiled; none without a compiler.
COMPILER = shutil.which(os.environ.get("CC", "cc"))
# Above (times the loosest target) nothing is timed.
FAR_OFF = 10.0


class LeftOutError(Exception):
    """Why a peer has no curve for a case."""


class Curve(NamedTuple):
    """One way to compute a case.

    Attributes
    ----------
    make
        Tolerance -> a call without arguments, ready to run again and again.
    tolerances
        The scan, loosest first.
    read
        What the call returned -> what is compared with the reference.
    delivers
        What the call gives: `states`, `outputs`, or what else.
    counts
        What the call returned -> evaluations of the right-hand side; none where it isn't told.
    """

    make: Callable[[float], Callable[[], Any]]
    tolerances: Sequence[float]
    read: Callable[[Any], np.ndarray]
    delivers: str = "states"
    counts: Callable[[Any], int] | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """What is computed: a model, its maneuver and start, and the reference.

    Attributes
    ----------
    kind
        `run`, `steps`, `batch`, `mechanism` or `structure`: the function of a peer that is asked.
    title, unit
        What errors are of.
    targets
        Errors for which peers are compared.
    reference
        What curves are compared with.
    clock
        Whose CPU time: of the thread, or of the process where a peer starts threads.
    more
        What else peers of this kind need.
    """

    kind: str
    title: str
    unit: str
    targets: tuple[float, ...]
    model: Any
    maneuver: Any
    reference: np.ndarray
    clock: str = "thread_time"
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def start(self) -> np.ndarray:
        """State at rest in straight running."""
        return self.model.start("equilibrium")

    @property
    def lateral(self) -> int:
        """Place of the lateral position among the states."""
        return int(self.model.planar[1])

    def spans(self) -> list[tuple[int, int, bool]]:
        """First and last output time of each smooth part, and whether the steering moves in it."""
        breaks, times = self.maneuver.break_points, self.maneuver.times
        edges = [0, *np.searchsorted(times, np.array(breaks) - 1e-9).tolist(), len(times) - 1]
        return list(zip(edges, edges[1:], (False, True, False), strict=False))

    def by_parts(self, part: Callable[[np.ndarray, np.ndarray, bool], np.ndarray]) -> np.ndarray:
        """States (samples, n) of a run that is integrated anew in each smooth part.

        `part` takes a state, output times with both ends and whether the steering moves.
        """
        states, times = np.empty((len(self.maneuver.times), len(self.start))), self.maneuver.times
        states[0] = self.start
        for first, last, moves in self.spans():
            states[first : last + 1] = part(states[first], times[first : last + 1], moves)
        return states


def decades(first: float, last: float, each: int = 4) -> list[float]:
    """Tolerances from the loosest to the tightest, so many in each decade."""
    count = round(math.log10(first / last) * each) + 1
    return np.geomspace(first, last, count).tolist()


def pulse(time_: Any, functions: Any, racked: bool, amplitude: Any = 1.0, speed: Any = 1.0) -> list:
    """Inputs of a lane change while the steering moves, by the functions of any library.

    Peers call back into it: `maneuver.at`, for arrays of times, would cost more than the car.
    """
    rate = 2.0 * math.pi * speed / steering.LANE_CHANGE_LENGTH
    size = amplitude * (steering.RACK_AMPLITUDE if racked else steering.LANE_CHANGE_AMPLITUDE)
    a = rate * (time_ - steering.BEGIN)
    sine, sine_2 = functions.sin(a), functions.sin(2.0 * a)
    found = [size * (sine - 0.5 * sine_2)]
    if racked:
        found.append(size * rate * (functions.cos(a) - functions.cos(2.0 * a)))
        found.append(size * rate**2 * (2.0 * sine_2 - sine))
    return found


def callback(case: Case) -> Callable[[bool], Callable[[float, np.ndarray], np.ndarray]]:
    """The fastest documented right-hand side for Python: f(t, x), of parts that steer or don't."""
    rhs, racked = case.model.bare("rhs"), len(case.model.inputs) > 1
    rates, state, u = np.empty(len(case.start)), case.start, np.zeros(len(case.model.inputs))

    def steered(t: float, x: np.ndarray) -> np.ndarray:
        state[:] = x  # what solvers pass may be read-only
        u[:] = pulse(t, math, racked)
        rhs(state, u, rates)
        return rates

    def straight(_: float, x: np.ndarray) -> np.ndarray:
        state[:] = x
        u[:] = 0.0
        rhs(state, u, rates)
        return rates

    return lambda moves: steered if moves else straight


def collected(peers: Iterable[str], case: Case) -> tuple[dict[str, Curve], dict[str, str]]:
    """Curves of all peers for a case by label, and label of a peer -> why it has none."""
    curves, missing = {}, {}
    for name in peers:
        try:
            peer = importlib.import_module(name)
        except ImportError as error:
            missing[name] = f"not installed ({error})"
            continue
        try:
            curves |= getattr(peer, case.kind, lambda _: {})(case)
        except LeftOutError as error:
            missing[name] = str(error)
        except Exception as error:  # noqa: BLE001  (what a peer raises is a row, no crash)
            missing[name] = f"failed: {type(error).__name__}: {error}".splitlines()[0]
    return curves, missing


def measured(curves: Mapping[str, Curve], case: Case, tell: Callable = print) -> dict[str, Any]:
    """Error and seconds of all points of all curves; a point that fails is left out."""
    clock = getattr(time, case.clock)
    found, ready = {}, []
    for label, curve in curves.items():
        points: list[dict[str, Any]] = []
        found[label], failures = {"delivers": curve.delivers, "points": points}, []
        for tolerance in curve.tolerances:
            try:
                call = curve.make(tolerance)
                call()
                began = clock()
                result = call()
                first = clock() - began
                off = np.asarray(curve.read(result)) - case.reference
            except Exception as error:  # noqa: BLE001  (as above)
                failures.append(f"{tolerance:.1e}: {type(error).__name__}: {error}"[:160])
                continue
            error = float(np.abs(off).max())
            if not error < FAR_OFF * max(case.targets):
                continue
            point = {"tolerance": tolerance, "error": error, "seconds": [first]}
            if curve.counts is not None:
                point["evaluations"] = int(curve.counts(result))
            points.append(point)
            ready.append((point, call))
            if first > TOO_LONG:
                break
        if failures:
            found[label]["failures"] = failures
        tell(f"  {label}: {len(points)} points")
    gc.collect()
    gc.disable()
    try:
        for turn in range(max(ROUNDS.values())):
            for point, call in ready:
                expected = point["seconds"][0]
                if turn < next(r for length, r in ROUNDS.items() if expected < length):
                    point["seconds"].append(seconds_of(call, expected, clock))
    finally:
        gc.enable()
    for point, _ in ready:
        seconds = point["seconds"][1:]
        point["spread"] = [min(seconds), statistics.median(seconds), max(seconds)]
        point["seconds"] = min(seconds)
    return found


def seconds_of(call: Callable[[], Any], expected: float, clock: Callable[[], float]) -> float:
    """Seconds of a call; of a short one the median of some in a row, the first a warm-up."""
    if expected > SHORT:
        began = clock()
        call()
        return clock() - began
    seconds = []
    for _ in range(REPEATS):
        began = clock()
        call()
        seconds.append(clock() - began)
    return statistics.median(seconds[1:])


def others(peers: Iterable[str]) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """CPU seconds of a simulated second of the scenes of peers (`context`), and who is missing."""
    found: dict[str, dict[str, Any]] = {}
    missing = {}
    for name in peers:
        try:
            scenes = getattr(importlib.import_module(name), "context", dict)()
            for label, (call, simulated, what) in scenes.items():
                call()
                seconds = [seconds_of(call, SHORT, time.process_time) for _ in range(3)]
                found[label] = {"seconds": min(seconds) / simulated, "what": what}
        except ImportError as error:
            missing[name] = f"not installed ({error})"
        except Exception as error:  # noqa: BLE001  (as above)
            missing[name] = f"failed: {type(error).__name__}: {error}".splitlines()[0]
    return found, missing


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Distribution -> its version, or that it isn't installed."""
    found = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def stored(path: Path) -> dict[str, Any]:
    """What was measured before; empty if there is nothing."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def store(path: Path, content: Mapping[str, Any]) -> None:
    """Write the file whole: under a temporary name first, then moved into place."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def vehicle(name: str) -> Case:
    """The lane change of a vehicle, lateral position at all output times."""
    model = vm.model(name)
    maneuver = vm.maneuver(model.definition.maneuver)
    exact = model.simulate(maneuver, "equilibrium", solver="dopri5", tolerance=1e-11)
    title = f"{name}, {maneuver.name}, {maneuver.duration:g} s"
    targets = 2e-2, 1e-3, 3e-5, 5e-6
    return Case("run", title, "m", targets, model, maneuver, exact["lateral_position"])


def held_steps(name: str) -> Case:
    """The same lane change in 500 steps of 10 ms, as a controller sends it: held inputs."""
    model, maneuver = vm.model(name), vm.maneuver(component("model", name).maneuver)
    held = [np.array(u) for u in maneuver.at(np.arange(500) * 0.01)]
    exact, state, lateral = vm.reduce(model, "full_order", solver="dopri5", tolerance=1e-11), [], []
    state = model.start("equilibrium")
    for u in held:
        state = exact.step(state, u, 0.01)
        lateral.append(state[model.planar[1]])
    title = f"{name}, 500 steps of 10 ms with held inputs, from Python"
    more = {"held": held, "per": (len(held), "step")}
    targets = 2e-2, 1e-3, 3e-5
    return Case("steps", title, "m", targets, model, maneuver, np.array(lateral), more=more)


def batch(name: str, runs: int = 200) -> Case:
    """Lane changes of other length and size, at all output times of the first 10 s."""
    model, maneuver = vm.model(name), vm.maneuver(component("model", name).maneuver)
    maneuver = replace(maneuver, duration=10.0, samples=501)
    factors = np.random.default_rng(1).uniform([0.8, 0.5], [1.2, 1.2], (runs, 2))
    signals = [maneuver.perturbed(*pair) for pair in factors.tolist()]
    how: dict[str, Any] = {"solver": "exponential_adams", "tolerance": 1e-10}
    exact = vm.reduce(model, "full_order", **how)
    found = vm.simulate_many(exact, signals, "equilibrium", outputs=["lateral_position"])
    title = f"{name}, {runs} lane changes of 10 s"
    more = {"signals": signals, "per": (runs, "run")}
    reference = found["values"].values[:, :, 0]
    targets, clock = (2e-2, 1e-3, 3e-5), "process_time"
    return Case("batch", title, "m", targets, model, maneuver, reference, clock, more)


def mechanism() -> Case:
    """Kinematics of the double wishbone over 1001 samples."""
    model = vm.model("double_wishbone")
    maneuver = vm.maneuver("sine_travel")
    exact = model.simulate(maneuver, tolerance=1e-14).outputs
    title = "double_wishbone, sine_travel, 1001 samples"
    return Case("mechanism", title, "m or rad", (1e-6, 1e-9, 1e-12), model, maneuver, exact)


def structure() -> Case:
    """Ride of the truck over a rough road, outputs as part of their ranges, by step size."""
    model, maneuver = vm.model("flexible_truck"), vm.maneuver("road")
    maneuver = replace(maneuver, duration=2.5, samples=251)
    exact = model.run(maneuver, step=10e-3 / 256).outputs
    ranges = np.ptp(exact, axis=0)
    steps = [10e-3 / count for count in (2, 4, 8, 16, 32)]
    title = f"flexible_truck, {model.size} coordinates, road, 2.5 s, by step size"
    more, targets = {"ranges": ranges, "steps": steps}, (2e-2, 5e-3, 2e-3)
    unit = "of an output's range"
    return Case("structure", title, unit, targets, model, maneuver, exact / ranges, more=more)


def cases() -> dict[str, Callable[[], Case]]:
    """Name of a comparison -> what makes its case."""
    found: dict[str, Callable[[], Case]] = {}
    for name in ("independent_suspension_vehicle", "high_fidelity_vehicle"):
        found |= {name: partial(vehicle, name)}
        found |= {f"{name}-steps": partial(held_steps, name), f"{name}-batch": partial(batch, name)}
    return found | {"double_wishbone": mechanism, "flexible_truck": structure}
