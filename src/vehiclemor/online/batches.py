"""Many runs of one model in threads, as one dataset."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import MOST_JOBS, count, quoted, real_array
from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.parameters import parameter_and_axis
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.registry import choice
from vehiclemor.simulation.algebraic import NEWTON_TOLERANCE
from vehiclemor.simulation.build import build
from vehiclemor.simulation.checks import checked_path
from vehiclemor.simulation.dynamic import REFERENCE_TOLERANCE
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK
from vehiclemor.simulation.trajectory import STATUSES, Start, Trajectory
from vehiclemor.study.evaluate import one_thread
from vehiclemor.study.failure import Failure, attempt
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.provenance import attributes

if TYPE_CHECKING:
    import xarray as xr

# Runs that a thread takes at a time.
CHUNK = 64
# Bytes of a result; a larger one is to be chosen from.
LARGEST = 4 << 30
# Parameter sets whose models are kept.
MOST_SETS = 32
# Times (s) that differ by less are one.
SAME_TIME = 1e-9
# What is told of each run: its value before it is known, unit and meaning.
TOLD: dict[str, tuple[str | float, str, str]] = {
    "status": ("ok", "", f"one of {', '.join(STATUSES)}"),
    "message": ("", "", "why the status is not ok"),
    "remark": ("", "", "what else there is to know"),
    "indicator": (np.nan, "1", "how far the run goes in what its model knows; 1 is the edge"),
    "until": (np.inf, "s", "time at which the indicator has first passed 1"),
    "seconds": (0.0, "s", "time spent in the compiled loop"),
}


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
    reduced = _model_behind(model)
    full = reduced.model
    runs = _count_of(signals, full)
    chosen = _places(full, outputs)
    kept, rows = _kept_times(times, signals)
    begins = _starts_of(starts, runs, full)
    sets = _parameter_sets(parameters, runs, reduced)
    threads = _cores() if jobs is None else count("jobs", jobs, most=MOST_JOBS)
    shape = runs, len(kept), len(chosen)
    if 8 * math.prod(shape) > LARGEST:
        size = 8e-9 * math.prod(shape)
        raise InputError(f"the result would take {size:.1f} GB of memory: choose outputs=, times=")
    values, counts = np.empty(shape), np.zeros((runs, len(full.counts)), dtype=np.int64)
    told = {
        name: np.full(runs, first, dtype=object if isinstance(first, str) else float)
        for name, (first, _, _) in TOLD.items()
    }

    @lru_cache(MOST_SETS)
    def model_of(given: tuple) -> ReducedOrderModel | Failure:
        try:
            return reduced.for_parameters(dict(given))
        except VehiclemorError as error:
            return Failure("rejected", str(error))

    def result(run: int) -> Trajectory | Failure:
        car = reduced if sets is None else model_of(sets[run])
        if isinstance(car, Failure):
            return car
        return attempt(lambda: car.simulate(signals[run], begins[run]))

    def write(run: int, done: Trajectory | Failure) -> None:
        told["status"][run], told["message"][run] = done.status, done.message
        if isinstance(done, Failure):
            values[run], told["until"][run] = np.nan, 0.0
            return
        for k, (_, group, number) in enumerate(chosen):
            values[run, :, k] = getattr(done, group)[rows[run], number]
        told["remark"][run], told["seconds"][run] = done.remark, done.seconds
        counts[run] = list(done.counts.values())
        if done.trust is not None:
            told["indicator"][run], told["until"][run] = done.trust.indicator, done.trust.until

    def work(first: int) -> None:
        for run in range(first, min(first + CHUNK, runs)):
            write(run, result(run))

    with one_thread(), ThreadPoolExecutor(threads, "vehiclemor") as pool:
        for _ in pool.map(work, range(0, runs, CHUNK)):
            pass
    about = attributes(
        f"{runs} runs of {full.name}, {reduced.method}",
        full.kernel_hash,
        model=full.name,
        method=reduced.method,
        settings=repr(dict(reduced.settings)),
    )
    return _dataset(full, [name for name, *_ in chosen], kept, (values, told, counts)).assign_attrs(
        about
    )


def _model_behind(model: Any) -> ReducedOrderModel:
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
    training = training_set(full, "full_order", "nominal")
    fitted = FullOrderModel(full, **settings)
    return ReducedOrderModel(full, "full_order", settings, training, fitted)


def _cores() -> int:
    """Number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _count_of(signals: Any, model: Model) -> int:
    """Number of runs; `InputError` if something else than inputs of the model is given."""
    if isinstance(signals, Maneuver) or not isinstance(signals, Sequence) or not len(signals):
        raise InputError(f"signals is {quoted(signals)}, not a list with a signal for each run")
    for run, signal in enumerate(signals):
        if not isinstance(signal, Maneuver):
            raise InputError(f"signals[{run}] is {quoted(signal)}, not a signal or maneuver")
        if signal.for_inputs(model.inputs).inputs != model.inputs:
            raise InputError(
                f"signals[{run}]: {signal} gives inputs {', '.join(signal.inputs)}, "
                f"{model.name} needs {', '.join(model.inputs)}"
            )
    return len(signals)


def _places(model: Model, outputs: Any) -> list[tuple[str, str, int]]:
    """Names of what is kept, and where a trajectory has it: its attribute, the number there."""
    known = {
        name: (name, group, number)
        for group in ("speeds", "coordinates", "outputs")
        for number, name in enumerate(getattr(model, group))
    }
    chosen = model.outputs if outputs is None else outputs
    chosen = (chosen,) if isinstance(chosen, str) else chosen
    if not isinstance(chosen, Sequence) or not len(chosen):
        raise InputError(f"outputs is {quoted(outputs)}, not a list of names")
    return [known[choice("output", name, known)] for name in chosen]


def _kept_times(
    given: Any, signals: Sequence[Maneuver]
) -> tuple[np.ndarray, list[slice | np.ndarray]]:
    """Times in s of the result, and which samples of each run these are."""
    first = signals[0]
    if given is None:
        for run, signal in enumerate(signals):
            if (signal.duration, signal.samples) != (first.duration, first.samples):
                raise InputError(
                    f"signals[{run}] has other output times than the first: choose times="
                )
        return first.times, [slice(None)] * len(signals)
    try:
        times = np.atleast_1d(real_array(given))
    except (TypeError, ValueError):
        raise InputError(f"times is {quoted(given)}, no list of times in s") from None
    if times.ndim != 1 or not len(times) or not np.isfinite(times).all():
        raise InputError("times must be a list of finite times in s")
    if (np.diff(times) <= SAME_TIME).any():
        raise InputError("times must increase")
    known: dict[tuple[float, int], np.ndarray] = {}
    for run, signal in enumerate(signals):
        alike = signal.duration, signal.samples
        if alike not in known:
            own = signal.times
            rows = np.minimum(np.searchsorted(own, times - SAME_TIME), len(own) - 1)
            missed = abs(own[rows] - times) > SAME_TIME
            if missed.any():
                raise InputError(
                    f"times: {times[missed.argmax()]:g} s is no output time of signals[{run}]: "
                    f"they go from 0 to {signal.duration:g} s by {own[1]:g} s"
                )
            known[alike] = rows
    return times, [known[signal.duration, signal.samples] for signal in signals]


def _starts_of(starts: Any, runs: int, model: Model) -> Sequence[Start]:
    """The start of each run, checked."""
    if starts is None or isinstance(starts, str):
        model.start(starts)
        return [starts or model.starts[0]] * runs
    starts = np.atleast_1d(starts) if isinstance(starts, np.ndarray) else starts
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
    # What is trained on runs says so.
    reduced.for_parameters({})
    model = reduced.model
    if isinstance(parameters, Mapping):
        columns = {name: _values(model, name, v, runs) for name, v in parameters.items()}
        rows = zip(*columns.values(), strict=True)
        return [tuple(zip(columns, values, strict=True)) for values in rows] or None
    whole = isinstance(parameters, Sequence) and len(parameters) == runs
    if not whole or not all(isinstance(own, Mapping) for own in parameters):
        raise InputError(f"parameters is {quoted(parameters)}, not a mapping for each run")
    return [
        tuple((name, *_values(model, name, value)) for name, value in own.items())
        for own in parameters
    ]


def _values(model: Model, name: str, value: Any, runs: int | None = None) -> list[Any]:
    """A parameter of each run, or of one: a number or a tuple of numbers, which can be a key."""
    definition = model.definition
    whole, axis = parameter_and_axis(definition.name, definition.parameters, name)
    try:
        array = real_array(value)
    except (TypeError, ValueError):
        raise InputError(f"parameter {name}: {quoted(value)} is not a number") from None
    size = definition.parameters[whole].size
    own = () if size == 1 or axis is not None else (size,)
    shapes = [own] if runs is None else [own, (runs, *own)]
    if array.shape not in shapes:
        wanted = " or ".join(map(str, shapes))
        raise InputError(f"parameter {name} has shape {array.shape}, not {wanted}")
    rows = np.broadcast_to(array, (runs or 1, *own)).tolist()
    return [tuple(row) if own else row for row in rows]


def _dataset(model: Model, names: list[str], times: np.ndarray, found: Any) -> xr.Dataset:
    """Runs by labels: their values (run, time, output), what is told of them, and counts."""
    import xarray as xr

    values, told, counts = found
    declared = (*model.definition.outputs, *model.definition.coordinates, *model.definition.speeds)
    units = {quantity.name: quantity.unit for quantity in reversed(declared)}
    variables: dict[str, Any] = {
        "values": (("run", "time", "output"), values, {"long_name": "quantities"})
    }
    for name, (_, unit, long_name) in TOLD.items():
        attributes = {"long_name": long_name} | ({"units": unit} if unit else {})
        column = told[name].astype(str) if told[name].dtype == object else told[name]
        variables[name] = "run", column, attributes
    variables["seconds"][2]["clock"] = CLOCK
    for k, (name, long_name) in enumerate(model.counts.items()):
        variables[name] = "run", counts[:, k], {"units": "1", "long_name": long_name}
    unit_of = "output", [units[name] for name in names], {"long_name": "SI unit of the quantity"}
    coordinates = {
        "run": ("run", np.arange(len(values)), {"long_name": "number"}),
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "output": ("output", names, {"long_name": "name of the quantity"}),
        "output_unit": unit_of,
    }
    return xr.Dataset(variables, coordinates)
