"""Whether a reduced vehicle warns where its steering or its start is unlike training.

Usage: python paper/other_steering.py [--results DIR] [--runs N] [--seed SEED]

Draws so many runs of each kind: other steering of the amplitudes and speeds of the protocol's
boxes, for 5 to 40 s and for 5 or 10 s, the latter also from starts with one state out of place;
and simulates one signal that a search for undetected failures has ended with.  Writes
DIR/other_steering.nc, named values that `paper/measured_numbers.py` reads, in some minutes.  A run
is undetected if it violates a bound and its status is `ok`.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from in_use import store
from reduced_models import in_bounds
from scipy.interpolate import make_interp_spline

import vehiclemor as vm
from vehiclemor.exceptions import ConvergenceError, VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.study.evaluate import cached_fit, model_of
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names
from vehiclemor.study.scenario import Scenario, start_of

# Largest nominal steering of the lane change, and the contestant with its chosen candidate.
VEHICLES = {
    "independent_suspension_vehicle": (0.0300768, "slow manifold", 3),
    "high_fidelity_vehicle": (-0.0046903, "slow manifold", 1),
}
# Times (s) and steering (rad) with which a search by hill climbing has ended.
SEARCHED = (
    [0.0, 0.13, 3.07, 4.71, 5.87, 6.53, 7.13, 7.55, 8.49],
    [0.0, 0.017, -0.0002, 0.0309, -0.0034, -0.0105, -0.0009, -0.0169, 0.032],
)
COUNTS = "runs", "missed", "undetected", "warned and right"
DURATIONS = {"long": (5.0, 10.0, 20.0, 25.0, 40.0), "short": (5.0, 10.0), "start": (5.0, 10.0)}
Signal = Callable[[np.ndarray], np.ndarray]


def ramp(t: np.ndarray, begin: float, length: float) -> np.ndarray:
    """From 0 to 1 with two continuous derivatives."""
    s = np.clip((t - begin) / length, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def steering(rng: np.random.Generator, duration: float) -> tuple[str, Signal]:
    """One of ten families of steering, of size 1 or less."""
    short, hold, slow = rng.uniform(0.15, 1.0), rng.uniform(0.3, 4.0), rng.uniform(0.05, 0.6)
    quick, times = rng.uniform(0.05, 2.5), 1.0 + np.cumsum(rng.uniform(0.6, 3.0, 8))
    length, period = rng.uniform(0.15, 8.0), rng.uniform(0.3, 2.0)
    values = np.append(0.0, rng.uniform(-1.0, 1.0, int(duration / period) + 2))
    sines = rng.uniform(0.1, 2.0, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    turn = 2.0 * np.pi

    def pieces(t: np.ndarray) -> np.ndarray:
        around = np.linspace(-0.2, 0.2, 9) * min(period, 0.4)
        at = period * np.arange(len(values))
        return np.mean([np.interp(t + o, at, values) for o in around], axis=0)

    def train(t: np.ndarray) -> np.ndarray:
        parts = [(-1) ** i * (2 if i else 1) * ramp(t, at, 0.5) for i, at in enumerate(times)]
        return 0.8 * np.sum(parts, axis=0)

    families: dict[str, Signal] = {
        "sine": lambda t: np.sin(turn * quick * np.maximum(t - 1.0, 0.0)) * ramp(t, 1.0, 1.0),
        "ramp": lambda t: 0.9 * ramp(t, 1.0, length),
        "fishhook": lambda t: 0.9 * (ramp(t, 1.0, short) - 2.0 * ramp(t, 1.0 + hold, short)),
        "pulse": lambda t: 0.9 * (ramp(t, 1.0, short) - ramp(t, 1.0 + hold, short)),
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
    name = str(rng.choice(list(families)))
    return name, families[name]


def maneuver(model: Any, name: str, duration: float, signal: Signal) -> Maneuver:
    """Steering and its derivatives, as splines of 200 points a second."""
    t = np.linspace(0.0, duration, int(200 * duration) + 1)
    spline: Any = make_interp_spline(t, signal(t), k=5)
    parts = [spline, spline.derivative(1), spline.derivative(2)][: len(model.inputs)]

    def inputs(times: np.ndarray, _: float, factor: float) -> np.ndarray:
        return factor * np.column_stack([part(times) for part in parts])

    corners = tuple(np.arange(0.25, duration, 0.25)) if len(parts) > 1 else ()
    samples = int(50 * duration) + 1
    return Maneuver(name, "", inputs, model.inputs, duration, samples, lambda _: corners)


def score_of(protocol: Protocol, reduced: Any, driven: Any, state: Any) -> tuple[float, bool]:
    """Largest error in multiples of its bound, and whether the run has the status `ok`."""
    exact, run = protocol.model.simulate(driven, state), reduced.simulate(driven, state)
    if exact.status != "ok":
        raise ConvergenceError(exact.message)
    return in_bounds(protocol, run, exact) if run.finished else np.inf, run.status == "ok"


def counted(name: str, count: int, seed: int) -> Iterator[tuple[str, float]]:
    """Of runs of each kind how many miss, are undetected, and are warned of."""
    protocol, (amplitude, label, candidate) = load_protocol(protocol_names()[name]), VEHICLES[name]
    contestant = next(c for c in protocol.entries if c.label == label)
    experiment = contestant.experiment(protocol.model, candidate, protocol.sets["validation"])
    model = cast("Any", model_of(experiment))
    reduced = cast("Any", cached_fit(model, experiment))
    nominal, rng = component("maneuver", model.definition.maneuver), np.random.default_rng(seed)
    for kind, durations in DURATIONS.items():
        counts: Counter[str] = Counter(dict.fromkeys(COUNTS, 0))
        for _ in range(count):
            duration = float(rng.choice(durations))
            family, signal = steering(rng, duration)
            size = amplitude * rng.uniform(0.2, 1.9) * rng.choice([-1.0, 1.0])
            begin, speed = str(rng.choice(model.starts)), round(rng.uniform(18.0, 22.0), 2)
            state = np.array(model.start(start_of(model, Scenario(nominal, begin, speed))))
            if kind == "start":
                away = rng.normal() * rng.choice([0.001, 0.01, 0.1])
                state[rng.integers(len(state))] += away
            try:
                driven = maneuver(model, family, duration, signal)
                driven = replace(driven, amplitude_factor=size)
                score, trusted = score_of(protocol, reduced, driven, state)
            except VehiclemorError:
                continue
            counts["runs"] += 1
            counts["missed"] += score > 1.0
            counts["undetected"] += score > 1.0 and trusted
            counts["warned and right"] += score <= 1.0 and not trusted
        yield from ((f"{name} {kind} {what}, 1", counts[what]) for what in COUNTS)
    if name == "independent_suspension_vehicle":
        searched = vm.Signal.from_samples(*SEARCHED, "cubic")
        score, _ = score_of(protocol, vm.rom(name), searched, "equilibrium")
        yield "searched score, 1", score


def main() -> None:
    """Draw, simulate, and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--runs", type=int, default=60, help="of each kind")
    parser.add_argument("--seed", type=int, default=7)
    wanted = parser.parse_args()
    values = {}
    for name in VEHICLES:
        values |= dict(counted(name, wanted.runs, wanted.seed))
    store(values, "Other steering than that of the test sets", wanted.results / "other_steering.nc")


if __name__ == "__main__":
    main()
