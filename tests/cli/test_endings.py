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
grid = { rank = [2, 3], frequency_factor = [1.0, 1.1] }
methods = [{ method = "pod" }, { method = "replay" }]
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_with_a_hint(study, tmp_path, monkeypatch, capsys, number):
    monkeypatch.setattr(
        study_run, "studies_and_files", lambda _: os.kill(os.getpid(), number) or {}
    )
    before = signal.getsignal(number)
    assert main(["run", str(study), "--out", str(tmp_path)]) == 128 + number
    printed = capsys.readouterr().err
    assert printed == (
        "vehiclemor: stopped; finished cells of a study are stored, run again to resume\n"
    )
    assert signal.getsignal(number) is before


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no such timer")
def test_a_signal_that_a_library_drops_is_raised_again(capsys):
    def run():
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        signal.pause()

    assert ended(run) == 143
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no such timer")
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


def raising(error):
    raise error


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (MachineError("a worker was killed"), "a worker was killed"),
        (MemoryError("7 TiB"), "not enough memory 7 TiB"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
    ],
    ids=["machine", "memory", "space"],
)
def test_what_the_machine_does_is_one_line_and_status_1(capsys, error, line):
    def run():
        raise error

    assert ended(run) == 1
    assert capsys.readouterr().err == f"vehiclemor: {line}\n"


def test_counts_of_cells_agree(study, tmp_path, capsys):
    for missing in ("small: 6 of 6 to compute", ""):
        assert main(["run", str(study), "--out", str(tmp_path / "out")]) == 0
        printed = capsys.readouterr()
        # Where it takes long further lines tell how far it is.
        assert printed.err.partition("\n")[0] == missing
        assert printed.out.startswith("small: 8 grid points, 6 cells: 6 ok;")


def test_runs_that_are_not_trusted_are_counted_apart(tmp_path, capsys):
    path = tmp_path / "other.toml"
    path.write_text(
        """
title = "other inputs than those of the training"
model = "double_wishbone"
training = "nominal"
keep = "metrics"
methods = [{ method = "pod" }, { method = "full_order" }]
grid = { amplitude_factor = [1.0, 1.3] }
"""
    )
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "4 grid points, 4 cells: 4 ok (1 not to be trusted);" in " ".join(
        capsys.readouterr().out.split()
    )


def test_cells_with_errors_are_tried_again_and_said_in_the_exit_status(
    study, tmp_path, monkeypatch, capsys
):
    def broken(*_):
        raise ZeroDivisionError("in a plug-in")

    arguments = ["run", str(study), "--out", str(tmp_path / "out")]
    with monkeypatch.context() as patch:
        patch.setattr(replay, "METHOD", replace(replay.METHOD, check=broken))
        assert main(arguments) == 1
        assert "2 error, 4 ok" in capsys.readouterr().out
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("small: 2 of 6 to compute\n")
    assert "6 ok" in printed.out


def test_names_that_are_too_long_are_one_line(fails, study, tmp_path):
    long = tmp_path / ("n" * 300)
    fails(["simulate", "double_wishbone", "--out", f"{long}.nc"], "too long")
    fails(["run", study, "--out", long], "too long")
    fails(["run", f"{long}.toml"], "too long")


def test_a_terminal_that_cannot_show_a_name_ends_no_study(study, tmp_path, monkeypatch):
    path = study.rename(tmp_path / "車.toml")
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    sys.stdout.flush()
    assert shown.getvalue().startswith(rb"\u8eca: 8 grid points, 6 cells: 6 ok")
