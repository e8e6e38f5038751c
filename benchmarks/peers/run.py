"""The full order of each model beside the tools that a user would take instead, by one clock.

Usage: python benchmarks/peers/run.py [--results DIR] [--again] [--only CASE ...]

What is stored in DIR/peers.json is not measured again unless asked for.
"""

import argparse
import datetime
import time
from pathlib import Path
from typing import Any

import clock
import report

from vehiclemor.files import make_folder, write_text
from vehiclemor.provenance import machine

VEHICLE, PARTS = ("run", "steps", "batch"), ("mechanism", "structure")
# File of a peer -> distributions that it needs, and the kinds of cases that it can do.
PEERS = {
    "ours": (("vehiclemor", "numpy", "numba"), (*VEHICLE, *PARTS)),
    "c_cvode": (("scikit-sundae",), VEHICLE),
    "sundae": (("scikit-sundae",), ("run", "steps")),
    "casadi_ode": (("casadi",), ("run", "steps", "mechanism")),
    "scipy_ode": (("scipy",), ("run", "mechanism")),
    "jax_diffrax": (("jax", "diffrax"), ("batch",)),
    "structures": (("scipy",), ("structure",)),
    "exudyn_models": (("exudyn",), PARTS),
    "mujoco_scene": (("mujoco",), ("context",)),
    "commonroad": (("commonroad-vehicle-models",), ("context",)),
}
NO_TIRES = "no Magic Formula and no Fiala tire: its car would be another one"
# Kind -> tools that a user would think of, and why they are no row.
CANNOT = {
    "run": {
        "Exudyn": NO_TIRES,
        "MuJoCo": f"{NO_TIRES}; constraints and contacts are soft",
        "pyMOR": "equal steps of Euler's methods and the midpoint rule alone",
    },
    "mechanism": {"MuJoCo": "constraints are soft: errors do not fall with a tolerance"},
    "structure": {"pyMOR": "linear; springs, stops and tires of the truck are not"},
}
CONTEXT = "other-vehicles"
PANELS = {"run": "a run", "steps": "a step of 10 ms", "batch": "a run of a batch"}


def compared(name: str) -> dict[str, Any]:
    """Measure one comparison."""
    case = clock.cases()[name]()
    names = [peer for peer, (_, kinds) in PEERS.items() if case.kind in kinds]
    curves, missing = clock.collected(names, case)
    content: dict[str, Any] = {
        "title": case.title,
        "panel": PANELS.get(case.kind, case.title),
        "unit": case.unit,
        "targets": case.targets,
        "clock": "whole calls, CPU time of the " + case.clock.removesuffix("_time"),
    }
    if "per" in case.more:
        content["per"] = case.more["per"]
    missing |= CANNOT.get(case.kind, {})
    return content | {"curves": clock.measured(curves, case), "missing": missing}


def others() -> dict[str, Any]:
    """Time other vehicles and scenes of other tools: no comparison, since nothing is equal."""
    scenes = [peer for peer, (_, kinds) in PEERS.items() if "context" in kinds]
    found, missing = clock.others(scenes)
    title = "Other vehicles, for scale alone: none of them is one of ours"
    return {"title": title, "clock": "CPU time of the process", "rows": found, "missing": missing}


def main() -> None:
    """Measure what is not stored, then print and draw all."""
    parser = argparse.ArgumentParser(description="the full order beside other tools")
    names = [*clock.cases(), CONTEXT]
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--again", action="store_true", help="measure what is stored once more")
    parser.add_argument("--only", nargs="*", choices=names, default=names, metavar="CASE")
    given = parser.parse_args()
    path, began = given.results / "peers.json", time.monotonic()
    for name in given.only:
        content = clock.stored(path)
        if name in content and not given.again:
            continue
        print(f"{name} ({time.monotonic() - began:.0f} s)", flush=True)
        found = others() if name == CONTEXT else compared(name)
        date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
        packages = sorted({package for needed, _ in PEERS.values() for package in needed})
        found |= {"about": f"{machine()}; {date}", "versions": clock.versions(packages)}
        clock.store(path, content | {name: found})
    content = clock.stored(path)
    make_folder(given.results / "figures")
    measured = {name: content[name] for name in names if name in content}
    texts = [report.summary({k: c for k, c in measured.items() if k != CONTEXT})]
    for name, case in measured.items():
        texts.append((report.context_text if name == CONTEXT else report.case_text)(case))
    for model in dict.fromkeys(name.split("-")[0] for name in measured if name != CONTEXT):
        of_model = {k: c for k, c in measured.items() if k.split("-")[0] == model}
        report.figure(of_model, given.results / "figures" / f"peers-{model}")
    write_text(given.results / "peers.md", "\n\n".join(texts) + "\n")
    print("\n\n".join(texts))


if __name__ == "__main__":
    main()
