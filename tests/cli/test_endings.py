"""How commands end: one line, and an exit status that tells whose fault it was."""

import errno
import io
import os
import signal
import sys
import time
from contextlib import suppress
from dataclasses import replace

import pytest

from vehiclemor.cli import ending, main
from vehiclemor.cli.ending import ended
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
needs_timer = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no such timer here")


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
    (line,) = capsys.readouterr().err.splitlines()
    assert "run again to resume" in line
    assert signal.getsignal(number) is before


@needs_timer
def test_a_signal_that_a_library_drops_is_raised_again(monkeypatch):
    monkeypatch.setattr(ending, "AGAIN", 0.1)

    def run():
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        signal.pause()

    assert ended(run) == 143
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def raising(error):
    raise error


@needs_timer
def test_a_signal_that_was_heard_does_not_cut_short_what_ends_workers(monkeypatch):
    monkeypatch.setattr(ending, "AGAIN", 0.01)
    closed = []

    def run():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            with suppress(ZeroDivisionError):
                raising(ZeroDivisionError())
            time.sleep(0.1)
            closed.append(True)

    assert ended(run) == 143
    assert closed


@pytest.mark.parametrize(
    "error", [MachineError("killed"), MemoryError("7 TiB"), OSError(errno.ENOSPC, "No space")]
)
def test_what_the_machine_does_is_one_line_and_status_1(capsys, error):
    assert ended(lambda: raising(error)) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert str(error.args[-1]) in line


def test_cells_are_counted_and_those_with_errors_tried_again(run, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        broken = replace(replay.METHOD, check=lambda *_: raising(ZeroDivisionError()))
        patch.setattr(replay, "METHOD", broken)
        assert run() == 1
        assert "2 error, 4 ok" in capsys.readouterr().out
    for missing in ("車: 2 of 6 to compute", ""):
        assert run() == 0
        printed = capsys.readouterr()
        assert printed.err.partition("\n")[0] == missing
        assert "8 grid points, 6 cells: 6 ok (2 not to" in " ".join(printed.out.split())


def test_a_terminal_that_cannot_show_a_name_ends_no_study(run, monkeypatch):
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    assert run() == 0
    sys.stdout.flush()
    assert shown.getvalue().startswith(rb"\u8eca: 8 grid points, 6 cells: 6 ok")
