"""Measures the two design studies of `examples/`, in full order and reduced.

Usage: python paper/design_studies.py

Writes data/design.json: named values with units, which `paper/facts.py` writes into the texts and
`vehiclemor compare` judges claims by, and the fronts, which `vehiclemor figures` draws.  It takes
about five minutes.  Times are CPU times.
"""

from __future__ import annotations

import argparse
import json
import runpy
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from fragments import ROOT

import vehiclemor as vm
from vehiclemor.files import write_text
from vehiclemor.registry import component
from vehiclemor.resources import data_folder
from vehiclemor.study.provenance import attributes
from vehiclemor.study.scenario import Scenario

EXAMPLES = ROOT / "examples"
SPRINGS, POINTS = (
    runpy.run_path(str(EXAMPLES / f"{name}.py"))
    for name in ("spring_damper_front", "suspension_hard_points")
)
# Steering that slow manifolds learn from, as parts of the lane change's; margin of the box.
AMPLITUDES, BEYOND = np.linspace(0.8, 1.1, 13).tolist(), 0.03
# Samples of a fine path of the suspension.
FINE = 5000
# Designs whose making and running is timed, rounds of which the least counts.
DESIGNS, ROUNDS = 8, 3
Values = dict[str, float]


def car(method: str, **settings: Any) -> Callable[[], vm.ReducedOrderModel]:
    """How the car of a contestant is made, cars all over the box learnt from where it learns."""

    def made() -> Any:
        if method == "full_order":
            return vm.reduce(SPRINGS["MODEL"], method, **settings)
        today = vm.model(SPRINGS["MODEL"]).parameters.values()
        ends = SPRINGS["LOWEST"] - BEYOND, SPRINGS["HIGHEST"] + BEYOND
        box = {name: [end * today[name] for end in ends] for name in SPRINGS["DESIGN"]}
        # A slow manifold has each car drive inputs of the training, by their registered names, at
        # speeds about its own.
        named = method == "slow_manifold"
        speed = {"initial_speed": float(np.mean(SPRINGS["SPEEDS"]))} if named else {}
        driven = vm.model(SPRINGS["MODEL"], parameters=speed)
        parts = AMPLITUDES if named else (1.0,)
        base = component("maneuver", "lane_change") if named else SPRINGS["lane_change"]()
        runs = [
            Scenario(base.perturbed(amplitude=part), "equilibrium", speed)
            for speed in SPRINGS["SPEEDS"]
            for part in parts
        ]
        return vm.reduce(driven, method, training=runs, cars=box, **settings)

    return made


STRONGEST = {"solver": "ros34pw2", "tolerance": 1e-4}
# Label -> how the car is made, whether derivatives are exact.
CARS = {
    "full order": (car("full_order", **STRONGEST), False),
    "full order, exact derivatives": (car("full_order", **STRONGEST), True),
    "full order, coarse": (car("full_order", **STRONGEST | {"tolerance": 1e-3}), False),
    "slow manifold": (car("slow_manifold"), False),
    "POD, r = 3": (car("pod", rank=3, bases="interpolated"), False),
    "POD, r = 6": (car("pod", rank=6, bases="interpolated"), False),
}


def least(functions: dict[str, Callable[[], Any]]) -> Values:
    """CPU time of each in ms, the least of interleaved rounds."""
    spent = dict.fromkeys(functions, np.inf)
    for _ in range(ROUNDS + 1):
        for name, function in functions.items():
            began = time.thread_time()
            function()
            spent[name] = min(spent[name], 1e3 * (time.thread_time() - began))
    return spent


def costs(designers: dict[str, Any], designs: np.ndarray, run: Callable[..., Any]) -> Values:
    """What making a design and one of its runs takes, and from when on a reduced model pays."""
    functions: dict[str, Callable[[], Any]] = {}
    for name, own in designers.items():
        made = [own.made(design) for design in designs]
        # Some of a car is made by its first run.
        functions[f"{name} made"] = lambda own=own: [run(own, own.made(d)) for d in designs]
        functions[f"{name} run"] = lambda own=own, made=made: [run(own, car) for car in made]
    found = {f"{name}, ms": ms / len(designs) for name, ms in least(functions).items()}
    for name in designers:
        found[f"{name} made, ms"] -= found[f"{name} run, ms"]
    return found


def pays(values: Values, name: str, runs: int) -> Values:
    """From how many designs, and from how many runs of a design on, it pays; none if never."""
    made, run = (values[f"{name} {part}, ms"] for part in ("made", "run"))
    full_made, full_run = (values[f"full order {part}, ms"] for part in ("made", "run"))
    saved = full_made - made + runs * (full_run - run)
    offline = 1e3 * values[f"{name} offline, s"]
    found: Values = {}
    if saved > 0.0:
        found[f"{name} pays designs, 1"] = offline / saved
    if run < full_run:
        found[f"{name} pays runs, 1"] = max((made - full_made) / (full_run - run), 0.0)
    return found


def springs() -> tuple[Values, dict[str, list]]:
    """Study of springs and dampers: values, and the fronts."""
    designer, rolls = SPRINGS["Designer"], SPRINGS["ROLLS"]
    exact = designer(vm.reduce(SPRINGS["MODEL"], "full_order", tolerance=1e-8))
    values: Values = {}
    fronts: dict[str, list] = {}
    designers, best = {}, {}
    for name, (make, derived) in CARS.items():
        began = time.process_time()
        made = make()
        values[f"{name} offline, s"] = time.process_time() - began
        own = designer(made, derived)
        began = time.process_time()
        points = SPRINGS["front"](own)
        values[f"{name} search, s"] = time.process_time() - began
        for count in ("cars", "runs", "untrusted"):
            values[f"{name} {count}, 1"] = getattr(own, count)
        found = np.array([exact.values(point.design) for point in points])
        if not best:
            best = {"values": found, "design": np.array([point.design for point in points])}
        designs = np.array([point.design for point in points])
        values[f"{name} design off, 1"] = np.abs(designs - best["design"]).max()
        # What the car really does with these designs, beside what it can.
        best_yaw = best["values"][:, 1]
        over = np.maximum(found / np.column_stack([rolls, best_yaw]) - 1.0, 0.0).max(axis=0)
        told = np.array([point.values for point in points])
        off = np.abs(told / found - 1.0).max(axis=0)
        values |= {f"{name} roll over, 1": over[0], f"{name} yaw over, 1": over[1]}
        values |= {f"{name} worse, 1": over.max(), f"{name} told off, 1": off.max()}
        fronts[name] = [
            {"design": p.design.tolist(), "told": p.values.tolist(), "real": real.tolist()}
            for p, real in zip(points, found, strict=True)
        ]
        designers[name] = own
        print(f"{name}: {values[f'{name} search, s']:.1f} s", flush=True)
    timed = {name: own for name, own in designers.items() if "exact" not in name}
    designs = np.random.default_rng(1).uniform(0.8, 1.2, (DESIGNS, len(SPRINGS["DESIGN"])))
    signal, start = exact.signal, exact.starts[1]
    values |= costs(timed, designs, lambda _, made: made.simulate(signal, start))
    for name in list(timed)[1:]:
        values |= pays(values, name, len(exact.starts))
    # One design by each: error of the strongest integrator and of the reduced cars.
    places = designs[:4]
    truth = np.array([exact.values(place) for place in places])
    for name, own in timed.items():
        off = np.abs(np.array([own.values(place) for place in places]) / truth - 1.0).max(axis=0)
        values |= {f"{name} roll error, 1": off[0], f"{name} yaw error, 1": off[1]}
    return {f"springs {name}": value for name, value in values.items()}, fronts


def points() -> tuple[Values, dict[str, dict]]:
    """Study of hard points: values, and the curves."""
    values: Values = {}
    found, curves = {}, {}
    designers = POINTS["designers"]()
    exact = designers["full order, exact derivatives"]
    for name, own in designers.items():
        POINTS["designed"](own)
        own.cars, began = 0, time.process_time()
        found[name] = POINTS["designed"](own).x
        values[f"{name} search, s"] = time.process_time() - began
        values[f"{name} suspensions, 1"] = own.cars
        apart = np.abs(found[name] - found["full order, differences"]).max()
        values[f"{name} design off, mm"] = 1e3 * apart
        # By the equations, whatever it was found with.
        real, told = exact.off(found[name]), own.off(found[name])
        off = np.abs(real.reshape(2, -1)).max(axis=1)
        values |= {f"{name} toe, rad": off[0], f"{name} camber, rad": off[1]}
        least_off = np.linalg.norm(exact.off(found["full order, differences"]))
        values[f"{name} worse, 1"] = max(float(np.linalg.norm(real) / least_off) - 1.0, 0.0)
        ratio = np.linalg.norm(told) / np.linalg.norm(real)
        values[f"{name} told off, 1"] = abs(float(ratio) - 1.0)
    off = np.abs(exact.off(0.0 * exact.today).reshape(2, -1)).max(axis=1)
    values |= {"today toe, rad": off[0], "today camber, rad": off[1]}
    for label, change in (
        ("today", 0.0 * exact.today),
        ("designed", found["full order, differences"]),
    ):
        run = exact.made(change).simulate(exact.signal)
        seen = run.outputs[:, exact.columns]
        curves[label] = {"z": run.inputs[:, 0].tolist(), "toe": seen[:, 0].tolist()}
        curves[label]["camber"] = seen[:, 1].tolist()
        curves[label]["design"] = np.ravel(change).tolist()
    designs = np.random.default_rng(1).uniform(-0.01, 0.01, (DESIGNS, len(exact.today)))
    short = {"full order": "full order, differences", "path map": "path map, differences"}
    timed = {name: designers[label] for name, label in short.items()}
    values |= costs(timed, designs, lambda own, made: made.simulate(own.signal))
    # One history of so many samples that the equations are solved as often.
    fine = vm.Signal.from_samples(
        [0.0, 1.0], [-POINTS["TRAVEL"], POINTS["TRAVEL"]], inputs="z", output_step=1.0 / FINE
    )
    finely = costs(timed, designs, lambda _, made: made.simulate(fine))
    values |= {f"{name} fine run, ms": finely[f"{name} run, ms"] for name in timed}
    slope = {name: finely[f"{name} run, ms"] - values[f"{name} run, ms"] for name in timed}
    made = values["path map made, ms"] - values["full order made, ms"]
    each = (slope["full order"] - slope["path map"]) / (FINE + 1 - len(exact.signal.times))
    values["path map pays samples, 1"] = made / each
    began = time.process_time()
    POINTS["designers"]()
    for name in ("path map", "path map, differences"):
        values[f"{name} offline, s"] = time.process_time() - began
    values |= pays(values, "path map", 1)
    return {f"points {name}": value for name, value in values.items()}, curves


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.parse_args()
    curves_of, curves = points()
    of_springs, fronts = springs()
    values = of_springs | curves_of
    made = {name: str(value) for name, value in attributes("Design studies", "").items()}
    content = {
        "made": made,
        "values": {name: float(f"{value:.6g}") for name, value in sorted(values.items())},
        "rolls": SPRINGS["ROLLS"],
        "fronts": fronts,
        "curves": curves,
    }
    write_text(data_folder() / "design.json", json.dumps(content, indent=1) + "\n")
    for name, value in content["values"].items():
        print(f"{name:60} {value:.4g}")


if __name__ == "__main__":
    main()
