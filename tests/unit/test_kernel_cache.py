"""Compiled kernels are kept by content: a second process compiles nothing, new source is new."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from vehiclemor.codegen import cache, straight_line
from vehiclemor.codegen.link import linked_source
from vehiclemor.simulation import newton_loops

SIMULATE = """
import json
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import build

model = build("double_wishbone")
run = model.simulate(component("maneuver", "sine_travel"))
used = {
    name: [sum(d.stats.cache_hits.values()), sum(d.stats.cache_misses.values())]
    for name, d in vars(model.kernels).items()
    if getattr(d, "signatures", None)
}
print(json.dumps([used, model.kernels.__file__, run.coordinates[250].tolist()]))
"""

DYNAMIC = """
import json
import numpy as np
from vehiclemor.simulation.dynamic import build

model = build("independent_suspension_vehicle")
found = model.derivatives_at(model.start()[None], np.zeros((1, 1)))
used = {
    name: [sum(d.stats.cache_hits.values()), sum(d.stats.cache_misses.values())]
    for name, d in vars(model.kernels).items()
    if getattr(d, "signatures", None)
}
machine = {n: d.cache_hits for n, d in vars(model.kernels).items() if n.endswith("_machine")}
print(json.dumps([used, machine, found.tolist()]))
"""


def test_second_process_writes_no_machine_code_of_a_dynamic_model(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment["VEHICLEMOR_CACHE"] = str(tmp_path)
    found = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", DYNAMIC],
            env=environment,
            cwd=tmp_path,
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    (_, cold, first), (used, machine, second) = found
    assert set(cold.values()) == {0}
    assert {"_derivative_machine", "_second_order_machine", "_outputs_machine"} <= set(machine)
    assert set(machine.values()) == {1}
    assert {"derivative_path", "constants"} <= set(used)
    for name, (hits, misses) in used.items():
        assert hits > 0, name
        assert misses == 0, name
    assert first == second


def test_machine_code_follows_the_source_that_writes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = "def f(_q, _work, _result):\n    _result[0] = _q[0]\n"
    source = linked_source(kernels, [], {}, "a test", direct=True)
    assert source == linked_source(kernels, [], {}, "a test", direct=True)
    monkeypatch.setattr(straight_line, "source_hash", lambda: "another")
    assert source != linked_source(kernels, [], {}, "a test", direct=True)


def test_second_process_compiles_nothing(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment["VEHICLEMOR_CACHE"] = str(tmp_path)

    def process() -> tuple[dict[str, list[int]], Path, list[float]]:
        done = subprocess.run(
            [sys.executable, "-c", SIMULATE],
            env=environment,
            cwd=tmp_path,
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        used, path, state = json.loads(done.stdout)
        return used, Path(path), state

    first, source, cold = process()
    assert first["newton_path"] == [0, 1]
    written = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    second, same, warm = process()
    assert {"newton_path", "residual", "residual_jacobian", "constants"} <= set(second)
    for name, (hits, misses) in second.items():
        assert hits > 0, name
        assert misses == 0, name
    assert same == source
    assert tmp_path in source.parents
    assert warm == cold
    # Nothing was written again, and no half-written file is left.
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*") if p.is_file()} == written
    assert not [path for path in written if path.suffix == ".tmp"]


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
