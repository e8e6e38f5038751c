"""Studies that are killed, resumed, run in processes or on a cluster, or broken by the machine."""

import errno
import logging
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, Future
from contextlib import nullcontext
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace

import netCDF4
import numpy as np
import pytest
import xarray as xr
from threadpoolctl import threadpool_info, threadpool_limits

import vehiclemor as vm
from tests.study.small import assert_same, small_study
from vehiclemor.cli import main
from vehiclemor.exceptions import ConvergenceError, InputError, MachineError, UnreachableError
from vehiclemor.failure import Failure
from vehiclemor.files import TEMPORARY, temporary_path
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.progress import listening
from vehiclemor.reduction.methods import pod
from vehiclemor.report.results import counted_ends
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.study import evaluate, store, timing, workers
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.run import run_studies
from vehiclemor.study.workers import KILLED, TRIES, Done

GRID = """
training = "nominal"
grid = { frequency_factor = [0.8, 1.0, 1.2, 1.4], amplitude_factor = [0.9, 1.1, 3.0], rank = [2, 3]}
"""
RUNS = 12 * (1 + 1 + 2)
SMALL = 'keep = "metrics"\ngrid = { rank = [2, 3] }\n'


@pytest.fixture(autouse=True)
def _nothing_kept():
    evaluate._FITS.clear()
    yield
    evaluate._FITS.clear()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return small_study(tmp_path_factory.mktemp("study"), GRID, "full_order", "replay", "pod")


@pytest.fixture(scope="module")
def alone(study, tmp_path_factory):
    """What one process gives."""
    return run_studies(str(study), tmp_path_factory.mktemp("one"))["small"]


def stored(folder):
    return {path: path.stat().st_mtime_ns for path in (folder / "cells").glob("??/*")}


# Processes


def test_two_processes_give_the_same_dataset_and_store_it(study, alone, tmp_path):
    written = run_studies(str(study), tmp_path, jobs=2)["small"]
    assert_same(alone, written)
    with xr.open_dataset(tmp_path / "studies" / "small.nc") as read:
        xr.testing.assert_identical(written, read.load())
    assert len(stored(tmp_path)) == RUNS


def test_a_killed_study_resumes_to_the_same_dataset(study, alone, tmp_path):
    command = [sys.executable, "-m", "vehiclemor", "run", str(study), "--jobs", "2"]
    process = subprocess.Popen([*command, "--results", str(tmp_path)], stdout=subprocess.PIPE)
    deadline = time.monotonic() + 120
    while len(stored(tmp_path)) < 6:
        assert process.poll() is None, "the study ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    # Workers hold this end of the pipe for as long as they live, which was 330 s.
    process.communicate(timeout=60)
    finished, cells = stored(tmp_path), tmp_path / "cells"
    for path in (half := temporary_path(cells / "left"), *cells.glob(f"{TEMPORARY}*")):
        path.write_bytes(b"half a file")
        os.utime(path, (0, 0))
    resumed = run_studies(str(study), tmp_path)["small"]
    assert 6 <= len(finished) < RUNS
    assert finished.items() <= stored(tmp_path).items(), "a finished run was computed again"
    assert not half.exists()
    assert_same(alone, resumed)


def test_two_drivers_at_once_give_the_same_dataset(study, alone, tmp_path):
    command = [sys.executable, "-m", "vehiclemor", "run", str(study), "--results", str(tmp_path)]
    drivers = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [driver.wait(timeout=240) for driver in drivers] == [0, 0]
    assert not list(tmp_path.rglob(f"{TEMPORARY}*"))
    assert_same(alone, run_studies(str(study), tmp_path)["small"])


def test_workers_end_with_a_run_and_one_that_is_killed_is_replaced(study, tmp_path, caplog):
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
        run_studies(str(study), tmp_path, jobs=2)
    assert len(processes) == 2
    assert not any(process.is_alive() for process in processes)
    # Batches may have finished nearly all of it by then.
    again = tmp_path / "again"
    with listening(kill):
        run_studies(str(study), again, jobs=2)
    assert [KILLED in message for message in caplog.messages] == [True]
    assert len(stored(again)) == RUNS
    command = [sys.executable, "-c", "from vehiclemor.study.workers import begin; begin(0, '')"]
    command[-1] += "; import time; time.sleep(60)"
    assert subprocess.run(command, timeout=50, check=False).returncode == 1


def test_the_number_of_threads_changes_no_bit():
    outputs = []
    for number in (1, 2):
        with threadpool_limits(number, user_api="blas"):
            data = vm.simulate("independent_suspension_vehicle", "slow_manifold")
            with one_thread():
                blas = [found for found in threadpool_info() if found["user_api"] == "blas"]
                assert {found["num_threads"] for found in blas} == {1}
        outputs.append(data["outputs"].values)
    np.testing.assert_array_equal(*outputs)


# Datasets


def test_unreachable_runs_are_results_and_everything_is_labelled(alone):
    far = alone.sel(amplitude_factor=3.0)
    assert (far["status"] == "unreachable").all()
    assert all(message for message in far["message"].values.ravel())
    assert np.isnan(far["rms_error"]).all()
    reached = alone.sel(amplitude_factor=[0.9, 1.1])
    assert (reached["status"] == "ok").all()
    assert np.isfinite(reached["rms_error"]).all()
    for name, variable in alone.variables.items():
        assert variable.attrs.get("long_name"), name
    # Outputs differ in their units: each has its own beside it.
    assert set(alone["rms_error"]["output_unit"].values) == {"m", "rad"}
    assert "units" not in alone["rms_error"].attrs
    assert {"source", "versions", "machine", "kernel_hash"} <= set(alone.attrs)


def test_a_dataset_laid_out_by_other_source_is_combined_again(study, alone, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vehiclemor.study.plans.results.layout_digest", lambda: "older")
        older = run_studies(str(study), tmp_path)["small"]
    write_dataset(older.drop_vars("rms_error"), tmp_path / "studies" / "small.nc")
    assert_same(alone, run_studies(str(study), tmp_path)["small"])


def test_a_study_is_followed_from_nothing_to_its_end(study, tmp_path, capsys, protocol_text):
    out = tmp_path / "out"
    found = vm.status(study, out)["small"]
    assert (found.runs, found.done, found.to_do, found.result) == (RUNS, 0, RUNS, None)
    assert not out.exists()
    ends, *_ = counted_ends(run_studies(str(study), out)["small"]).split(";")
    assert main(["status", str(study), "--results", str(out)]) == 0
    assert " untrusted)" in ends
    assert ends in capsys.readouterr().out
    found = vm.status(study, out)["small"]
    assert (found.runs, found.done, found.to_do) == (RUNS, RUNS, 0)
    # Messages differ in the height and time out of reach: which is shown depends on the runs left.
    ((kind, _), runs), *others = found.failed.items()
    assert (kind, runs, others) == ("unreachable", RUNS // 3, [])
    assert found.ends["ok", ""] == 2 * RUNS // 3
    assert found.result == out / "studies" / "small.nc"
    missing, corrupt = list(stored(out))[:2]
    missing.unlink()
    corrupt.write_bytes(b"")
    assert main(["status", str(study), "--results", str(out)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"{RUNS - 2} of {RUNS} runs done, 2 to do" in printed
    ((_, message), _) = vm.status(study, out)["small"].failed.most_common(1)[0]
    assert "is out of reach" in message
    assert message in printed
    assert main(["status", str(study), "--results", str(study)]) == 2
    (tmp_path / "protocol.toml").write_text(protocol_text)
    found = vm.status(tmp_path / "protocol.toml", out)["protocol"]
    assert (found.runs, found.done, bool(found.later)) == (6, 0, True)


# Results, bugs and the machine


@pytest.fixture
def run(tmp_path):
    """Run a small study in one folder; gives the statuses of a method by rank."""
    path = small_study(tmp_path, SMALL, "pod", "fixed_basis")

    def statuses(method: str, **options) -> list[str]:
        found = run_studies(str(path), tmp_path / "out", **options)["small"].squeeze()
        return list(found["status"].sel(label=method).values)

    return statuses


def breaking(patch, error, part="fit"):
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


@pytest.mark.parametrize("part", ["fit", "check", "errors"])
def test_a_bug_ends_no_study_and_is_tried_again_by_the_next_run(run, monkeypatch, tmp_path, part):
    with monkeypatch.context() as patch:
        breaking(patch, ZeroDivisionError("in a plug-in"), part)
        assert run("fixed_basis") == ["error", "error"]
        assert run("pod") == ["ok", "ok"]
        if part == "errors":
            found = vm.status(tmp_path / "small.toml", tmp_path / "out")["small"]
            assert (found.done, found.to_do, sum(found.failed.values())) == (2, 2, 2)
    # In the same process: no failed fit is kept.
    assert run("fixed_basis") == ["ok", "ok"]
    # A fit from another file is other source.
    assert len(stored(tmp_path / "out")) == 4 + 2 * (part == "fit")


@pytest.mark.parametrize(
    ("error", "part"),
    [
        (MemoryError("Unable to allocate 7 TiB"), "fit"),
        (MemoryError("Unable to allocate 7 TiB"), "errors"),
        (OSError(errno.EMFILE, "Too many open files"), "fit"),
    ],
    ids=["memory", "our memory", "files"],
)
def test_what_the_machine_does_is_no_result(run, monkeypatch, tmp_path, caplog, error, part):
    with monkeypatch.context() as patch:
        breaking(patch, error, part)
        with pytest.raises(MachineError, match=str(error.args[-1])):
            run("pod")
    # Each further try names the reason once; the rest of the study is finished.
    assert [str(error.args[-1]) in message for message in caplog.messages] == [True] * (TRIES - 1)
    assert len(stored(tmp_path / "out")) == 2
    assert run("fixed_basis") == ["ok", "ok"]


def test_a_full_disk_is_called_so_whatever_the_library_says(run, monkeypatch, tmp_path):
    reason = os.strerror(errno.ENOSPC)

    def full(*_):
        raise OSError(errno.ENOSPC, reason)

    def dataset(error):
        def broken(*_):
            raise error

        return broken

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(MachineError, match=reason):
            run("pod")
        assert not stored(tmp_path / "out")
    with monkeypatch.context() as patch:
        # The combined dataset: plain writing tells what netCDF hides.
        denied = PermissionError(errno.EACCES, "Permission denied")
        patch.setattr(netCDF4, "Dataset", dataset(denied))
        fill = {".nc": full, store.ENDING: Path.write_bytes}
        patch.setattr(Path, "write_bytes", lambda path, what: fill[path.suffix](path, what))
        with pytest.raises(MachineError, match=rf"small\.nc: .*{reason}"):
            run("pod")
    assert run("pod") == ["ok", "ok"]


def test_workers_that_are_killed_again_and_again_end_the_run(run, monkeypatch):
    tries = []

    def killed(groups, *_):
        tries.append(len(groups))
        yield Done([], KILLED)

    monkeypatch.setattr(workers, "in_processes", killed)
    with pytest.raises(MachineError):
        run("pod", jobs=2)
    assert tries == [4] * TRIES


# A cluster

distributed = pytest.importorskip("distributed")
CLUSTER = {
    "n_workers": 2,
    "threads_per_worker": 1,
    "protocol": "tcp://",
    "dashboard_address": "127.0.0.1:0",
    "silence_logs": logging.CRITICAL,
}


@pytest.fixture(scope="module")
def address():
    """Two workers, in threads of this process: new ones take seconds to start."""
    with distributed.LocalCluster(processes=False, **CLUSTER) as two:
        yield two.scheduler_address


def test_a_killed_worker_of_a_cluster_loses_no_run_and_doubles_none(study, alone, tmp_path):
    before, killed = {}, []

    def kill(_, done, __):
        if done >= 4 and not killed:
            killed.append(next(p for p in active_children() if "Dask" in p.name))
            os.kill(killed[0].pid, signal.SIGKILL)
            before.update(stored(tmp_path))

    with distributed.LocalCluster(processes=True, **CLUSTER) as two, listening(kill):
        found = run_studies(str(study), tmp_path, scheduler=two.scheduler_address)["small"]
    assert_same(alone, found)
    assert 4 <= len(before) < RUNS
    assert before.items() <= stored(tmp_path).items(), "a finished run was computed again"
    assert len(stored(tmp_path)) == RUNS
    assert not killed[0].is_alive()


def test_no_scheduler_is_one_line(study, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "REACH", 0.2)
    for address in ("nonsense", "tls://127.0.0.1:9", "127.0.0.1:1"):
        with pytest.raises(InputError, match=f"^scheduler {address}: "):
            run_studies(str(study), tmp_path, scheduler=address)
    with pytest.raises(InputError, match="jobs"):
        run_studies(str(study), tmp_path, jobs=2, scheduler="127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"vehiclemor\[cluster\]"):
        run_studies(str(study), tmp_path, scheduler="127.0.0.1:1")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("change", [{"code": "other"}, {"kernel": "other"}], ids=str)
def test_a_worker_with_other_source_is_one_line(study, address, change):
    (definition,) = load_studies(str(study)).values()
    experiment = next(iter(expand("small", definition).experiments.values()))
    with workers.cluster(address) as elsewhere, pytest.raises(InputError, match="worker tcp://"):
        list(elsewhere([[replace(experiment, **change)]], False))


@pytest.mark.parametrize(
    ("error", "ends"),
    [
        (CancelledError(), pytest.raises(MachineError)),
        (ModuleNotFoundError("No module named 'mine'"), pytest.raises(InputError, match="'mine'")),
        (distributed.KilledWorker("batch", None, 3), nullcontext()),
    ],
    ids=["scheduler", "source", "killed"],
)
def test_what_ends_a_batch_is_one_line_or_tried_again(error, ends):
    future: Future[Done] = Future()
    future.set_exception(error)
    pool = SimpleNamespace(submit=lambda *_: future, shutdown=lambda **_: None)
    client = SimpleNamespace(get_executor=lambda **_: pool, nthreads=dict)
    with ends:
        (done,) = workers.on_cluster([[]], client=client)
        assert done == Done([], KILLED)


def test_a_scheduler_without_workers_is_told(monkeypatch, caplog):
    monkeypatch.setattr(workers, "IDLE", 0.01)
    future: Future[Done] = Future()
    looks = []

    def nthreads():
        """Workers, which come at the third look and end the run."""
        looks.append(len(looks))
        if len(looks) < 3:
            return {}
        future.set_result(Done([]))
        return {"tcp://": 1}

    pool = SimpleNamespace(submit=lambda *_: future, shutdown=lambda **_: None)
    client = SimpleNamespace(get_executor=lambda **_: pool, nthreads=nthreads)
    assert list(workers.on_cluster([[]], client=client)) == [Done([])]
    assert ["no worker" in message for message in caplog.messages] == [True]
