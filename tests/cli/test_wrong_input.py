"""Wrong arguments and files: one clear line, and nothing is lost."""

from pathlib import Path

import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.parameters import parameter_path

TRAVEL = "simulate double_wishbone"
POD = f"{TRAVEL} --method pod --set"
# What the line must say of a command.  What is wrong from Python too is in unit/test_borders.py.
WRONG = [
    ("simulate double_wishbon", "double_wishbone"),
    (f"{TRAVEL} --parameter upper_arm_front_pivot=-0.25,0.51,0.11", "can't be assembled"),
    (f"{POD} rank", "key=value"),
    (f"{POD} rank=3 --set rank=4", "rank is given twice"),
    ("figures --only vehicles,figure-11", "--only vehicles figure-11"),
    (f"{TRAVEL} --training nominal,matched", "--training nominal matched"),
    (f"{TRAVEL} --colour red", "'--colour'; known: --all-outputs, "),
    (f"{TRAVEL} --metod pod", "did you mean --method"),
    ("show nothing", "are known: vehiclemor list"),
    (f"{TRAVEL} --co\x1b[31mlour red", r"\x1b[31m"),
    (f"sim\x1b[31mulate {'x' * 100_000}", r"\x1b[31m"),
    ("run bad\udcff/s.toml", r"bad\udcff"),
    ("run figure-12 --out elsewhere", "--results"),
    (f"{TRAVEL} --out run.txt", "run.txt"),
    (f"{TRAVEL} --out none/run.nc", "none/run.nc"),
    (f"{TRAVEL} --plot a.txt", "a.txt"),
    (f"{POD} bounds=1 trust=off", "takes bounds and trust"),
    *[(f"{TRAVEL} --method shipped --{s}", "fitted already") for s in ("set a=1", "training set")],
    (f"{TRAVEL} --csv", "--csv"),
    ("export double_wishbone --to c --input", "--input"),
    ("metrics double_wishbone", "no vehicle"),
    ("metrics independent_suspension_vehicle --maneuver lane_change", "step_steer"),
    ("run figures-6-7 --jobs 1.5", "1.5"),
    ("export double_wishbone --to c --set rank=3", "--method"),
    ("export double_wishbone --to c --method shipped --set rank=3", "settings"),
]


@pytest.fixture
def fails(capsys):
    """Run the command line; it must fail with one line that has all the words, which it gives."""

    def run(arguments, *words):
        assert main([str(a) for a in arguments]) == 2
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1, captured.err
        assert captured.err.removesuffix("\n").isprintable()
        assert len(captured.err) < 1100
        assert "Traceback" not in captured.err
        assert captured.out == ""
        for word in words:
            assert word in captured.err, captured.err
        return captured.err

    return run


@pytest.mark.parametrize(("command", "word"), WRONG)
def test_wrong_values_are_one_line_and_leave_nothing(fails, command, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fails(command.split(), word)
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_wrong_are_named(fails, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(parameter_path("double_wishbone").read_text().replace('"m"', '"mm"'))
    with pytest.raises(vm.VehiclemorError, match="'mm'"):
        vm.model("double_wishbone", parameter_file=path)
    path.write_bytes(bytes(range(256)))
    fails(["run", path], str(path), "UTF-8")


def test_output_that_is_something_else_is_kept(fails, tmp_path):
    out, long = tmp_path / "result.nc", tmp_path / ("n" * 300)
    out.write_text("my notes")
    simulate, study = [*TRAVEL.split(), "--out"], ["run", "figures-6-7", "--results"]
    fails([*simulate, out], "result.nc", "move it away")
    fails([*simulate, tmp_path], "ends with .nc")
    fails([*simulate, f"{long}.nc"], "too long")
    fails([*study, out], "not a folder")
    fails([*study, long], "too long")
    fails(["figures", "--only", "figure-11", "--out", out], "not a folder")
    fails(["run", f"{long}.toml"], "too long")
    if Path("/proc/self").is_dir():  # a place where nobody writes
        fails([*study, "/proc/self/results"], "can't be written")
        fails(["figures", "--only", "figure-11", "--out", "/proc/self/figures"], "can't be written")
    assert out.read_text() == "my notes"
