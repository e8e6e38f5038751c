"""Many runs of one model: in threads, as one dataset, in memory or written while they are made."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import count, file_path, quoted, real_array
from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_files import checked_target, opened, written
from vehiclemor.online.batch_result import Found, Selection, dataset, selected
from vehiclemor.online.batch_runners import Runner, runner_of
from vehiclemor.online.batch_signals import Signals
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.registry import unknown
from vehiclemor.simulation.algebraic import NEWTON_TOLERANCE
from vehiclemor.simulation.build import build, reparametrised
from vehiclemor.simulation.checks import checked_path
from vehiclemor.simulation.dynamic import REFERENCE_TOLERANCE
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
        solver="ros34pw2", tolerance=2e-3)` is 50 times faster.
    signals
        One for each run: `Signals`, or a list of signals or maneuvers.  They have the same output
        times, unless `times` are given.
    starts
        Initial condition of the full model by name, or as a state (n,), for all runs; or a list of
        these, or states (runs, n).
    parameters
        Of a full model, in SI units: name -> value for all runs, or values by run; or one mapping
        for each run.
    outputs
        Names of outputs, coordinates or speeds to be kept; all outputs by default.
    times
        Times in s at which they are kept; the output times of the signals by default.  A run is
        watched at its own output times whatever is kept.
    jobs
        Number of threads; by default as many as there are cores.
    path
        File (`.nc`) or new folder (`.zarr`) to which the runs are written chunk by chunk, so that
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
    reduced = _ready(model)
    runs = _count(signals, reduced.model)
    chosen = selected(reduced.model, outputs, times)
    kept = _kept_times(chosen, signals)
    begins = _starts(starts, runs, reduced.model)
    sets = _parameter_sets(parameters, runs, reduced)
    threads = _cores() if jobs is None else count("jobs", jobs)
    about = attributes(
        f"{runs} runs of {reduced.model.name}, {reduced.method}",
        reduced.model.kernel_hash,
        model=reduced.model.name,
        method=reduced.method,
        settings=repr(dict(reduced.settings)),
    )
    work = _Work(reduced, chosen, signals, begins, sets)

    def labelled(found: Found, first: int) -> xr.Dataset:
        return dataset(reduced.model, chosen, kept, found, first).assign_attrs(about)

    size = runs * len(kept) * len(chosen.names) * 8
    if path is None:
        if size > LARGEST:
            raise InputError(
                f"the result would take {size / 1e9:.1f} GB of memory: choose outputs= and "
                f"times=, or write it to path="
            )
        whole = Found.empty(runs, (len(kept), len(chosen.names)), len(reduced.model.counts))
        for first, found in _chunks(work, runs, threads):
            whole.write(slice(first, first + len(found.status)), found)
        return labelled(whole, 0)
    target = checked_target(file_path("path", path))
    written(target, (labelled(found, first) for first, found in _chunks(work, runs, threads)))
    return opened(target)


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
        self._runners: dict[tuple, Runner] = {(): runner_of(reduced, chosen)}
        self._lock = Lock()

    def __call__(self, part: slice) -> Found:
        """Results of the runs in a slice."""
        signals, starts = self.signals[part], self.starts[part]
        if self.sets is None:
            return self._runners[()].found(signals, starts)
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
            model = reparametrised(self.reduced.model, dict(given))
            full = replace(self.reduced.reduced, model=model)  # type: ignore[type-var]
            runner = runner_of(replace(self.reduced, model=model, reduced=full), self.chosen)
            with self._lock:
                if len(self._runners) >= MOST_SETS:
                    self._runners.clear()
                self._runners[given] = runner
        return runner


def _cores() -> int:
    """Number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _ready(model: Any) -> ReducedOrderModel:
    """The model behind the names of a reduced one."""
    if isinstance(model, ReducedOrderModel):
        return model
    full = build(model) if isinstance(model, str) else model
    if not isinstance(full, Model):
        raise InputError(f"model is {quoted(model)}, neither a model nor the name of one")
    solver, tolerance = (
        ("newton", NEWTON_TOLERANCE) if full.kind == "ae" else ("dopri5", REFERENCE_TOLERANCE)
    )
    settings = {"solver": solver, "tolerance": tolerance}
    return ReducedOrderModel(full, "full_order", settings, (), FullOrderModel(full, **settings))


def _count(signals: Any, model: Model) -> int:
    """Number of runs; `InputError` if something else than inputs of the model is given."""
    if isinstance(signals, Maneuver) or not isinstance(signals, Sequence) or not len(signals):
        raise InputError(f"signals is {quoted(signals)}, not a list with a signal for each run")
    for run, signal in enumerate([signals.first] if isinstance(signals, Signals) else signals):
        if not isinstance(signal, Maneuver):
            raise InputError(f"signals[{run}] is {quoted(signal)}, not a signal or maneuver")
        if signal.for_inputs(model.inputs).inputs != model.inputs:
            raise InputError(
                f"signals[{run}]: {signal} gives inputs {', '.join(signal.inputs)}, "
                f"{model.name} needs {', '.join(model.inputs)}"
            )
    return len(signals)


def _kept_times(chosen: Selection, signals: Any) -> np.ndarray:
    """Times in s of the result; `InputError` if runs don't share or don't reach them."""
    first = signals[0]
    others = () if isinstance(signals, Signals) else signals
    if chosen.times is None:
        for run, signal in enumerate(others):
            if (signal.duration, signal.samples) != (first.duration, first.samples):
                raise InputError(
                    f"signals[{run}] has other output times than the first: choose times="
                )
        return first.times
    shortest = min(signal.duration for signal in (first, *others))
    if chosen.times[0] < 0.0 or chosen.times[-1] > shortest * (1.0 + 1e-9):
        raise InputError(f"times must lie within all runs, 0 to {shortest:g} s")
    return chosen.times


def _starts(starts: Any, runs: int, model: Model) -> Sequence[Start]:
    """The start of each run, checked."""
    if starts is None or isinstance(starts, str):
        model.start(starts)
        return [starts or model.starts[0]] * runs
    if not isinstance(starts, Sequence | np.ndarray):
        raise InputError(f"starts is {quoted(starts)}, neither names nor states")
    if not len(starts) or (np.ndim(starts[0]) == 0 and not isinstance(starts[0], str)):
        return [model.start(starts)] * runs  # type: ignore[arg-type]
    if len(starts) != runs:
        raise InputError(f"there are {len(starts)} starts for {runs} runs")
    if isinstance(starts, np.ndarray):
        return checked_path(starts, len(model.definition.states), "starts")  # type: ignore[return-value]
    return [start if isinstance(start, str) else model.start(start) for start in starts]


def _parameter_sets(
    parameters: Any, runs: int, reduced: ReducedOrderModel
) -> Sequence[tuple] | None:
    """Parameters (name, value) of each run, none if all have the model's own."""
    if parameters is None:
        return None
    if reduced.method != "full_order":
        raise InputError(
            f"parameters: {reduced.method} was fitted to one parameter set; "
            f"other ones are for the full model"
        )
    if isinstance(parameters, Mapping):
        declared = reduced.model.definition.parameters
        columns = {}
        for name, value in parameters.items():
            if name not in declared:
                raise unknown("parameter", name, declared)
            try:
                array = real_array(value)
            except (TypeError, ValueError):
                raise InputError(f"parameter {name}: {quoted(value)} is not a number") from None
            own = () if declared[name].size == 1 else (declared[name].size,)
            if array.shape not in (own, (runs, *own)):
                raise InputError(
                    f"parameter {name} has shape {array.shape}, not {own} or {(runs, *own)}"
                )
            columns[name] = np.broadcast_to(array, (runs, *own)).tolist()
        names = [*columns]
        return [
            tuple(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)
        ] or None
    if not isinstance(parameters, Sequence) or len(parameters) != runs:
        raise InputError(f"parameters is {quoted(parameters)}, not a mapping for each run")
    return [tuple(own.items()) for own in parameters]
