"""Many runs of one model in threads, as one dataset."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from vehiclemor.arguments import MOST_JOBS, count
from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.online.batch_arguments import (
    count_of,
    kept_times,
    model_behind,
    parameter_sets,
    starts_of,
)
from vehiclemor.online.batch_result import Found, dataset, selected
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory
from vehiclemor.study.evaluate import one_thread
from vehiclemor.study.failure import Failure, attempt
from vehiclemor.study.provenance import attributes

if TYPE_CHECKING:
    import xarray as xr

# Runs that a thread takes at a time.
CHUNK = 64
# Bytes of a result; a larger one is to be chosen from.
LARGEST = 4 << 30
# Parameter sets whose models are kept.
MOST_SETS = 32


def simulate_many(
    model: str | Model | ReducedOrderModel,
    signals: Sequence[Maneuver],
    starts: Start | Sequence[Start] | None = None,
    parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    *,
    outputs: str | Sequence[str] | None = None,
    times: Any = None,
    jobs: int | None = None,
) -> xr.Dataset:
    """Many runs in threads, each the same to the bit as if it were done alone.

    Parameters
    ----------
    model
        Reduced or full model made by `reduce()`; or a full model, or its name, which is integrated
        as `Model.simulate` does by default, to be measured against: `reduce(model, "full_order",
        solver="ros34pw2", tolerance=2e-3)` is far faster.
    signals
        A signal or maneuver for each run, see `many_signals`.  They have the same output times,
        unless `times` are given.
    starts
        Initial condition of the full model by name, or as a state (n,), for all runs; or a list of
        these, or states (runs, n).
    parameters
        In SI units: name -> value for all runs, or values by run; or one mapping for each run.  Of
        a model whose method learns from no run, see `ReducedOrderModel.for_parameters`.
    outputs
        Names of outputs, coordinates or speeds to be kept; by default all outputs.
    times
        Times in s at which they are kept, some of the output times of each signal; all of them by
        default.
    jobs
        Number of threads; by default as many as there are cores.

    Returns
    -------
    xarray.Dataset
        `values` (run, time, output) and, by run, `status`, `message`, `remark`, `indicator` and
        `until` (what a reduced model tells of itself), `seconds` and solver counts.  A run that has
        failed, or that the model refuses, tells so in its status, and is not a number from there
        on.

    Raises
    ------
    InputError
        If an argument is wrong, or the result does not fit into memory.
    """
    reduced = model_behind(model)
    runs = count_of(signals, reduced.model)
    chosen = selected(reduced.model, outputs, times)
    kept, rows = kept_times(chosen, signals)
    begins = starts_of(starts, runs, reduced.model)
    sets = parameter_sets(parameters, runs, reduced)
    threads = _cores() if jobs is None else count("jobs", jobs, most=MOST_JOBS)
    shape = runs, len(kept), len(chosen.names)
    if 8 * math.prod(shape) > LARGEST:
        size = 8e-9 * math.prod(shape)
        raise InputError(f"the result would take {size:.1f} GB of memory: choose outputs=, times=")
    found = Found.empty(shape, len(reduced.model.counts))
    model_of = _models(reduced)

    def result(run: int) -> Trajectory | Failure:
        car = reduced if sets is None else model_of(sets[run])
        if isinstance(car, Failure):
            return car
        return attempt(lambda: car.simulate(signals[run], begins[run]))

    def work(first: int) -> None:
        for run in range(first, min(first + CHUNK, runs)):
            done = result(run)
            if isinstance(done, Failure):
                found.fail(run, done)
            else:
                found.write(run, done, rows[run], chosen)

    with one_thread(), ThreadPoolExecutor(threads, "vehiclemor") as pool:
        for _ in pool.map(work, range(0, runs, CHUNK)):
            pass
    about = attributes(
        f"{runs} runs of {reduced.model.name}, {reduced.method}",
        reduced.model.kernel_hash,
        model=reduced.model.name,
        method=reduced.method,
        settings=repr(dict(reduced.settings)),
    )
    return dataset(reduced.model, chosen, kept, found).assign_attrs(about)


def _models(reduced: ReducedOrderModel) -> Callable[[tuple], ReducedOrderModel | Failure]:
    """What gives the model of a parameter set, or why there is none."""

    @lru_cache(MOST_SETS)
    def model_of(given: tuple) -> ReducedOrderModel | Failure:
        try:
            return reduced.for_parameters(dict(given))
        except VehiclemorError as error:
            return Failure("rejected", str(error))

    return model_of


def _cores() -> int:
    """Number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
