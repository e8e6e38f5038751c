"""The full order of each model beside the tools that a user would take instead, by one clock.

Usage: python benchmarks/peers/run.py [--results DIR] [--again] [--only CASE ...]

What is stored in DIR/peers.json is not measured again unless asked for.
"""

import argparse
import datetime
import json
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import clock
import report

from vehiclemor.files import write_text
from vehiclemor.provenance import machine

PACKAGES = "vehiclemor numpy numba scipy casadi scikit-sundae exudyn jax diffrax"
# Kind of a case -> files of the peers that can do it.
PEERS = {
    "run": ("ours", "c_cvode", "sundae", "casadi_ode", "scipy_peer"),
    "steps": ("ours", "c_cvode", "sundae", "casadi_ode"),
    "batch": ("ours", "c_cvode", "jax_diffrax"),
    "mechanism": ("ours", "casadi_ode", "scipy_peer", "exudyn_models"),
    "structure": ("ours", "scipy_peer", "exudyn_models"),
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


def compared(name: str) -> dict[str, Any]:
    """Measure one comparison."""
    case = clock.cases()[name]()
    cannot = CANNOT.get(case.kind, {}) | CANNOT.get(name, {})
    peers = [peer for peer in PEERS[case.kind] if peer not in cannot]
    curves, missing = clock.collected(peers, case.kind, case)
    return {
        "title": case.title,
        "unit": case.unit,
        "targets": case.targets,
        "per": case.per,
        "clock": "whole calls, CPU time of the " + case.clock.removesuffix("_time"),
        "curves": clock.measured(curves, case),
        "missing": missing | cannot,
    }


def stored(path: Path) -> dict[str, Any]:
    """What was measured before; empty if there is nothing."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def measure(name: str) -> dict[str, Any]:
    """Measure a case, where and by what is noted."""
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    known = {package.name: package.version for package in distributions()}
    versions = {name: known[name] for name in PACKAGES.split() if name in known}
    return compared(name) | {"about": f"{machine()}; {date}", "versions": versions}


def main() -> None:
    """Measure what is not stored, then write and print the tables of all."""
    parser = argparse.ArgumentParser(description="the full order beside other tools")
    names = [*clock.cases()]
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
    cases = {name: content[name] for name in names if name in content}
    text = "\n\n".join([report.summary(cases), *map(report.case_text, cases.values())])
    write_text(given.results / "peers.md", text + "\n")
    print(text)


if __name__ == "__main__":
    main()
