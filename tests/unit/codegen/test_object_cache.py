"""Compiled kernels are kept by content: a second process compiles nothing, new source is new."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vehiclemor.codegen.link import kernels_source, linked_source, loops_source
from vehiclemor.simulation.system_loops import COORDINATES

from tests.unit.standard_problems import maneuver
from vehiclemor.codegen import cache, straight_line
from vehiclemor.errors import InputError
from vehiclemor.reduction.projection.dynamic import check_subspace
from vehiclemor.reduction.projection.pod_settings import DynamicPodSettings
from vehiclemor.registry import component
from vehiclemor.simulation import build, newton_loops, system_loops
from vehiclemor.simulation.projection_windows import ProjectionWindows, whole_space
from vehiclemor.simulation.system import SOLVERS

# Prints hits and misses of every compiled function, the machine code's hits, and a result.
REPORT = """
used = {
    name: [sum(d.stats.cache_hits.values()), sum(d.stats.cache_misses.values())]
    for module in modules
    for name, d in vars(module).items()
    if getattr(d, "signatures", None)
}
machine = {n: d.cache_hits for n, d in vars(modules[0]).items() if n.endswith("_machine")}
print(json.dumps([used, machine, [module.__file__ for module in modules], result.tolist()]))
"""

LINKED = (
    """
import json
import numpy as np
from vehiclemor.codegen.object_cache import load_module
from vehiclemor.codegen.link import linked_source
from vehiclemor.simulation import newton_loops

kernels = "def residual(q, u, constants, work, result):\\n    result[0] = q[0] * u[0]\\n"
sizes = {"N": 1, "INPUTS": 1, "OUTPUTS": 1, "WORK": 1}
modules = [load_module("tiny", linked_source(kernels, [newton_loops], sizes, "a test"))]
path, nothing, result = np.array([[2.0], [3.0]]), np.zeros(1), np.zeros((2, 1))
modules[0].residual_path(path, path, nothing, result)
"""
    + REPORT
)

ADDRESSED = (
    """
import json
import numpy as np
from vehiclemor.codegen.object_cache import load_module
from vehiclemor.codegen.link import kernels_source, loops_source
from vehiclemor.simulation import run_loops, system_loops

kernels = "def outputs(_x, _u, _constants, _work, _result):\\n    _result[0] = _x[0] * _u[0]\\n"
modules = [load_module("tiny", kernels_source(kernels, {}, "a test"))]
# Without the integrators, which take long to compile.
modules.append(load_module("tiny_loops", loops_source([system_loops, run_loops], "a test")))
path, nothing, result = np.array([[2.0], [3.0]]), np.zeros(1), np.zeros((2, 1))
addresses = np.array([0, modules[0]._outputs_machine.address, 0, 0])
modules[1].output_path(path, path, (nothing, addresses), result)
"""
    + REPORT
)


def process(script: str, folder: Path) -> tuple[dict, dict, list[Path], list]:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment["VEHICLEMOR_CACHE"] = str(folder)
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, env=environment, cwd=folder, check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    used, machine, files, result = json.loads(done.stdout)
    return used, machine, [Path(file) for file in files], result


@pytest.mark.parametrize(
    ("script", "functions"),
    [(LINKED, {"residual_path"}), (ADDRESSED, {"output_path"})],
    ids=["linked", "addressed"],
)
def test_second_process_compiles_nothing(tmp_path: Path, script: str, functions: set[str]) -> None:
    first, cold, source, result = process(script, tmp_path)
    assert result == [[4.0], [9.0]]
    assert set(cold.values()) <= {0}
    assert all(hits == 0 and misses == 1 for hits, misses in first.values())
    written = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    second, warm, same, again = process(script, tmp_path)
    assert functions <= set(second)
    for name, (hits, misses) in second.items():
        assert hits > 0, name
        assert misses == 0, name
    assert set(warm) == set(cold) == ({"_outputs_machine"} if script == ADDRESSED else set())
    assert set(warm.values()) <= {1}
    assert same == source
    assert all(tmp_path in file.parents for file in source)
    assert again == result
    # Nothing was written again, and no half-written file is left.
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*") if p.is_file()} == written
    assert not [path for path in written if path.suffix == ".tmp"]


def test_all_dynamic_models_run_in_the_same_loops(standard) -> None:
    vehicle = build.build("independent_suspension_vehicle")
    other = standard()
    assert vehicle.loops is other.loops
    assert vehicle.kernel_hash != other.kernel_hash
    quiet = maneuver(lambda times, *_: np.zeros((len(times), 3)), 1.0)
    x = vehicle.start()
    vehicle.simulate(component("maneuver", "straight_ahead"), tolerance=1e-3)
    compiled = len(vehicle.loops.run.signatures)
    for solver in SOLVERS:
        other.simulate(quiet, solver=solver, tolerance=1)
    x.flags.writeable = False
    space = whole_space(2 * len(vehicle.coordinates))
    vehicle.integrate(
        component("maneuver", "straight_ahead"), x, space, "ros34pw2", 1e-3, longest_step=1
    )
    assert len(vehicle.loops.run.signatures) == compiled == 1


def test_hash_of_a_dynamic_model_follows_its_loops(
    standard, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = standard().kernel_hash
    assert standard().kernel_hash == before
    monkeypatch.setattr(build, "loops_digest", lambda: "changed")
    assert standard().kernel_hash != before


@pytest.mark.parametrize("lacking", ["second_order", "speeds"])
def test_a_model_without_a_kernel_refuses_what_needs_it(standard, lacking: str) -> None:
    whole = standard()
    shapes = {k: v for k, v in whole.equations.shapes.items() if k != lacking}
    model = replace(whole, equations=replace(whole.equations, shapes=shapes))
    settings = DynamicPodSettings(rank=1, snapshots=2, formulation="state", inner_product="range")
    check_subspace(model, settings)
    for wrong in ({"formulation": "coordinates"}, {"inner_product": "energy"}):
        with pytest.raises(InputError, match=f"has no {lacking}"):
            check_subspace(model, settings.model_copy(update=wrong))
    nothing = np.zeros((1, 1, 4))
    edges, rank = np.array([0.0, 9.0]), np.array([2])
    spaces = ProjectionWindows(COORDINATES, edges, np.zeros((1, 4)), nothing, nothing, rank)
    quiet = maneuver(lambda times, *_: np.zeros((len(times), 3)), 1.0)
    with pytest.raises(InputError, match=f"has no {lacking}"):
        model.integrate(quiet, model.start(), spaces, "dopri5", 1e-3)
    function = model.mass_matrix if lacking == "second_order" else model.speeds_of_rates
    with pytest.raises(InputError, match=f"has no {lacking}"):
        function(model.start())


def test_machine_code_follows_the_source_that_writes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def sources() -> tuple[str, str]:
        kernels = "def f(_q, _work, _result):\n    _result[0] = _q[0]\n"
        return kernels_source(kernels, {}, "a test"), loops_source([system_loops], "a test")

    first = sources()
    assert first == sources()
    monkeypatch.setattr(straight_line, "source_hash", lambda: "another")
    assert all(old != new for old, new in zip(first, sources(), strict=True))


def test_hash_follows_source_and_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    digest = cache.kernel_hash("x = 1\n")
    assert digest == cache.kernel_hash("x = 1\n")
    assert digest != cache.kernel_hash("x = 2\n")
    for package in cache.COMPILER_PACKAGES:
        with monkeypatch.context() as patch:
            patch.setattr(cache, "version", lambda name, package=package: f"{name == package}")
            changed = cache.kernel_hash("x = 1\n")
            patch.setattr(cache, "version", lambda _: "False")
            assert changed != cache.kernel_hash("x = 1\n")
    monkeypatch.setattr(cache.platform, "python_version", lambda: "9.9.9")
    assert digest != cache.kernel_hash("x = 1\n")


def test_changed_source_is_another_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    old = cache.load_module("toy", "VALUE = 1\n")
    new = cache.load_module("toy", "VALUE = 2\n")
    assert (old.VALUE, new.VALUE) == (1, 2)
    assert cache.load_module("toy", "VALUE = 1\n") is old
    assert Path(old.__file__).read_text() == "VALUE = 1\n"


def test_changed_loop_or_size_changes_the_source() -> None:
    kernels = "def residual(q, result):\n    result[0] = q[0]\n"
    source = linked_source(kernels, [newton_loops], {"N": 1}, "a test")
    assert source == linked_source(kernels, [newton_loops], {"N": 1}, "a test")
    for other in (
        linked_source(kernels.replace("q[0]", "2.0*q[0]"), [newton_loops], {"N": 1}, "a test"),
        linked_source(kernels, [newton_loops], {"N": 2}, "a test"),
        linked_source(kernels, [], {"N": 1}, "a test"),
    ):
        assert cache.kernel_hash(other) != cache.kernel_hash(source)


def test_cache_folder_that_cannot_be_written_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "file" / "below"))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    folder = cache.cache_folder()
    assert folder.is_dir()
    assert folder.parent == tmp_path
    # Code is imported from it: nobody else may write there.
    assert folder.stat().st_mode & 0o077 == 0


def test_damaged_kernel_file_is_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    source = "ANSWER = 42\n"
    digest = cache.kernel_hash(source)
    path = tmp_path / "kernels" / digest / f"vehiclemor_kernels_damaged_{digest}.py"
    path.parent.mkdir(parents=True)
    for damaged in ("", "ANSWER = 41\n"):
        path.write_text(damaged)
        assert cache.load_module("damaged", source).ANSWER == 42
        del sys.modules[path.stem]
    assert path.read_text() == source
