"""Logs: windows of measured files are runs of protocols and grids; wrong files are refused."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR, WISHBONE
from tests.study.conftest import SMALL
from vehiclemor.cli import main
from vehiclemor.study.plans.protocol import load_protocol

# Of the car, with a steering wheel against ISO 8855; its times are in ms and jitter.
DRIVE = f"""
title = "drive"
extends = "predictive-{CAR}"
rows = ["single track"]
[[test]]
log = "drives/drive.csv"
name = "drive"
window = 6.0
step = 4.0
separator = ";"
decimal = ","
time = {{ column = "t", unit = "ms" }}
speed_column = {{ column = "v", unit = "km/h", of = "mean" }}
inputs.delta = {{ column = "wheel", unit = "deg", scale = -0.0625 }}
"""
# Of the suspension.
BUMP = """
[[test]]
log = "bump.csv"
window = 4.0
step = 2.0
lead_in = 0.5
inputs.z = { column = "height", unit = "mm" }
"""
LARGE = BUMP.replace("step = 2.0", 'name = "large"\namplitude = [1.0, 1.5]')
BUMPS = (
    f"{SMALL.partition('targets')[0]}{BUMP}{LARGE}[[methods]]{SMALL.partition('[[methods]]')[2]}"
)
TIMES = 0.02 * np.arange(451)
HEIGHT = 20.0 + 30.0 * np.sin(1.3 * TIMES)
ROWS = [f"{time:.2f},{height:.4f}" for time, height in zip(TIMES, HEIGHT, strict=True)]


def log_of(*rows):
    return "\n".join(["time,height", *rows, ""])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with a log, a protocol, and its results."""
    folder = tmp_path_factory.mktemp("logs")
    (folder / "bump.csv").write_text(log_of(*ROWS))
    (folder / "bumps.toml").write_text(BUMPS)
    vm.run_study(folder / "bumps.toml", results=folder / "results")
    return folder


def test_a_window_has_the_log_in_si_units_after_its_lead_in(tmp_path, monkeypatch):
    t = 5.0 + 0.01 * np.arange(2001) + np.random.default_rng(1).uniform(0.0, 0.005, 2001)

    def wheel(since):
        return 30.0 + 20.0 * np.sin(0.7 * since)

    columns = np.column_stack([1000.0 * t, wheel(t - t[0]), 72.0 + 3.6 * (t - t[0])])
    rows = [";".join(f"{value:.9g}" for value in row).replace(".", ",") for row in columns]
    (tmp_path / "drives").mkdir()
    (tmp_path / "drives" / "drive.csv").write_text("\n".join(["t;wheel;v", *rows]))
    (tmp_path / "drive.toml").write_text(DRIVE)
    protocol = load_protocol(str(tmp_path / "drive.toml"))
    # What the study extends tests something else.
    assert (protocol.definition.drawn, protocol.definition.straight) == (None, None)
    runs, later = protocol.sets["test"], np.linspace(1.0, 6.0, 101)
    assert [run.maneuver.name for run in runs] == [f"drive:{begin}" for begin in (0, 4, 8, 12)]
    for begin, run in zip((0.0, 4.0, 8.0, 12.0), runs, strict=True):
        assert run.speed == pytest.approx(20.0 + begin + 3.0, abs=0.01)
        expected = -np.radians(wheel(begin + later)) / 16.0
        np.testing.assert_allclose(run.maneuver.at(later)[:, 0], expected, atol=2e-6)
        # From straight running without a jump or a corner.
        early = run.maneuver.at(np.linspace(0.0, 0.1, 11))[:, 0]
        assert early[0] == 0.0
        assert np.abs(early).max() < 0.02 * np.abs(expected).max()
    # A study of another folder finds the log from there.
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    more = 'title = "more"\nextends = "drive.toml"\nrows = ["single track"]\n'
    (tmp_path / "other" / "more.toml").write_text(more)
    moved = load_protocol("other/more.toml").sets["test"]
    assert [run.run_key for run in moved] == [run.run_key for run in runs]


def test_the_command_counts_runs_by_log(folder, capsys):
    assert main(["run", str(folder / "bumps.toml"), "--results", str(folder / "results")]) == 0
    printed = capsys.readouterr().out
    found = vm.run_study(folder / "bumps.toml", results=folder / "results")
    assert found["maneuver"].values.tolist() == ["bump.csv"] * 3 + ["large"] * 4
    for label in ("replay", "fixed basis"):
        lines = printed.partition(f"\n{label}\n")[2].splitlines()[:3]
        assert [line.split()[0] for line in lines] == ["all", "bump.csv", "large"]
        every, *parts = np.array([line.split()[1:] for line in lines], int)
        assert every.tolist() == np.sum(parts, axis=0).tolist()
        runs, right, warned, missed, undetected, apart = every
        assert right + missed == runs == 7 - apart
        errors = found.sel(label=label, scenario=found["apart"] == "")
        beyond = errors["rms_error"].sel(output="spindle_y") > 7.57e-5
        beyond |= errors["max_error"].sel(output="second_euler_angle") > 2.4e-5
        ends = errors["status"]
        assert missed == (beyond | ~ends.isin(["ok", "untrusted"])).sum()
        assert (warned, undetected) == ((ends != "ok").sum(), (beyond & (ends == "ok")).sum())
    assert "newton" not in printed


def test_a_grid_runs_every_window(folder, tmp_path):
    text = f'title = "grid"\nmodel = "{WISHBONE}"\nmethods = [{{ method = "full_order" }}]\n'
    (folder / "grid.toml").write_text(text + BUMP.replace("test", "logs"))
    found = vm.run_study(folder / "grid.toml", results=tmp_path).squeeze()
    assert found["maneuver"].values.tolist() == ["bump.csv:0", "bump.csv:2", "bump.csv:4"]
    run = found.sel(maneuver="bump.csv:4")
    inputs, times = run["inputs"].sel(input="z").values, run["time"].values
    np.testing.assert_allclose(1e3 * inputs[25:], HEIGHT[225:401], atol=1e-3)
    signal = vm.Signal.from_samples(times, inputs, "cubic", inputs=["z"])
    alone = vm.simulate(WISHBONE, "full_order", maneuver=signal)
    np.testing.assert_allclose(run["outputs"], alone["outputs"], atol=1e-9)


def test_a_log_may_brake(tmp_path):
    times = 0.05 * np.arange(121)
    columns = times, 0.01 * np.sin(times), 500.0 * (times > 2.0), 0.5 + 0.0 * times
    text = "\n".join(",".join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True))
    (tmp_path / "brake.csv").write_text(f"time,wheel,brake,friction\n{text}\n")
    inputs = {"delta": "wheel", "brake_torque_FL": "brake", "friction_FL": "friction"}
    lines = [f'inputs.{name} = "{column}"' for name, column in inputs.items()]
    study = [f'title = "brake"\nmodel = "{CAR}"\nmethods = [{{ method = "full_order" }}]']
    study += ['[[logs]]\nlog = "brake.csv"\nwindow = 6.0', *lines]
    (tmp_path / "brake.toml").write_text("\n".join(study))
    run = vm.run_study(tmp_path / "brake.toml", results=tmp_path).squeeze()
    found = run["inputs"].sel(input=["brake_torque_FL", "friction_FL"]).values
    # The friction goes over from 1, and no spline makes a brake push.
    np.testing.assert_allclose(found[[0, -1]], [[0.0, 1.0], [500.0, 0.5]])
    assert found.min() == 0.0
    assert run["status"] == "ok"


# Part of the study -> what stands in its place, or the log's text; and what the line says.
WRONG = [
    ("", log_of(*ROWS[:100], *ROWS[160:]), "a gap of 1.22 s from 1.98 s on, after row 100"),
    ("", log_of(*ROWS[:100], *ROWS[99:]), "increase, but 1.98 s in row 101 follows 1.98 s"),
    ("", log_of(*ROWS[:100], ",1.0", *ROWS[101:]), "'time' has no number in row 101"),
    ("", log_of(), "0 rows lie between begin and end"),
    ('"mm"', '"inch"', "test, group 1: unknown unit 'inch'"),
    ("inputs.z", "inputs.y", "unknown input of double_wishbone 'y'"),
    ('"bump.csv"', '"none.csv"', "none.csv: no such file"),
    ("lead_in", "begin = 7.0\nlead_in", "no window of 4 s fits into 2 s"),
    ("step = 2.0", "step = 1e-4", "number of windows: 50001 is above 10000"),
    ("step", 'speed = [1.0]\nspeed_column = "height"\nstep', "give speed or speed_column"),
    ('name = "large"', "", "are two runs: give one log a name"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_a_wrong_log_is_refused_in_one_line_and_loses_nothing(
    folder, tmp_path, capsys, old, new, words
):
    (tmp_path / "bump.csv").write_text(log_of(*ROWS) if old else new)
    (tmp_path / "bumps.toml").write_text(BUMPS.replace(old, new, 1) if old else BUMPS)
    stored = {path: path.read_bytes() for path in (folder / "results").rglob("*.*")}
    study, results = str(tmp_path / "bumps.toml"), str(folder / "results")
    assert main(["run", study, "--results", results]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert words in line
    assert {path: path.read_bytes() for path in (folder / "results").rglob("*.*")} == stored
