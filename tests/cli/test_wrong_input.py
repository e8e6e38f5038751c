"""Wrong input: one clear line on standard error, exit status 2, and nothing is lost."""

import os
import stat
import sys
from pathlib import Path

import pytest

from vehiclemor.resources import data_folder

STUDY = """
title = "for the tests"
model = "double_wishbone"
[grid]
rank = [3]
[[methods]]
method = "pod"
"""


@pytest.fixture
def study(tmp_path):
    def write(text=STUDY, old="", new=""):
        path = tmp_path / "mine.toml"
        path.write_text(text.replace(old, new) if old else text)
        return path

    return write


@pytest.fixture
def parameters(tmp_path):
    def write(old, new):
        text = (data_folder() / "parameters" / "double_wishbone.toml").read_text()
        assert old in text
        path = tmp_path / "parameters.toml"
        path.write_text(text.replace(old, new, 1))
        return path

    return write


SIMULATE = ("simulate", "double_wishbone")
POD = (*SIMULATE, "--method", "pod")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "double_wishbon"], ["unknown model", "double_wishbone"]),
        ([*SIMULATE, "--method", "pood"], ["unknown method", "pod"]),
        ([*SIMULATE, "--maneuver", "sine"], ["unknown maneuver", "sine_travel"]),
        ([*SIMULATE, "--start", "dropped"], ["unknown start", "equilibrium"]),
        ([*SIMULATE, "--training", "matchd"], ["unknown training", "matched"]),
        ([*POD, "--preset", "litteral"], ["unknown preset", "literal"]),
        ([*POD, "--set", "rnak=3"], ["unknown setting", "rank"]),
        ([*POD, "--set", "rank"], ["key=value"]),
        ([*POD, "--set", "rank=3", "--set", "rank=4"], ["rank is given twice"]),
        ([*POD, "--set", "snapshots=1000000000"], ["snapshots", "at most"]),
        ([*POD, "--set", "control_period=1e-9"], ["control_period"]),
        ([*SIMULATE, "--frequency", "1e308"], ["frequency factor", "above"]),
        (["figures", "--only", ","], ["names no figure"]),
        ([*SIMULATE, "--out", "run.txt"], ["run.txt", "ends with .nc"]),
        ([*POD, "--set", "rank=0"], ["rank is 0", "at least 1"]),
        ([*POD, "--set", "rank=2.5"], ["rank", "integer"]),
        ([*POD, "--set", "rank=9", "--set", "snapshots=20"], ["rank 9", "8 coordinates"]),
        ([*POD, "--set", "rank=6", "--set", "snapshots=5"], ["rank 6", "snapshots 5"]),
        ([*POD, "--set", "snapshots=1"], ["snapshots is 1", "at least 2"]),
        ([*POD, "--set", "test_space=petrov"], ["test_space", "galerkin"]),
        ([*POD, "--set", "control_period=0"], ["control_period", "above 0"]),
        ([*POD, "--set", "control_period=nan"], ["control_period", "not finite"]),
        ([*POD, "--set", "reversed_coordinates=theta"], ["theta", "not a coordinate"]),
        ([*SIMULATE, "--set", "solver=lu"], ["solver", "newton"]),
        ([*SIMULATE, "--frequency", "0"], ["frequency factor", "not positive"]),
        ([*SIMULATE, "--frequency", "-1"], ["frequency factor", "not positive"]),
        ([*SIMULATE, "--amplitude", "nan"], ["amplitude factor", "not finite"]),
        ([*SIMULATE, "--amplitude", "big"], ["big"]),
        ([*SIMULATE, "--amplitude", "3"], ["out of reach", "-0.2146 to 0.2966 m"]),
        ([*SIMULATE, "--amplitude", "-2.2"], ["out of reach", "t = "]),
        ([*SIMULATE, "--colour", "red"], ["--colour"]),
        (["simulate"], ["model"]),
        (["simulat", "double_wishbone"], ["simulat"]),
        (["list", "cars"], ["cars"]),
        (["run", "figure-15"], ["unknown study", "figure-1"]),
        (["run", "no-such.toml"], ["no-such.toml", "no such file"]),
        (["run", "figures-6-7", "--jobs", "0"], ["jobs", "at least 1"]),
        (["compare", "papper"], ["unknown comparison", "paper"]),
        (["figures", "--only", "6,55"], ["unknown figure", "'55'"]),
    ],
)
def test_wrong_arguments(fails, arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fails(arguments, *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('unit = "m"', 'unit = "mm"', ["unit", "'mm'"]),
        ("value = [-0.1, 0.47, 0.105]", "value = [-100.0, 470.0, 105.0]", ["millimetres"]),
        ("value = [-0.1, 0.47, 0.105]", "value = [-0.1, 0.47]", ["3 components"]),
        ("value = [-0.1, 0.47, 0.105]", "value = [-0.1, nan, 0.105]", ["finite"]),
        ("value = [-0.1, 0.47, 0.105]", 'value = "long"', ["upper_arm_front_pivot"]),
        (
            "value = [-0.1, 0.47, 0.105]",
            "value = [-0.25, 0.51, 0.11]",
            ["can't be assembled", "coincide"],
        ),
        ("[parameters.wheel_centre]", "[parameters.wheel_center]", ["wheel_centre is missing"]),
        ('model = "double_wishbone"', 'model = "macpherson"', ["macpherson"]),
        ('source = "chrono"', 'source = "memory"', ["'memory' is not listed"]),
        ('status = "published"', 'status = "certain"', ["status"]),
        ('title = "', "title = ", ["not a valid TOML file"]),
    ],
)
def test_wrong_parameter_file(fails, parameters, old, new, words):
    path = parameters(old, new)
    fails(
        [*SIMULATE, "--parameters", path], str(path) if "coincide" not in words[-1] else "", *words
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rank = [3]", "rank = []", ["rank", "no values"]),
        ("rank = [3]", "rank = [3, 3]", ["same value twice"]),
        ("rank = [3]", "rank = [12]", ["rank 12"]),
        ("rank = [3]", "amplitude_factor = [inf]", ["amplitude", "not finite"]),
        ("rank = [3]", "frequency_factor = [-1.0]", ["frequency", "not positive"]),
        ("rank = [3]", "rang = [3]", ["unknown grid dimension", "rank"]),
        ('title = "for the tests"', "", ["title"]),
        ('method = "pod"', 'methode = "pod"', ["methods.0"]),
        ('method = "pod"', 'method = "dmd"', ["unknown method"]),
        ("[[methods]]", '[[methods]]\nmethod = "pod"\n[[methods]]', ["used twice"]),
        ('model = "double_wishbone"', "model = 3", ["model"]),
        ("[grid]", 'training = "set"\n[grid]', ["training_set"]),
        ("[grid]", "keep = 'all'\n[grid]", ["keep"]),
        ("[grid]", "[grid", ["not a valid TOML file"]),
    ],
)
def test_wrong_study_file(fails, study, tmp_path, old, new, words):
    fails(["run", study(STUDY, old, new), "--out", tmp_path / "results"], *words)
    assert not (tmp_path / "results").exists()


def test_study_file_that_is_no_text(fails, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(bytes(range(256)))
    fails(["run", path], "UTF-8")


def test_output_folder_that_is_a_file(fails, study, tmp_path):
    out = tmp_path / "results"
    out.write_text("my notes")
    fails(["run", study(), "--out", out], "not a folder")
    fails(["figures", "--only", "5", "--out", out], "not a folder")
    assert out.read_text() == "my notes"


def test_simulation_does_not_overwrite_a_foreign_file(fails, tmp_path):
    out = tmp_path / "result.nc"
    out.write_text("my notes")
    fails([*SIMULATE, "--out", out], "result.nc", "move it away")
    assert out.read_text() == "my notes"
    fails([*SIMULATE, "--out", tmp_path], "folder")
    fails([*SIMULATE, "--out", tmp_path / "none" / "result.nc"], "does not exist")


@pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() == 0, reason="root and Windows write everywhere"
)
def test_read_only_output_folder(fails, study, tmp_path):
    out = tmp_path / "results"
    out.mkdir()
    out.chmod(stat.S_IRUSR | stat.S_IXUSR)
    fails(["run", study(), "--out", out], "can't be written")
    fails(["figures", "--only", "5", "--out", out / "figures"], "can't be written")


def test_unwritable_output_folder_whoever_asks(fails, study):
    """A place where nobody can make folders, root neither."""
    if not Path("/proc/self").is_dir():
        pytest.skip("needs /proc")
    fails(["run", study(), "--out", "/proc/self/results"], "can't be written")
