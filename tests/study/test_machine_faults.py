"""What the equations, a bug or the machine do to a study: a result, tried again, or named."""

import errno
import os
import signal
import subprocess
import sys
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import netCDF4
import pytest

from tests.study.small import small_study
from vehiclemor.errors import (
    ConvergenceError,
    FileError,
    InputError,
    MachineError,
    UnreachableError,
)
from vehiclemor.failure import Failure, attempt
from vehiclemor.progress import listening
from vehiclemor.reduction.methods import pod
from vehiclemor.study import cell_file, evaluate, timing, workers
from vehiclemor.study.run import run_studies

GRID = 'keep = "metrics"\ngrid = { rank = [2, 3] }\n'
BOTH = "pod", "fixed_basis"
FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture(autouse=True)
def _nothing_kept():
    evaluate._KEPT.clear()
    yield
    evaluate._KEPT.clear()


@pytest.fixture
def run(tmp_path):
    """Run the small study in one folder; gives the statuses of a method by rank."""
    path = small_study(tmp_path, GRID, *BOTH)

    def statuses(method: str, **options) -> list[str]:
        cells = run_studies(str(path), tmp_path / "out", **options)["small"].squeeze()
        return list(cells["status"].sel(label=method).values)

    return statuses


def cells_in(folder: Path) -> list[Path]:
    return sorted((folder / "out" / "cells").glob("[!.]?/*"))


def breaking(patch: pytest.MonkeyPatch, error: BaseException, part: str = "fit") -> None:
    """Let a part of the method `fixed_basis`, or what measures its runs, raise."""
    measured = evaluate.result_dataset

    def broken(*given):
        if part == "errors" and (given[1].method == "pod" or isinstance(given[3], Failure)):
            return measured(*given)
        raise error

    if part == "errors":
        patch.setattr(evaluate, "result_dataset", broken)
    else:
        patch.setattr(pod, "FIXED_BASIS", replace(pod.FIXED_BASIS, **{part: broken}))


# Results


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (InputError("asks for too much"), "rejected", "asks for too much"),
        (UnreachableError("too high"), "unreachable", "too high"),
        (ConvergenceError("after 9\niterations"), "diverged", "after 9 iterations"),
        (ZeroDivisionError("in a plug-in"), "error", f"in a plug-in ({__file__}:"),
        (SystemExit(0), "error", f"SystemExit: 0 ({__file__}:"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_a_fit_raises_is_a_result_of_grids_and_protocols(
    tmp_path, monkeypatch, protocol_text, error, status, message
):
    breaking(monkeypatch, error)
    monkeypatch.setattr(timing, "PROTOCOL_ROUNDS", 1)
    grid, protocol = small_study(tmp_path, "", "full_order", "fixed_basis"), tmp_path / "test.toml"
    protocol.write_text(protocol_text)
    for path, broken, full in (
        (grid, "fixed_basis", "full_order"),
        (protocol, "fixed basis", "newton 1e-12"),
    ):
        (rows,) = run_studies(str(path), tmp_path).values()
        assert set(rows["status"].sel(label=broken).values.ravel()) == {status}
        assert all(message in m for m in rows["message"].sel(label=broken).values.ravel())
        assert set(rows["status"].sel(label=full).values.ravel()) == {"ok"}


def test_what_is_wrong_with_a_file_ends_the_study():
    def broken():
        raise FileError("no such file")

    with pytest.raises(FileError):
        attempt(broken)


@pytest.mark.parametrize("part", ["fit", "check", "errors"])
def test_a_bug_ends_no_study_and_is_tried_again_by_the_next_run(run, monkeypatch, tmp_path, part):
    with monkeypatch.context() as patch:
        breaking(patch, ZeroDivisionError("in a plug-in"), part)
        assert run("fixed_basis") == ["error", "error"]
        assert run("pod") == ["ok", "ok"]
    # In the same process: no failed fit is kept.
    assert run("fixed_basis") == ["ok", "ok"]
    # A fit from another file is other source.
    assert len(cells_in(tmp_path)) == 4 + 2 * (part == "fit")


# The machine


@pytest.mark.parametrize(
    ("error", "reason", "part"),
    [
        (MemoryError("Unable to allocate 7 TiB"), "not enough memory Unable", "fit"),
        (MemoryError("Unable to allocate 7 TiB"), "not enough memory Unable", "errors"),
        (OSError(errno.EMFILE, "Too many open files"), "Too many open files", "fit"),
    ],
    ids=["memory", "our memory", "files"],
)
def test_what_the_machine_does_is_no_result(
    run, monkeypatch, tmp_path, caplog, error, reason, part
):
    with monkeypatch.context() as patch:
        breaking(patch, error, part)
        with pytest.raises(MachineError, match="2 of 4") as told:
            run("pod")
    assert reason in str(told.value)
    assert part == "errors" or f" ({__file__}:" in str(told.value)
    # Each further try names the reason once; the rest of the study is finished.
    assert [reason in message for message in caplog.messages] == [True] * (workers.TRIES - 1)
    assert len(cells_in(tmp_path)) == 2
    assert run("fixed_basis") == ["ok", "ok"]


def test_a_full_disk_is_called_so_whatever_the_library_says(run, monkeypatch, tmp_path):
    def full(path, *_):
        raise FULL

    def dataset(error):
        def broken(*_):
            raise error

        return broken

    reason = "No space left on device"
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(MachineError, match=reason):
            run("pod")
        assert cells_in(tmp_path) == []
    with monkeypatch.context() as patch:
        # The combined dataset: plain writing tells what netCDF hides.
        denied = PermissionError(errno.EACCES, "Permission denied")
        patch.setattr(netCDF4, "Dataset", dataset(denied))
        fill = {".nc": full, cell_file.ENDING: Path.write_bytes}
        patch.setattr(Path, "write_bytes", lambda path, what: fill[path.suffix](path, what))
        with pytest.raises(MachineError, match=rf"small\.nc: .*{reason}"):
            run("pod")
    with monkeypatch.context() as patch:
        # What is no fault of the disk is named as it is.
        patch.setattr(netCDF4, "Dataset", dataset(RuntimeError("NetCDF: HDF error")))
        with pytest.raises(FileError, match="NetCDF: HDF error"):
            run("pod")
    assert len(cells_in(tmp_path)) == 4
    assert run("pod") == ["ok", "ok"]


def test_complete_results_are_read_where_nothing_can_be_written(run, monkeypatch):
    run("pod")

    def read_only(*_):
        raise OSError(errno.EROFS, "Read-only file system")

    for name in ("replace", "mkdir"):
        monkeypatch.setattr(os, name, read_only)
    monkeypatch.setattr("tempfile.TemporaryFile", read_only)
    assert run("pod") == ["ok", "ok"]


def test_a_label_that_was_edited_is_in_the_results(run, tmp_path):
    run("pod")
    path = tmp_path / "small.toml"
    path.write_text(path.read_text().replace('method = "pod"', 'method = "pod"\nlabel = "mine"'))
    assert run("mine") == ["ok", "ok"]


# Workers


def test_workers_that_are_killed_again_and_again_end_the_run(run, monkeypatch):
    tries = []

    def killed(groups, *_):
        tries.append(len(groups))
        yield workers.Done([], workers.KILLED)

    monkeypatch.setattr(workers, "evaluated_by_workers", killed)
    with pytest.raises(MachineError, match="killed"):
        run("pod", jobs=2)
    assert tries == [4] * workers.TRIES


def test_a_worker_without_its_driver_ends():
    text = "import sys, time; from vehiclemor.study.workers import begin; begin(0, ''); "
    command = [sys.executable, "-c", text + "time.sleep(60)"]
    assert subprocess.run(command, timeout=50, check=False).returncode == 1


def test_workers_end_with_a_run_and_one_that_is_killed_is_replaced(tmp_path, caplog):
    eight = GRID.replace("[2, 3]", "[1, 2, 3, 4, 5, 6, 7, 8]")
    path = small_study(tmp_path, eight, *BOTH, "full_order", name="eight")
    processes, killed = [], []

    def stop(_, done, __):
        if done >= 5:
            processes.extend(active_children())
            raise KeyboardInterrupt

    def kill(_, done, __):
        if done and not killed:
            killed.append(active_children()[0].pid)
            os.kill(*killed, signal.SIGKILL)

    with pytest.raises(KeyboardInterrupt), listening(stop):
        run_studies(str(path), tmp_path, jobs=2)
    assert len(processes) == 2
    assert not any(process.is_alive() for process in processes)
    # Batches may have finished nearly all of it by then.
    again = tmp_path / "again"
    with listening(kill):
        cells = run_studies(str(path), again, jobs=2)["eight"]
    assert caplog.messages == [f"eight: {workers.KILLED}; what it has spoiled is tried again"]
    assert set(cells["status"].values.ravel()) == {"ok"}
    assert len(list((again / "cells").glob("??/*"))) == 17
