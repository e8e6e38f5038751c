"""The full order of each model beside the tools that a user would take instead, by one clock.

Usage: python benchmarks/peers/run.py [--results DIR] [--again] [--only CASE ...]

What is stored in DIR/peers.json is not measured again unless asked for.
"""

import argparse
import datetime
import json
import time
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import clock
import report

from vehiclemor.files import make_folder, write_text
from vehiclemor.provenance import machine

PACKAGES = (
    "vehiclemor numpy numba scipy casadi scikit-sundae exudyn mujoco jax diffrax "
    "commonroad-vehicle-models"
)
# Kind of a case -> files of the peers that can do it.
PEERS = {
    "run": ("ours", "c_cvode", "sundae", "casadi_ode", "scipy_peer"),
    "steps": ("ours", "c_cvode", "sundae", "casadi_ode"),
    "batch": ("ours", "c_cvode", "jax_diffrax"),
    "mechanism": ("ours", "casadi_ode", "scipy_peer", "exudyn_models"),
    "structure": ("ours", "scipy_peer", "exudyn_models"),
    "context": ("mujoco_scene", "commonroad"),
}
NO_TIRES = "no Magic Formula and no Fiala tire: its car would be another one"
# Kind or case -> peers, and tools that a user would think of, and why they are no row.
CANNOT = {
    "run": {
        "Exudyn": NO_TIRES,
        "MuJoCo": f"{NO_TIRES}; constraints and contacts are soft",
        "pyMOR": "equal steps of Euler's methods and the midpoint rule alone",
    },
    "mechanism": {"MuJoCo": "constraints are soft: errors do not fall with a tolerance"},
    "structure": {"pyMOR": "linear; springs, stops and tires of the truck are not"},
    "high_fidelity_vehicle-batch": {
        "jax_diffrax": "XLA had not compiled this car after two minutes, at 4 GB"
    },
}
CONTEXT = "other-vehicles"
PANELS = {"run": "a run", "steps": "a step of 10 ms", "batch": "a run of a batch"}


def compared(name: str) -> dict[str, Any]:
    """Measure one comparison."""
    case = clock.cases()[name]()
    cannot = CANNOT.get(case.kind, {}) | CANNOT.get(name, {})
    peers = [peer for peer in PEERS[case.kind] if peer not in cannot]
    curves, missing = clock.collected(peers, case.kind, case)
    return {
        "title": case.title,
        "panel": PANELS.get(case.kind, case.title),
        "unit": case.unit,
        "targets": case.targets,
        "per": case.per,
        "clock": "whole calls, CPU time of the " + case.clock.removesuffix("_time"),
        "curves": clock.measured(curves, case),
        "missing": missing | cannot,
    }


def others() -> dict[str, Any]:
    """Time a simulated second of scenes of other tools: no comparison, since nothing is equal."""
    scenes, missing = clock.collected(PEERS["context"], "context")
    found = {}
    for label, (call, simulated, what) in scenes.items():
        call()
        seconds = [clock.seconds_of(call, clock.SHORT, time.process_time) for _ in range(3)]
        found[label] = {"seconds": min(seconds) / simulated, "what": what}
    title = "Other vehicles, for scale alone: none of them is one of ours"
    return {"title": title, "clock": "CPU time of the process", "rows": found, "missing": missing}


def stored(path: Path) -> dict[str, Any]:
    """What was measured before; empty if there is nothing."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def measure(name: str) -> dict[str, Any]:
    """Measure a case, where and by what is noted."""
    found = others() if name == CONTEXT else compared(name)
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    known = {package.name: package.version for package in distributions()}
    versions = {name: known[name] for name in PACKAGES.split() if name in known}
    return found | {"about": f"{machine()}; {date}", "versions": versions}


def tell(cases: dict[str, Any], results: Path) -> None:
    """Write and print the tables of what is stored, and draw a figure for each model."""
    compared = {name: case for name, case in cases.items() if name != CONTEXT}
    texts = [report.summary(compared), *map(report.case_text, compared.values())]
    texts += [report.context_text(cases[CONTEXT])] if CONTEXT in cases else []
    write_text(results / "peers.md", "\n\n".join(texts) + "\n")
    print("\n\n".join(texts))
    make_folder(results / "figures")
    for model in dict.fromkeys(name.split("-")[0] for name in compared):
        of_model = {k: c for k, c in compared.items() if k.split("-")[0] == model}
        report.figure(of_model, results / "figures" / f"peers-{model}")


def main() -> None:
    """Measure what is not stored, then print and draw all."""
    parser = argparse.ArgumentParser(description="the full order beside other tools")
    names = [*clock.cases(), CONTEXT]
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--again", action="store_true", help="measure what is stored once more")
    parser.add_argument("--only", nargs="*", choices=names, default=names, metavar="CASE")
    given = parser.parse_args()
    path = given.results / "peers.json"
    for name in given.only:
        if given.again or name not in stored(path):
            print(name, flush=True)
            content = stored(path) | {name: measure(name)}
            write_text(path, json.dumps(content, indent=1) + "\n")
    content = stored(path)
    tell({name: content[name] for name in names if name in content}, given.results)


if __name__ == "__main__":
    main()
