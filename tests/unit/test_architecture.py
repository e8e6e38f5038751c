"""Nothing heavy is imported before it is needed; what is compiled is compiled once."""

import json
import subprocess
import sys

import pytest

from vehiclemor.codegen.cache import cache_folder

# What takes longer to import than a model to run.
HEAVY = ("numba", "sympy", "scipy", "pandas", "xarray", "matplotlib")


SIMULATION = """
import json, sys
import vehiclemor as vm
from vehiclemor.registry import component
model = vm.model("{name}")
run = model.simulate(component('maneuver', '{maneuver}'))
print(json.dumps([sorted(sys.modules), run.states[-1].tolist()]))
"""
RUNS = {
    "double_wishbone": "sine_travel",
    "independent_suspension_vehicle": "lane_change",
    "high_fidelity_vehicle": "rack_lane_change",
}


@pytest.mark.parametrize(("name", "maneuver"), RUNS.items())
def test_a_second_process_compiles_and_imports_nothing_heavy(name, maneuver):
    script = SIMULATION.format(name=name, maneuver=maneuver)

    def process() -> tuple[list[str], list[float], str]:
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        return (*json.loads(done.stdout), done.stderr)

    _, first, _ = process()
    before = {path: path.stat().st_mtime_ns for path in cache_folder().rglob("*.o")}
    modules, again, told = process()
    assert not told
    assert {p: p.stat().st_mtime_ns for p in cache_folder().rglob("*.o") if p in before} == before
    assert again == first
    assert {"llvmlite", "numpy"} <= set(modules)
    assert not {module.partition(".")[0] for module in modules} & set(HEAVY)


def test_importing_the_package_imports_next_to_nothing():
    script = "import json, sys, vehiclemor; print(json.dumps(sorted(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
    heavy = {name.partition(".")[0] for name in json.loads(found.stdout)}
    assert not heavy & {*HEAVY, "numpy", "llvmlite", "pydantic"}
