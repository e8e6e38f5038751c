"""Commands: what they print and write is what was declared, and how they end."""

import errno
import io
import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import vehiclemor as vm
from tests.models import CAR
from vehiclemor import progress
from vehiclemor.cli import main, studies
from vehiclemor.cli.app import COMMANDS, ended
from vehiclemor.cli.options import key_values
from vehiclemor.exceptions import MachineError
from vehiclemor.files import data_names
from vehiclemor.parameters import load_parameters
from vehiclemor.reduction.methods import replay
from vehiclemor.registry import component, names
from vehiclemor.report.description import SCHEMAS
from vehiclemor.study import run as study_run
from vehiclemor.study.plans.loading import load_studies


@pytest.fixture
def printed(capsys, monkeypatch):
    """Run the command line where no terminal says how wide it is; its output, which fits."""
    monkeypatch.delenv("COLUMNS", raising=False)

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 0
        text = capsys.readouterr().out
        # A word that is longer than a line, such as a path, can't be broken.
        assert not [s for s in text.splitlines() if len(s) > 80 and " " in s.strip()]
        return text

    return run


def test_names_and_citation(printed, capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert set(listed) == {"models", "methods", "maneuvers", "studies"}
    assert listed["models"] == vm.models()
    assert main(["cite"]) == 0
    assert "10.1115/1.4029390" in capsys.readouterr().out
    text, every = printed("list"), [name for entries in listed.values() for name in entries]
    assert all(f"  {name}" in text for name in every)
    for name in [*every, *SCHEMAS]:
        printed("show", name)


def test_help(printed):
    text = printed("--help")
    for command in COMMANDS:
        assert command in text
        printed(command, "--help")


def test_simulate_writes_what_the_interface_returns(tmp_path, printed, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out, point = "run.nc", [0.0, 0.8, -0.13]
    pod = "--method pod --set rank=2 --frequency 1.1 --training nominal travel_and_rack"
    parameter = "--parameter wheel_centre=0,0.8,-0.13"
    text = printed(*f"simulate double_wishbone {pod} {parameter} --out {out}".split())
    assert f"written: {out}" in text
    model = vm.model("double_wishbone", {"wheel_centre": point})
    training = ["nominal", "travel_and_rack"]
    expected = vm.simulate(model, "pod", rank=2, frequency=1.1, training=training)
    with xr.open_dataset(out) as written:
        np.testing.assert_array_equal(written["coordinates"], expected["coordinates"])
        assert list(written["coordinate"].values) == list(model.coordinates)
        assert json.loads(written.attrs["configuration"])["parameters"]["wheel_centre"] == point


def test_metrics_stand_side_by_side_with_their_standard(printed):
    command = f"metrics {CAR} --maneuver step_steer --speed 22 --method shipped"
    text = printed(*command.split())
    assert "step_steer (ISO 7401), 22 m/s" in text
    rows = json.loads(printed(*command.split(), "--json"))
    gain = next(row for row in rows if row["number"] == "yaw rate gain")
    assert gain["unit"] == "1/s"
    run = vm.model(CAR, {"initial_speed": 22.0}).simulate(vm.maneuver("step_steer"))
    assert gain["full"] == pytest.approx(float(vm.metrics(run)["yaw_rate_gain"]), rel=1e-6)
    assert gain["shipped"] == pytest.approx(gain["full"], rel=0.01)


def test_a_log_is_simulated_as_its_signal_and_drawn(tmp_path, printed, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    times = np.linspace(0.0, 1.0, 11)
    rows = [f"{t:.1f};{10.0 * t:.1f}".replace(".", ",") for t in times]
    (tmp_path / "log.csv").write_text("\n".join(["Time [s];Travel [mm]", *rows]))
    words = ["time=Time [s]", "z=Travel [mm]", "unit=mm", "separator=;", "decimal=,", "hold=cubic"]
    log = "--maneuver", "log.csv", "--csv", *words
    printed("simulate", "double_wishbone", *log, "--out", "run.nc")
    signal = vm.Signal.from_samples(times, 0.01 * times, "cubic", inputs="z")
    expected = vm.simulate("double_wishbone", maneuver=signal)
    with xr.open_dataset("run.nc") as written:
        np.testing.assert_allclose(written["coordinates"], expected["coordinates"], atol=1e-12)
    assert "written: run-histories.png" in printed("plot", "run.nc")
    printed("simulate", "double_wishbone", *log, "--method", "shipped", "--out", "run.nc", "--plot")
    run, full = (model("double_wishbone").simulate(signal) for model in (vm.rom, vm.model))
    with xr.open_dataset("run.nc") as written:
        np.testing.assert_array_equal(written["outputs"], run.outputs)
        np.testing.assert_allclose(written["rms_error"], vm.errors(run, full)["rms_error"])
    assert main(["simulate", "double_wishbone", "--csv", "unit=mm"]) == 2
    assert "--maneuver FILE.csv" in capsys.readouterr().err


def test_text_of_the_command_line_gets_its_kind():
    texts = ["3", "-2", "2.5", "1e-6", "fast", "3a", "1,2.5", "theta,alpha", ""]
    values = [3, -2, 2.5, 1e-6, "fast", "3a", [1.0, 2.5], "theta,alpha", ""]
    found = key_values("--set", [f"{k}={text}" for k, text in enumerate(texts)])
    assert list(map(repr, found.values())) == list(map(repr, values))


# What a name declares


@pytest.mark.parametrize("name", names("model"))
def test_a_model_shows_all_that_it_declares(name):
    model, definition = vm.model(name), component("model", name)
    shown = vm.describe(name)
    for kind in ("inputs", "outputs", "coordinates", "speeds", "equations", "constraints"):
        declared = [(q.name, q.unit, q.long_name) for q in getattr(definition, kind)]
        assert [tuple(row.values()) for row in shown[kind]] == declared
    entries = load_parameters(name, definition.parameters, definition.parameter_file).entries
    for row, (parameter, entry) in zip(shown["parameters"], entries.items(), strict=True):
        assert (row["name"], row["value"], row["unit"]) == (parameter, entry.value, entry.unit)
        assert (row["status"], row["source"]) == (entry.status, entry.source)
    assert {row["source"] for row in shown["sources"]} >= {e.source for e in entries.values()}
    assert shown["starts"] == list(model.starts)
    accepting = [m for m in names("method") if component("method", m).accepts(model)[0]]
    assert shown["methods"] == accepting


def test_a_study_shows_its_file_and_its_members():
    for name in data_names("studies"):
        shown, definitions = vm.describe(name), load_studies(name)
        assert Path(shown["file"]).stem == name
        assert {row["study"]: row["runs"] for row in shown["studies"]} == {
            member: definition.points for member, definition in definitions.items()
        }


STUDY = """
title = "for the tests"
model = "double_wishbone"
keep = "metrics"
training = "nominal"
grid = { rank = [2, 3], amplitude_factor = [1.0, 1.3] }
methods = [{ method = "pod" }, { method = "replay" }]
"""


@pytest.fixture
def run(tmp_path):
    """Run the study; its exit status."""
    path = tmp_path / "車.toml"
    path.write_text(STUDY)
    return lambda: main(["run", str(path), "--results", str(tmp_path / "out")])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_with_a_hint(run, monkeypatch, capsys, number):
    killed = lambda _: os.kill(os.getpid(), number) or {}  # noqa: E731
    monkeypatch.setattr(study_run, "studies_and_files", killed)
    before = signal.getsignal(number)
    assert run() == 128 + number
    assert capsys.readouterr().err.count("\n") == 1
    assert signal.getsignal(number) is before


def raising(error):
    raise error


@pytest.mark.parametrize(
    "error",
    [
        MachineError("killed"),
        MemoryError("7 TiB"),
        OSError(errno.ENOSPC, "No space"),
        OSError(errno.EFBIG, "File too large"),
        OSError("no shared object"),
        ImportError("no shared object"),
    ],
)
def test_what_the_machine_does_is_one_line_and_status_1(capsys, error):
    assert ended(lambda: raising(error)) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert str(error.args[-1]) in line


def test_a_long_study_tells_how_far_it_is_every_five_seconds(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 4.9, 5.0, 9.9, 10.0, 20.0])
    monkeypatch.setattr(studies, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    with studies.shown_progress():
        for done in (0, 1, 2, 3, 4, 9):
            progress.tell("grid", done, 9)
    lines = ["grid: 9 of 9 to compute", "grid: 2 of 9, 5 s", "grid: 4 of 9, 10 s"]
    assert capsys.readouterr().err.splitlines() == lines


def test_runs_are_counted_and_those_with_errors_tried_again(run, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        broken = replace(replay.METHOD, check=lambda *_: raising(ZeroDivisionError()))
        patch.setattr(replay, "METHOD", broken)
        assert run() == 1
        assert "2 error, 4 ok" in capsys.readouterr().out
    for missing in ("車: 2 of 6 to compute", ""):
        assert run() == 0
        printed = capsys.readouterr()
        assert printed.err.partition("\n")[0] == missing
        assert "8 grid points, 6 runs: 6 ok (3 untrusted)" in printed.out
    shown = io.BytesIO()
    # A terminal that can't show a name ends no study.
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    assert run() == 0
    sys.stdout.flush()
    assert shown.getvalue().startswith(rb"\u8eca: 8 grid points")
