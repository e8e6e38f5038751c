"""Logs: windows of measured files are runs of protocols and grids; wrong files are refused."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR, WISHBONE
from tests.study.conftest import SMALL
from vehiclemor.cli import main
from vehiclemor.study.plans.protocol import load_protocol

# Rows of the time in ms that jitter, steering wheel (deg, against ISO 8855), speed (km/h).
MILLISECONDS = 5000.0 + 10.0 * np.arange(2001) + np.random.default_rng(1).uniform(0.0, 5.0, 2001)
RATIO = 16.0
CAR_LOG = """
[[test]]
log = "drives/drive.csv"
name = "drive"
window = 6.0
step = 4.0
separator = ";"
decimal = ","
time = { column = "t", unit = "ms" }
speed_column = { column = "v", unit = "km/h", of = "mean" }
inputs.delta = { column = "wheel", unit = "deg", scale = -0.0625 }
"""
# Of the suspension: one file at two sizes, and what the tests of wrong files change.
FIRST = """
[[test]]
log = "bump.csv"
window = 4.0
step = 2.0
lead_in = 0.5
inputs.z = { column = "height", unit = "mm" }
"""
LOGS = f"""{FIRST}
[[test]]
log = "bump.csv"
name = "large"
window = 8.0
amplitude = [1.0, 1.5]
inputs.z = {{ column = "height", unit = "mm" }}
"""
HEAD, TAIL = SMALL[: SMALL.index("[[test]]")], SMALL[SMALL.index("[[methods]]") :]
HEAD = HEAD[: HEAD.index("targets")]
TIMES = 0.02 * np.arange(451)


def wheel(seconds):
    """Steering wheel (deg) of the log of the car."""
    return 30.0 + 20.0 * np.sin(0.7 * seconds)


def height(seconds):
    """Height (mm) of the wheel in the log of the suspension."""
    return 20.0 + 30.0 * np.sin(1.3 * seconds)


def write_log(path, names, *columns, separator=",", decimal="."):
    rows = [separator.join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path.parent.mkdir(exist_ok=True)
    text = "\n".join([separator.join(names), *rows, ""])
    path.write_text(text if decimal == "." else text.replace(".", decimal))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with a log and a protocol of the suspension."""
    folder = tmp_path_factory.mktemp("logs")
    write_log(folder / "bump.csv", ["time", "height"], TIMES, height(TIMES))
    (folder / "bumps.toml").write_text(HEAD + LOGS + TAIL)
    return folder


@pytest.fixture(scope="module")
def done(folder):
    """The protocol's result, and the text of the command that has run it."""
    return vm.run_study(folder / "bumps.toml", results=folder / "results")


def test_a_window_has_the_log_in_si_units_after_its_lead_in(tmp_path):
    seconds = (MILLISECONDS - MILLISECONDS[0]) / 1000.0
    columns = MILLISECONDS, wheel(seconds), 72.0 + 3.6 * seconds
    how = {"separator": ";", "decimal": ","}
    write_log(tmp_path / "drives" / "drive.csv", ["t", "wheel", "v"], *columns, **how)
    study = f'title = "drive"\nextends = "predictive-{CAR}"\nrows = ["single track"]\n{CAR_LOG}'
    (tmp_path / "drive.toml").write_text(study)
    protocol = load_protocol(str(tmp_path / "drive.toml"))
    # What is tested comes from this file alone.
    assert (protocol.definition.drawn, protocol.definition.straight) == (None, None)
    runs = protocol.sets["test"]
    assert [run.maneuver.name for run in runs] == [f"drive:{n}" for n in (0, 4, 8, 12)]
    for begin, run in zip((0.0, 4.0, 8.0, 12.0), runs, strict=True):
        assert run.speed == pytest.approx(20.0 + begin + 3.0, abs=0.01)
        later = np.linspace(1.0, 6.0, 101)
        delta = run.maneuver.at(later)[:, 0]
        expected = -np.radians(wheel(begin + later)) / RATIO
        np.testing.assert_allclose(delta, expected, atol=2e-6)
        # From straight running, smoothly: there is neither a jump nor a corner.
        early = run.maneuver.at(np.linspace(0.0, 0.1, 11))[:, 0]
        assert early[0] == 0.0
        assert np.abs(early).max() < 0.02 * np.abs(expected).max()
    # Another folder's study finds it from there.
    (tmp_path / "other").mkdir()
    more = 'title = "more"\nextends = "drive.toml"\nrows = ["single track"]\n'
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        (tmp_path / "other" / "more.toml").write_text(more)
        moved = load_protocol("other/more.toml").sets["test"]
        assert [run.run_key for run in moved] == [run.run_key for run in runs]


def test_quick_noise_is_filtered_where_that_is_asked_for(tmp_path):
    noise = 5.0 * np.sin(2.0 * np.pi * 15.0 * TIMES)
    write_log(tmp_path / "bump.csv", ["time", "height"], TIMES, height(TIMES) + noise)
    quiet = LOGS.replace("lead_in = 0.5", "low_pass = 3.0")
    (tmp_path / "quiet.toml").write_text(HEAD + quiet + TAIL)
    runs = load_protocol(str(tmp_path / "quiet.toml")).sets["test"]
    later = np.linspace(1.0, 3.0, 41)
    off = 1e3 * runs[1].maneuver.at(later)[:, 0] - height(2.0 + later)
    assert np.abs(off).max() < 0.2


def test_runs_of_windows_are_judged_and_counted_by_log(folder, done, capsys):
    assert done["maneuver"].values.tolist() == ["bump.csv"] * 3 + ["large"] * 2
    study, results = folder / "bumps.toml", folder / "results"
    assert main(["run", str(study), "--results", str(results)]) == 0
    printed = capsys.readouterr().out
    for label in ("replay", "fixed basis"):
        lines = printed.partition(f"\n{label}\n")[2].splitlines()[:3]
        assert [line.split()[0] for line in lines] == ["all", "bump.csv", "large"]
        every, *parts = np.array([line.split()[1:] for line in lines], int)
        assert every.tolist() == np.sum(parts, axis=0).tolist()
        runs, right, warned, missed, undetected, apart = every
        assert right + missed == runs == 5 - apart
        errors = done.sel(label=label, scenario=done["apart"] == "")
        y = errors["rms_error"].sel(output="spindle_y") > 7.57e-5
        angle = errors["max_error"].sel(output="second_euler_angle") > 2.4e-5
        ended = errors["status"].isin(["ok", "untrusted"])
        assert missed == (y | angle | ~ended).sum()
        assert undetected == ((y | angle) & (errors["status"] == "ok")).sum()
        assert warned == (errors["status"] != "ok").sum()
    assert "newton" not in printed


def test_two_windows_may_be_alike(folder):
    still = LOGS.replace("step = 2.0", "amplitude = [0.0]")
    (folder / "still.toml").write_text(HEAD + still + TAIL)
    assert len(load_protocol(str(folder / "still.toml")).sets["test"]) == 4


def test_a_grid_runs_every_window(folder, tmp_path):
    text = f'title = "grid"\nmodel = "{WISHBONE}"\nmethods = [{{ method = "full_order" }}]\n'
    text += FIRST.replace("test", "logs")
    (folder / "grid.toml").write_text(text)
    found = vm.run_study(folder / "grid.toml", results=tmp_path)
    assert found["maneuver"].values.tolist() == ["bump.csv:0", "bump.csv:2", "bump.csv:4"]
    inputs = found["inputs"].sel(maneuver="bump.csv:4", input="z").squeeze()
    late = inputs["time"].values >= 0.5
    expected = 1e-3 * height(4.0 + inputs["time"].values)
    np.testing.assert_allclose(inputs.values[late], expected[late], atol=1e-5)
    signal = vm.Signal.from_samples(inputs["time"].values, inputs.values, "cubic", inputs=["z"])
    alone = vm.simulate(WISHBONE, "full_order", maneuver=signal)
    outputs = found["outputs"].sel(maneuver="bump.csv:4").squeeze()
    np.testing.assert_allclose(outputs, alone["outputs"].values, atol=1e-6)


ROWS = [f"{t:.2f},{z:.3f}" for t, z in zip(TIMES, height(TIMES), strict=True)]


def lines_of(*rows):
    return "\n".join(["time,height", *rows, ""])


# What stands in the study's place, the log's text, and what the line says.
WRONG = [
    ("", lines_of(*ROWS[:100], *ROWS[160:]), "a gap of 1.22 s from 1.98 s on, after row 100"),
    ("", lines_of(*ROWS[:100], ROWS[99], *ROWS[100:]), "must increase; row 101 has 1.98 s after"),
    ("", lines_of(*ROWS[:100], "2.00,", *ROWS[101:]), "'height' has no number in row 101"),
    ("", lines_of(*ROWS[:100], "2.00,inf", *ROWS[101:]), "'height' has no number in row 101"),
    ("", lines_of(*ROWS[:100], ",1.0", *ROWS[101:]), "row 101 has no time"),
    ("", lines_of(*ROWS[:150]), "no window of 4 s fits into 2.98 s"),
    ("", lines_of(ROWS[0]), "1 rows lie between"),
    ('"height"', '"hight"', "there is no column 'hight': set z= to one of time, height"),
    ("lead_in", 'time = "t"\nlead_in', "there is no column 't': set time="),
    ('"mm"', '"inch"', "unknown unit 'inch'"),
    ("inputs.z", "inputs.y", "unknown input of double_wishbone 'y'"),
    ('"bump.csv"', '"none.csv"', "none.csv: no such file"),
    ("lead_in", "begin = 7.0\nlead_in", "no window of 4 s fits into 2 s"),
    ("lead_in", "low_pass = 30.0\nlead_in", "low_pass: 30 Hz is above 22.5 Hz"),
    ("step = 2.0", "step = 1e-4", "number of windows: 50001 is above 10000"),
    ("step = 2.0", "speed = [1.0]", "has no initial_speed"),
    ("step = 2.0", 'speed = [1.0]\nspeed_column = "height"', "speed or speed_column, not both"),
    ("window = 4.0", "", "test.0.log.window: Field required"),
    ('name = "large"', "", "are two runs: give one log a name"),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_a_log_that_cant_be_used_is_refused_and_loses_nothing(
    folder, done, tmp_path, capsys, old, new, words
):
    text = HEAD + LOGS + TAIL
    (tmp_path / "bump.csv").write_text((folder / "bump.csv").read_text() if old else new)
    (tmp_path / "bumps.toml").write_text(text.replace(old, new, 1) if old else text)
    before = {path: path.read_bytes() for path in (folder / "results").rglob("*.*")}
    study, results = str(tmp_path / "bumps.toml"), str(folder / "results")
    capsys.readouterr()
    assert main(["run", study, "--results", results]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert words in line
    assert {path: path.read_bytes() for path in (folder / "results").rglob("*.*")} == before
