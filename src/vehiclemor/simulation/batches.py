"""Many runs of one model in threads, as one dataset."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import MOST_JOBS, count, quoted, real_array
from vehiclemor.exceptions import ConvergenceError, InputError, VehiclemorError
from vehiclemor.failure import Failure, attempt
from vehiclemor.inputs.checks import completed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import registered
from vehiclemor.parameters import parameter_and_axis
from vehiclemor.provenance import attributes
from vehiclemor.registry import choice
from vehiclemor.simulation.build import build, reparametrised
from vehiclemor.simulation.checks import checked_path
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK, one_thread
from vehiclemor.simulation.trajectory import (
    REPORTED,
    Names,
    Start,
    Trajectory,
    Trust,
    output_names,
    sample_rows,
)

if TYPE_CHECKING:
    import xarray as xr

# Runs that a thread takes at a time.
CHUNK = 64
# Bytes of a result; a larger one is to be chosen from.
LARGEST = 4 << 30
# Parameter sets whose models are kept.
MOST_SETS = 32
# What else there is of each run: unit and meaning.
MEANINGS = {name: ("", meaning) for name, meaning in REPORTED.items()} | {
    "indicator": ("1", "how far the run goes in what its model knows; 1 is the edge"),
    "until": ("s", "time at which the indicator has first passed 1"),
    "seconds": ("s", "time spent in the compiled loop"),
}


def simulate_many(
    model: str | Model | Any,
    signals: Sequence[str | Excitation],
    starts: Start | Sequence[Start] | None = None,
    parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    *,
    outputs: Names = None,
    times: Any = None,
    jobs: int | None = None,
    bounds: Mapping[str, Any] | None = None,
    trust: str = "estimate",
) -> xr.Dataset:
    """Many runs in threads, each the same to the bit as if it were done alone.

    A controller's rollouts by fixed steps are far faster: `export(model, "rollouts")`.

    Parameters
    ----------
    model
        Reduced or full model made by `reduce()`; or a full model, or its name, which is integrated
        as `Model.simulate` does by default, to be measured against: `reduce(model, "full_order",
        preset="strongest")` is far faster.  Or whatever has a full `model` and a function
        `simulate` of a maneuver, a start and `outputs`.
    signals
        A signal, maneuver or registered name for each run, see `many_signals`.  They have the same
        output times, unless `times` are given.
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
    bounds, trust
        Of a reduced model, see `ReducedOrderModel.simulate`.

    Returns
    -------
    xarray.Dataset
        `values` (run, time, output) and, by run, `status`, `message`, `remark`, `indicator` and
        `until` (of its trust), `seconds` and solver counts.  A run that has failed, or that the
        model refuses, tells so in its status, and is not a number from there on.
    """
    from joblib import cpu_count

    given, full, driven = _driven(model, signals)
    runs, names = len(driven), full.outputs if outputs is None else output_names(outputs)
    for name in names:
        choice("output", name, (*full.outputs, *full.definition.states))
    kept, rows = _kept_times(times, driven)
    begins = _starts_of(starts, runs, full)
    model_of = _models(given, full, parameters, runs)
    threads = cpu_count() if jobs is None else count("jobs", jobs, most=MOST_JOBS)
    shape = runs, len(kept), len(names)
    if 8 * math.prod(shape) > LARGEST:
        size = 8e-9 * math.prod(shape)
        raise InputError(f"the result would take {size:.1f} GB of memory: choose outputs=, times=")
    values = np.empty(shape)
    how = {"outputs": names} | _judgement(given, bounds, trust)

    def written(run: int) -> tuple:
        """What else there is of a run, whose values are written."""
        done = attempt(lambda: _whole_run(model_of(run), driven[run], begins[run], how))
        values[run] = np.nan if isinstance(done, Failure) else done.outputs[rows[run]]
        return _report(done, full)

    def reports(first: int) -> list[tuple]:
        return [written(run) for run in range(first, min(first + CHUNK, runs))]

    with one_thread(), ThreadPoolExecutor(threads, "vehiclemor") as pool:
        found = list(itertools.chain(*pool.map(reports, range(0, runs, CHUNK))))
    dataset = _dataset(full, list(names), kept, values, found)
    return dataset.assign_attrs(_about(given, full, driven))


def _driven(model: Any, signals: Any) -> tuple[Any, Model, Sequence[Excitation]]:
    """What is to run, its full model and what drives it, all inputs of which a full one has."""
    given = build(model) if isinstance(model, str) else model
    full = getattr(given, "model", given)
    if not isinstance(full, Model):
        raise InputError(f"model is {quoted(model)}, neither a model nor the name of one")
    if isinstance(signals, Excitation) or not isinstance(signals, Sequence) or not len(signals):
        raise InputError(f"signals is {quoted(signals)}, not a list with a signal for each run")
    if isinstance(signals, list | tuple):
        signals = [registered(each) if isinstance(each, str) else each for each in signals]
    for run, signal in enumerate(signals):
        if not isinstance(signal, Excitation):
            raise InputError(f"signals[{run}] is {quoted(signal)}, not a signal or maneuver")
    if given is full:
        given = full = full.driving([name for signal in signals for name in signal.inputs])
    for signal in signals:
        completed(signal, full.definition)
    return given, full, signals


def _judgement(given: Any, bounds: Any, trust: str) -> dict[str, Any]:
    """Arguments of each run by which it is judged; `InputError` if one is wrong."""
    off = choice("trust", trust, ("estimate", "off")) == "off"
    how: dict[str, Any] = {"trust": trust} if off and not isinstance(given, Model) else {}
    if bounds is None:
        return how
    checked = getattr(given, "checked_bounds", None)
    if checked is None:
        raise InputError("bounds: errors of these runs are not estimated")
    checked(bounds, off)
    return how | {"bounds": bounds}


def _about(given: Any, full: Model, signals: Sequence[Excitation]) -> dict[str, Any]:
    """Attributes of the result: of which model with which settings it is."""
    solver, tolerance = full.reference
    runs, default = len(signals), {"solver": solver, "tolerance": tolerance}
    settings, method = getattr(given, "settings", default), getattr(given, "method", "full_order")
    title, of = f"{runs} runs of {full.name}, {method}", {"model": full.name, "method": method}
    return attributes(title, full.kernel_hash, **of, settings=repr(dict(settings)))


def _report(done: Trajectory | Failure, model: Model) -> tuple:
    """What else there is of a run: what `MEANINGS` names, and solver counts."""
    if isinstance(done, Failure):
        return done.status, done.message, "", np.nan, 0.0, 0.0, *[0] * len(model.counts)
    trust = done.trust or Trust(np.nan)
    own = done.status, done.message, done.remark, trust.indicator, trust.until, done.seconds
    return *own, *done.counts.values()


def _whole_run(model: Any, signal: Excitation, start: Start, how: Mapping[str, Any]) -> Trajectory:
    """A run with some outputs alone; it may have diverged."""
    try:
        return model.simulate(signal, start, **how)
    except ConvergenceError as error:
        if error.trajectory is None:
            raise
        return error.trajectory


def _kept_times(
    given: Any, signals: Sequence[Excitation]
) -> tuple[np.ndarray, list[slice | np.ndarray]]:
    """Times in s of the result, and which samples of each run these are."""
    known: dict[tuple[float, int], slice | np.ndarray] = {}
    for run, signal in enumerate(signals):
        alike = signal.duration, signal.samples
        if alike in known:
            continue
        if given is None and known:
            raise InputError(f"signals[{run}] has other output times than the first: choose times=")
        try:
            known[alike] = slice(None) if given is None else sample_rows(given, signal.times)
        except InputError as error:
            raise InputError(f"signals[{run}]: {error}") from None
    times = signals[0].times if given is None else np.atleast_1d(real_array(given))
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


def _models(given: Any, full: Model, parameters: Any, runs: int) -> Callable[[int], Any]:
    """The model of each run, by its index; it raises `InputError` where there is none."""
    if parameters is None:
        return lambda _: given
    remade = partial(reparametrised, full)
    if given is not full:
        remade = getattr(given, "for_parameters", None)
        if remade is None:
            raise InputError("parameters: this model can't be made with others")
        # What is trained on runs says so.
        remade({})
    if isinstance(parameters, Mapping):
        columns = [
            [(name, value) for value in _values(full, name, by_run, runs)]
            for name, by_run in parameters.items()
        ]
        sets = [*zip(*columns, strict=True)] or [()] * runs
    else:
        whole = isinstance(parameters, Sequence) and len(parameters) == runs
        if not whole or not all(isinstance(own, Mapping) for own in parameters):
            raise InputError(f"parameters is {quoted(parameters)}, not a mapping for each run")
        sets = [
            tuple((name, *_values(full, name, value)) for name, value in own.items())
            for own in parameters
        ]

    @lru_cache(MOST_SETS)
    def made(own: tuple) -> Any:
        try:
            return remade(dict(own))
        except VehiclemorError as error:
            raise InputError(str(error)) from None

    return lambda run: made(sets[run])


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


def _dataset(
    model: Model, names: list[str], times: np.ndarray, values: np.ndarray, reports: list[tuple]
) -> xr.Dataset:
    """Runs by labels: their values (run, time, output), what else there is of them, counts."""
    import xarray as xr

    declared = (*model.definition.outputs, *model.definition.state_quantities)
    units = {quantity.name: quantity.unit for quantity in reversed(declared)}
    described = MEANINGS | {name: ("1", long_name) for name, long_name in model.counts.items()}
    variables: dict[str, Any] = {}
    variables["values"] = ("run", "time", "output"), values, {"long_name": "quantities"}
    columns = zip(*reports, strict=True)
    for (name, (unit, long_name)), column in zip(described.items(), columns, strict=True):
        further = {"units": unit} if unit else {}
        variables[name] = "run", np.array(column), {"long_name": long_name} | further
    variables["seconds"][2]["clock"] = CLOCK
    unit_of = "output", [units[name] for name in names], {"long_name": "SI unit of the quantity"}
    coordinates = {
        "run": ("run", np.arange(len(values)), {"long_name": "number"}),
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        "output": ("output", names, {"long_name": "name of the quantity"}),
        "output_unit": unit_of,
    }
    return xr.Dataset(variables, coordinates)
