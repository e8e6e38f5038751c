"""Workers of a cluster give what one process gives, whatever is killed or can't be seen."""

import logging
import os
import runpy
import signal
import sys
from concurrent.futures import CancelledError, Future
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import chain
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from tests.study.small import assert_same, small_study
from tests.texts.markdown import blocks
from vehiclemor.errors import InputError, MachineError
from vehiclemor.progress import listening
from vehiclemor.study import cluster as engine
from vehiclemor.study import workers
from vehiclemor.study.cell_file import ENDING
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.run import run_studies
from vehiclemor.study.workers import KILLED, LARGEST, WAITING, Done, evaluate_and_store, in_batches

distributed = pytest.importorskip("distributed")

STUDY = """
training = "nominal"
keep = "metrics"
grid = { frequency_factor = [0.9, 1.0, 1.1], amplitude_factor = [1.0, 3.0], rank = [2, 3] }
"""
CELLS = 6 + 12
CLUSTER = {
    "n_workers": 2,
    "threads_per_worker": 1,
    "protocol": "tcp://",
    "dashboard_address": "127.0.0.1:0",
    "silence_logs": logging.CRITICAL,
}


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return small_study(tmp_path_factory.mktemp("study"), STUDY, "full_order", "pod")


@pytest.fixture(scope="module")
def alone(study, tmp_path_factory) -> xr.Dataset:
    """What one process gives."""
    return run_studies(str(study), tmp_path_factory.mktemp("one"))["small"]


@pytest.fixture(scope="module")
def address():
    """Two workers, in threads of this process: new ones take seconds to start."""
    with distributed.LocalCluster(processes=False, **CLUSTER) as two:
        yield two.scheduler_address


def run(study: Path, folder: Path, address: str) -> xr.Dataset:
    return run_studies(str(study), folder, scheduler=address)["small"]


def cells_in(folder: Path) -> dict[Path, int]:
    files = (folder / "cells").rglob(f"[!.]*{ENDING}")
    return {path: path.stat().st_mtime_ns for path in files}


def test_a_killed_worker_loses_no_cell_and_doubles_none(study, alone, tmp_path, caplog):
    stored, killed = {}, []

    def kill(_, done, __):
        if done >= 4 and not killed:
            killed.append(next(p for p in active_children() if "Dask" in p.name))
            os.kill(killed[0].pid, signal.SIGKILL)
            stored.update(cells_in(tmp_path))

    caplog.set_level(logging.INFO, "vehiclemor")
    with distributed.LocalCluster(processes=True, **CLUSTER) as two, listening(kill):
        found = run(study, tmp_path, two.scheduler_address)
    assert_same(alone, found)
    assert 4 <= len(stored) < CELLS
    after = cells_in(tmp_path)
    assert {path: after[path] for path in stored} == stored, "a finished cell was computed again"
    assert len(after) == CELLS
    assert not killed[0].is_alive()
    assert "dashboard http://127.0.0.1:" in caplog.text


def test_what_a_killed_worker_had_stored_is_not_computed_again(study, tmp_path):
    (definition,) = load_studies(str(study)).values()
    batch = list(expand("small", definition).unique.values())[:2]
    (tmp_path / "cells").mkdir()
    evaluate_and_store(batch[:1], tmp_path)
    before = cells_in(tmp_path)
    assert evaluate_and_store(batch, tmp_path).finished == [e.key for e in batch]
    after = cells_in(tmp_path)
    assert len(after) == 2
    assert before.items() <= after.items()


def test_workers_that_see_another_folder_send_their_results(
    study, alone, address, tmp_path, monkeypatch
):
    written, store = [], workers.write_encoded

    def write_encoded(content, folder, key):
        written.append(key)
        store(content, folder, key)

    monkeypatch.setattr(workers, "write_encoded", write_encoded)
    # As if a folder of that name were another one on the worker's machine.
    monkeypatch.setattr(engine, "_seen", lambda _: False)
    assert_same(alone, run(study, tmp_path, address))
    assert len(written) == len(set(written)) == len(cells_in(tmp_path)) == CELLS


# Batches


class Pool:
    """Works a batch at once, in so many seconds a cell."""

    def __init__(self, pace: float) -> None:
        self.pace, self.sent = pace, []

    def submit(self, _, batch):
        self.sent.append(batch)
        future: Future[Done] = Future()
        future.set_result(Done(batch, "", self.pace * len(batch)))
        return future


def batched(groups, places, pace, most):
    """Batches that are sent, in their order, where a cell takes `pace` seconds."""
    found = list(in_batches(pool := Pool(pace), None, groups, lambda: places, most))
    assert sorted(done.finished for done in found) == sorted(pool.sent)
    return pool.sent


def test_quick_cells_go_in_large_batches():
    assert len(batched([[i] for i in range(10_000)], 2, 1e-3, LARGEST)) < 150


@given(number=st.integers(0, 300), places=st.integers(0, 5), pace=st.sampled_from([0.0, 0.05]))
def test_batches_hold_each_group_once_and_whole(number, places, pace):
    groups = [[(group, part) for part in range(1 + group**2 % 4)] for group in range(number)]
    sent = batched(groups, places, pace, 10)
    assert list(chain(*sent)) == list(chain(*groups))
    assert all(len(batch) <= 10 for batch in sent)
    # As many as there are places end together.
    assert all(len(batch) <= 4 for batch in sent[-WAITING * places :] if places)


# What can't be


def test_no_scheduler_is_one_line(study, tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "REACH", 0.2)
    for address in ("nonsense", "tls://127.0.0.1:9", "127.0.0.1:1"):
        with pytest.raises(InputError, match=f"^scheduler {address}: ") as error:
            run(study, tmp_path, address)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="jobs"):
        run_studies(str(study), tmp_path, jobs=2, scheduler="127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"vehiclemor\[cluster\]"):
        run(study, tmp_path, "127.0.0.1:1")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("change", [{"code": "other"}, {"kernel": "other"}], ids=str)
def test_a_worker_with_other_source_is_one_line(study, address, tmp_path, change):
    (definition,) = load_studies(str(study)).values()
    cell = next(iter(expand("small", definition).unique.values()))
    with engine.reached(address) as elsewhere:
        (tmp_path / "cells").mkdir()
        with pytest.raises(InputError, match=r"worker tcp://.* has other source"):
            list(elsewhere([[replace(cell, **change)]], tmp_path, False))
    assert not cells_in(tmp_path)


@pytest.mark.parametrize(
    ("error", "ends"),
    [
        (CancelledError(), pytest.raises(MachineError, match="run again to resume")),
        (ModuleNotFoundError("No module named 'mine'"), pytest.raises(InputError, match="'mine'")),
        (distributed.KilledWorker("batch", None, 3), nullcontext()),
    ],
    ids=["scheduler", "source", "killed"],
)
def test_what_ends_a_batch_is_one_line_or_tried_again(tmp_path, error, ends):
    future: Future[Done] = Future()
    future.set_exception(error)
    pool = SimpleNamespace(submit=lambda *_: future, shutdown=lambda **_: None)
    client = SimpleNamespace(get_executor=lambda **_: pool, nthreads=dict)
    (tmp_path / "cells").mkdir()
    with ends:
        (done,) = engine.evaluated_by_cluster([[]], tmp_path, client=client)
        assert done == Done([], KILLED)
    assert not list((tmp_path / "cells").iterdir())


def test_the_code_of_the_handbook_runs(study, address, tmp_path, monkeypatch, capsys):
    page = Path(__file__).parents[2] / "paper" / "handbook" / "on-a-cluster.md"
    code, slurm = [block.content for block in blocks(page) if block.language == "python"]
    compile(slurm, page.name, "exec")
    (tmp_path / "page.py").write_text(code)
    (tmp_path / "my_study.toml").write_text(study.read_text())
    monkeypatch.chdir(tmp_path)
    two = partial(nullcontext, SimpleNamespace(scheduler_address=address))
    monkeypatch.setattr(distributed, "LocalCluster", lambda **_: two())
    runpy.run_path("page.py", run_name="__main__")
    assert "ok" in capsys.readouterr().out
