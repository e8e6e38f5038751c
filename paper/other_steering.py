"""Whether a reduced vehicle warns where its steering, start or speed is unlike training.

Usage: python paper/other_steering.py [--results DIR] [--runs N] [--seed SEED]

Draws so many runs of each kind, of steering of the size of the protocol's boxes: single pulses,
motions of 0.1 to 1 s again and again, and fishhooks; these and eight other families for 5 to 40 s,
from starts with one state out of place, at 8 to 35 m/s, and with brakes or drive.  The models are
those that ship, without full order behind them, and for brakes and drive one that learns from the
training runs of `predictive-MODEL-2`.  Writes it to DIR/models, and DIR/other_steering.nc, the runs
and named values that `paper/measured_numbers.py` reads, in five minutes.  A run is undetected if it
violates a bound and its status is `ok`.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from in_use import Values, store
from reduced_models import Choice, fitted, fitted_once, in_bounds

import vehiclemor as vm
from vehiclemor.exceptions import VehiclemorError
from vehiclemor.inputs.driving import FRONT_SHARE, MASS, RADIUS
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.registry import component
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names
from vehiclemor.study.scenario import Scenario, start_of

# Largest nominal steering of the lane change.
VEHICLES = {"independent_suspension_vehicle": 0.0300768, "high_fidelity_vehicle": -0.0046903}
# Samples a second, between which steering is a spline.
RATE = 100
# Demanded of the drive or brakes (m/s^2); the part of the speed that they take at most.  Torques
# are never below that of the last number: a spline overshoots by less.
DEMANDS, SPENT, LEAST = (-7.0, 3.0), 0.5, 1e-4
WHEELS = "FL", "FR", "RL", "RR"
Steering = Callable[[np.ndarray], np.ndarray]


class Kind(NamedTuple):
    """Runs that are counted together; of all families where none is named, durations in s."""

    families: tuple[str, ...] = ()
    durations: tuple[float, ...] = (5.0, 10.0)
    speeds: tuple[float, float] = (18.0, 22.0)


KINDS = {
    "pulses": Kind(("pulse",)),
    "repeated": Kind(("repeated",)),
    "fishhooks": Kind(("fishhook",)),
    "families": Kind(durations=(5.0, 10.0, 20.0, 25.0, 40.0)),
    "starts": Kind(),
    "speeds": Kind(durations=(10.0,), speeds=(8.0, 35.0)),
    "brakes": Kind(durations=(10.0,), speeds=(10.0, 30.0)),
}


def ramp(t: np.ndarray, begin: float, length: float) -> np.ndarray:
    """From 0 to 1 with two continuous derivatives."""
    s = np.clip((t - begin) / length, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def steering(rng: np.random.Generator, duration: float) -> dict[str, Steering]:
    """Families of steering, of size 1 or less."""
    begin, short, hold = rng.uniform(0.0, 1.0), rng.uniform(0.15, 1.0), rng.uniform(0.0, 4.0)
    slow, quick = rng.uniform(0.05, 0.6), rng.uniform(0.05, 2.5)
    length, period = rng.uniform(0.15, 8.0), rng.uniform(0.3, 2.0)
    turns = begin + np.cumsum(rng.uniform(0.6, 3.0, 8))
    values = np.append(0.0, rng.uniform(-1.0, 1.0, int(duration / period) + 2))
    sines = rng.uniform(0.1, 2.0, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    motion, times = np.exp(rng.uniform(np.log(0.1), 0.0)), rng.integers(2, 40)
    again, side, doublet = motion * rng.uniform(1.0, 3.0), rng.choice([-1.0, 1.0]), rng.integers(2)
    turn = 2.0 * np.pi

    def pieces(t: np.ndarray) -> np.ndarray:
        around = np.linspace(-0.2, 0.2, 9) * min(period, 0.4)
        at = period * np.arange(len(values))
        return np.mean([np.interp(t + o, at, values) for o in around], axis=0)

    def train(t: np.ndarray) -> np.ndarray:
        parts = [(-1) ** i * (2 if i else 1) * ramp(t, at, 0.5) for i, at in enumerate(turns)]
        return 0.8 * np.sum(parts, axis=0)

    def repeated(t: np.ndarray) -> np.ndarray:
        number, since = np.divmod(t - begin, again)
        part = np.pi * np.clip(since / motion, 0.0, 1.0)
        wave = np.sin(part) ** 2 * (1.5 * np.sin(2.0 * part) if doublet else 1.0)
        return np.where((number >= 0) & (number < times), side**number * wave, 0.0)

    def out_and_back(t: np.ndarray, back: float) -> np.ndarray:
        return 0.9 * (ramp(t, begin, short) - back * ramp(t, begin + short + hold, short))

    return {
        "sine": lambda t: np.sin(turn * quick * np.maximum(t - begin, 0.0)) * ramp(t, begin, 1.0),
        "ramp": lambda t: 0.9 * ramp(t, begin, length),
        "fishhook": lambda t: out_and_back(t, 2.0),
        "pulse": lambda t: out_and_back(t, 1.0),
        "repeated": repeated,
        "pulses": train,
        "offset sine": lambda t: (
            0.5 * ramp(t, 0.5, 0.5) + 0.5 * np.sin(turn * slow * (t - 1.0)) * ramp(t, 1.0, 1.0)
        ),
        "immediate step": lambda t: 0.8 * ramp(t, -0.001, 0.3),
        "pieces": pieces,
        "chirp": lambda t: (
            ramp(t, 0.5, 1.0) * np.sin(turn * (slow + (quick + 0.5) * t / (2.0 * duration)) * t)
        ),
        "four sines": lambda t: (
            0.5
            * ramp(t, 0.3, 0.7)
            * np.sum([np.sin(turn * f * t + p) for f, p in zip(*sines, strict=True)], axis=0)
        ),
    }


def torques(rng: np.random.Generator, times: np.ndarray, speed: float) -> dict[str, np.ndarray]:
    """Torques (N m) of all wheels that brake or drive once; the rear axle drives."""
    demand, begin, rise = rng.uniform(*DEMANDS), rng.uniform(0.5, 4.0), rng.uniform(0.2, 1.0)
    hold = min(rng.uniform(0.3, 6.0), SPENT * speed / abs(demand))
    size = demand * (ramp(times, begin, rise) - ramp(times, begin + rise + hold, rise))
    front = {"brake": FRONT_SHARE, "drive": 0.0}
    return {
        f"{kind}_torque_{wheel}": MASS * RADIUS * share / 2.0 * np.maximum(sign * size, LEAST)
        for kind, sign in (("brake", -1.0), ("drive", 1.0))
        for wheel, share in zip(WHEELS, [front[kind]] * 2 + [1.0 - front[kind]] * 2, strict=True)
    }


def drawn(model: Any, kind: str, rng: np.random.Generator) -> tuple[vm.Signal, np.ndarray, float]:
    """Signal, start and speed (m/s) of a run; what is faster steers less."""
    of = KINDS[kind]
    duration, speed = float(rng.choice(of.durations)), round(rng.uniform(*of.speeds), 2)
    families = steering(rng, duration)
    name = str(rng.choice(of.families or [*families]))
    size = VEHICLES[model.name] * rng.uniform(0.2, 1.9) * rng.choice([-1.0, 1.0])
    size *= (20.0 / speed) ** 1.5
    times = np.linspace(0.0, duration, int(RATE * duration) + 1)
    inputs = {model.inputs[0]: size * families[name](times)}
    if kind == "brakes":
        inputs |= torques(rng, times, speed)
    samples = np.column_stack([*inputs.values()])
    driven = vm.Signal.from_samples(times, samples, "cubic", inputs=[*inputs], name=name)
    nominal = component("maneuver", model.definition.maneuver)
    begin = str(rng.choice(model.starts))
    state = np.array(model.start(start_of(model, Scenario(nominal, begin, speed))))
    if kind == "starts":
        state[rng.integers(len(state))] += rng.normal() * rng.choice([0.001, 0.01, 0.1])
    return driven, state, speed


def alone(reduced: ReducedOrderModel) -> ReducedOrderModel:
    """A reduced model without full order behind it."""
    inner: Any = reduced.reduced
    return replace(reduced, reduced=getattr(inner, "reduced", inner))


def braking_car(name: str, results: Path) -> ReducedOrderModel:
    """What the second protocol has chosen, which brakes and drives; it is fitted once."""
    protocol = load_protocol(f"predictive-{name}-2")
    entry = next(entry for entry in protocol.entries if entry.label == "guarded")
    choice = Choice(protocol, entry.method, entry.candidates[0], entry.training)
    return fitted_once(results / "models" / f"braking_{name}.nc", partial(fitted, choice))


def accelerations(run: Trajectory) -> dict[str, float]:
    """The largest acceleration sideways; forward and sideways where both together are largest.

    In m/s^2.
    """
    forward = np.gradient(run["longitudinal_speed"], run.times)
    forward -= run["lateral_speed"] * run["yaw_rate"]
    sideways = np.abs(run["longitudinal_speed"] * run["yaw_rate"])
    most = np.hypot(forward, sideways).argmax()
    return {"acceleration": sideways.max(), "forward": forward[most], "sideways": sideways[most]}


def score_of(protocol: Protocol, reduced: Any, driven: Any, state: Any) -> dict[str, Any] | None:
    """Largest error in bounds, and what the model tells of it; none if full order fails.

    The accelerations are those of the full-order run.
    """
    try:
        exact = reduced.model.simulate(driven, state)
    except VehiclemorError:
        return None
    if exact.status != "ok":
        return None
    run = reduced.simulate(driven, state)
    return {
        "score": in_bounds(protocol, run, exact) if run.finished else np.inf,
        "estimate": run.error_estimate.in_bounds if run.error_estimate else np.inf,
        "warned": run.status != "ok",
    } | accelerations(exact)


def judged(name: str, wanted: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Runs of every kind of a vehicle."""
    protocol, rng = load_protocol(protocol_names()[name]), np.random.default_rng(wanted.seed)
    cars = dict.fromkeys(KINDS, alone(vm.rom(name)))
    cars["brakes"] = alone(braking_car(name, wanted.results))
    for kind, reduced in cars.items():
        for _ in range(wanted.runs):
            driven, state, speed = drawn(protocol.model, kind, rng)
            if row := score_of(protocol, reduced, driven, state):
                yield {"model": name, "kind": kind, "family": driven.name, "speed": speed} | row


def counted(runs: pd.DataFrame) -> Iterator[tuple[str, float]]:
    """Of runs of each kind how many miss, are undetected, and are warned of though right."""
    for name, kind in product(VEHICLES, KINDS):
        part = runs[(runs["model"] == name) & (runs["kind"] == kind)]
        missed, warned = ~(np.asarray(part["score"]) <= 1.0), np.asarray(part["warned"])
        counts = {
            "runs": len(part),
            "missed": missed.sum(),
            "undetected": (missed & ~warned).sum(),
            "warned and right": (~missed & warned).sum(),
        }
        yield from ((f"{name} {kind} {what}, 1", float(number)) for what, number in counts.items())


def estimated(runs: pd.DataFrame) -> Iterator[tuple[str, float]]:
    """Estimated over true error of each vehicle: median, and what 90 % of the runs are between."""
    for name in VEHICLES:
        part = runs[(runs["model"] == name) & np.isfinite(runs["score"] + runs["estimate"])]
        ratios = np.asarray(part["estimate"]) / np.asarray(part["score"])
        for level in (5, 50, 95):
            yield f"{name} estimate over error {level} %, 1", float(np.percentile(ratios, level))


def main() -> None:
    """Draw, simulate, and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--runs", type=int, default=300, help="of each kind")
    parser.add_argument("--seed", type=int, default=7)
    wanted = parser.parse_args()
    runs = pd.DataFrame(row for name in VEHICLES for row in judged(name, wanted))
    values: Values = dict(counted(runs)) | dict(estimated(runs))
    title = "Other steering than that of the test sets"
    store(values, title, wanted.results / "other_steering.nc", runs)


if __name__ == "__main__":
    main()
