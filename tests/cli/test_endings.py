"""How commands end: one line on standard error for whatever went wrong, and an exit status."""

import errno
import io
import os
import signal
import sys
from dataclasses import replace

import pytest

from vehiclemor.cli import main
from vehiclemor.cli.app import ended
from vehiclemor.errors import MachineError
from vehiclemor.reduction.methods import replay
from vehiclemor.study import run as study_run

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
    "error", [MachineError("killed"), MemoryError("7 TiB"), OSError(errno.ENOSPC, "No space")]
)
def test_what_the_machine_does_is_one_line_and_status_1(capsys, error):
    assert ended(lambda: raising(error)) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert str(error.args[-1]) in line


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
        assert "8 grid points, 6 runs: 6 ok (2 not to" in " ".join(printed.out.split())
    shown = io.BytesIO()
    # A terminal that can't show a name ends no study.
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    assert run() == 0
    sys.stdout.flush()
    assert shown.getvalue().startswith(rb"\u8eca: 8 grid points")
