"""Many runs of one model: in threads, as one dataset, in memory or written while they are made."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import MOST_JOBS, count, file_path
from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_arguments import (
    count_of,
    kept_times,
    model_behind,
    parameter_sets,
    starts_of,
)
from vehiclemor.online.batch_files import checked_target, opened, written
from vehiclemor.online.batch_result import Found, Selection, dataset, selected
from vehiclemor.online.batch_runners import Runner, SingleRuns, runner_of
from vehiclemor.online.batch_signals import Signals
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start
from vehiclemor.study.linear_algebra import one_thread
from vehiclemor.study.provenance import attributes

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

# Runs that a thread does at once: their arrays stay in its cache.
CHUNK = 64
# Bytes of a result that is kept in memory; a larger one is to be chosen from, or written.
LARGEST = 4 << 30
# Parameter sets whose models are kept.
MOST_SETS = 32
NO_COLUMNS = np.zeros(0, dtype=np.int64)


def simulate_many(
    model: str | Model | ReducedOrderModel,
    signals: Signals | Sequence[Maneuver],
    starts: Start | Sequence[Start] | None = None,
    parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    *,
    outputs: str | Sequence[str] | None = None,
    times: Any = None,
    jobs: int | None = None,
    path: str | Path | None = None,
) -> xr.Dataset:
    """Many runs in threads, each the same to the bit as if it were done alone.

    Parameters
    ----------
    model
        Reduced or full model made by `reduce()`; or a full model, or its name, which is integrated
        as `Model.simulate` does by default, to be measured against: `reduce(model, "full_order",
        solver="ros34pw2", tolerance=2e-3)` is far faster.
    signals
        One for each run: `Signals`, or a list of signals or maneuvers.  They have the same output
        times, unless `times` are given.
    starts
        Initial condition of the full model by name, or as a state (n,), for all runs; or a list of
        these, or states (runs, n).
    parameters
        In SI units: name -> value for all runs, or values by run; or one mapping for each run.  Of
        a model whose method gives other cars than its own, see `ReducedOrderModel.for_parameters`.
    outputs
        Names of outputs, coordinates or speeds to be kept.  By default none: all outputs are there,
        but made where they are read, by doing the runs of which they are once more.
    times
        Times in s at which they are kept; the output times of the signals by default.  A run is
        watched at its own output times whatever is kept.  Models whose runs are done one by one
        give only some of these.
    jobs
        Number of threads; by default as many as there are cores.
    path
        New file (`.nc`) or folder (`.zarr`) to which the runs are written chunk by chunk, so that
        memory stays bounded; it is there once all are done.

    Returns
    -------
    xarray.Dataset
        `values` (run, time, output) and, by run, `status`, `message`, `remark`, `indicator` and
        `until` (what a reduced model tells of itself), `seconds` and solver counts; read lazily
        where it was written.  A run that has failed, or that the model refuses, tells so in its
        status, and is not a number from there on.

    Raises
    ------
    InputError
        If an argument is wrong, or the result does not fit into memory.
    """
    reduced = model_behind(model)
    runs = count_of(signals, reduced.model)
    chosen = selected(reduced.model, outputs, times)
    kept = kept_times(chosen, signals)
    begins = starts_of(starts, runs, reduced.model)
    sets = parameter_sets(parameters, runs, reduced)
    threads = _cores() if jobs is None else count("jobs", jobs, most=MOST_JOBS)
    about = _attributes(reduced, runs)
    work = _Work(reduced, chosen, signals, begins, sets)

    def labelled(found: Found, first: int) -> xr.Dataset:
        return dataset(reduced.model, chosen, kept, found, first).assign_attrs(about)

    if path is None:
        whole = _unread(work, kept, threads) if outputs is None else _whole(work, kept, threads)
        return labelled(whole, 0)
    target = checked_target(file_path("path", path))
    written(target, (labelled(found, first) for first, found in _chunks(work, runs, threads)))
    return opened(target)


def _unread(work: _Work, kept: np.ndarray, threads: int) -> Found:
    """What is told of all runs, and values that are made where they are read."""
    from vehiclemor.online.later_values import later

    chosen, runs = work.chosen, len(work.signals)

    def make(numbers: np.ndarray, samples: np.ndarray, names: np.ndarray) -> np.ndarray:
        some = work.some(chosen.part(kept[samples], names), numbers)
        return _whole(some, kept[samples], threads).values

    told = _whole(work.some(chosen.part(kept[:1], NO_COLUMNS)), kept[:1], threads)
    return told._replace(values=later((runs, len(kept), len(chosen.names)), make))


def _whole(work: _Work, kept: np.ndarray, threads: int) -> Found:
    """Results of all runs at the kept times; `InputError` if they don't fit into memory."""
    runs, shape = len(work.signals), (len(kept), len(work.chosen.names))
    size = 8 * runs * math.prod(shape)
    if size > LARGEST:
        raise InputError(
            f"the result would take {size / 1e9:.1f} GB of memory: choose outputs= and "
            f"times=, or write it to path="
        )
    whole = Found.empty(runs, shape, len(work.reduced.model.counts))
    for first, found in _chunks(work, runs, threads):
        whole.write(slice(first, first + len(found.status)), found)
    return whole


def _attributes(reduced: ReducedOrderModel, runs: int) -> dict[str, object]:
    """Where the runs come from."""
    return attributes(
        f"{runs} runs of {reduced.model.name}, {reduced.method}",
        reduced.model.kernel_hash,
        model=reduced.model.name,
        method=reduced.method,
        settings=repr(dict(reduced.settings)),
    )


def _chunks(work: Callable[[slice], Found], runs: int, threads: int) -> Iterator[tuple[int, Found]]:
    """Chunks of runs in their order, with the number of the first; few are alive at a time."""
    waiting: deque[tuple[int, Future[Found]]] = deque()
    with one_thread(), ThreadPoolExecutor(threads, "vehiclemor") as pool:
        try:
            for first in range(0, runs, CHUNK):
                waiting.append((first, pool.submit(work, slice(first, first + CHUNK))))
                if len(waiting) > 2 * threads:
                    begin, found = waiting.popleft()
                    yield begin, found.result()
            while waiting:
                begin, found = waiting.popleft()
                yield begin, found.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


class _Work:
    """Does a chunk of runs, in any thread."""

    def __init__(
        self,
        reduced: ReducedOrderModel,
        chosen: Selection,
        signals: Sequence[Maneuver],
        starts: Sequence[Start],
        sets: Sequence[tuple] | None,
    ) -> None:
        self.reduced, self.chosen, self.signals = reduced, chosen, signals
        self.starts, self.sets = starts, sets
        self.own = runner_of(reduced, chosen)
        if isinstance(self.own, SingleRuns):
            self.own.check(signals)
        self._runners: dict[tuple, Runner] = {}
        self._lock = Lock()

    def some(self, chosen: Selection, runs: np.ndarray | None = None) -> _Work:
        """The same with another choice, of some of the runs."""
        if runs is None:
            return _Work(self.reduced, chosen, self.signals, self.starts, self.sets)
        signals, starts = _taken(self.signals, runs), _taken(self.starts, runs)
        sets = None if self.sets is None else _taken(self.sets, runs)
        return _Work(self.reduced, chosen, signals, starts, sets)

    def __call__(self, part: slice) -> Found:
        """Results of the runs in a slice."""
        signals, starts = self.signals[part], self.starts[part]
        if self.sets is None:
            return self.own.found(signals, starts)
        sets = self.sets[part]
        # In the order in which they come, so that equal neighbours share a model.
        bounds = [k for k in range(1, len(sets)) if sets[k] != sets[k - 1]]
        parts = []
        for a, b in zip([0, *bounds], [*bounds, len(sets)], strict=True):
            parts.append(self._with(sets[a], signals[a:b], starts[a:b]))
        return Found(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def _with(self, given: tuple, signals: Any, starts: Sequence[Start]) -> Found:
        """Results of runs with one parameter set; all refused if there is no such model."""
        try:
            return self._runner(given).found(signals, starts)
        except VehiclemorError as error:
            samples = len(self.chosen.samples(signals[0])[1])
            shape = samples, len(self.chosen.names)
            found = Found.empty(len(starts), shape, len(self.reduced.model.counts))
            found.refuse(dict.fromkeys(range(len(starts)), str(error)))
            return found

    def _runner(self, given: tuple) -> Runner:
        with self._lock:
            runner = self._runners.get(given)
        if runner is None:
            runner = runner_of(self.reduced.for_parameters(dict(given)), self.chosen)
            with self._lock:
                if len(self._runners) >= MOST_SETS:
                    self._runners.clear()
                self._runners[given] = runner
        return runner


def _taken(own: Any, runs: np.ndarray) -> Any:
    """What belongs to some of the runs."""
    return own[runs] if isinstance(own, Signals | np.ndarray) else [own[run] for run in runs]


def _cores() -> int:
    """Number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
