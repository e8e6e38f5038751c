"""What is handed in for a batch of runs, checked where it comes in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.online.batch_result import SAME_TIME, Selection
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.parameters import parameter_and_axis
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.simulation.algebraic import NEWTON_TOLERANCE
from vehiclemor.simulation.build import build
from vehiclemor.simulation.checks import checked_path
from vehiclemor.simulation.dynamic import REFERENCE_TOLERANCE
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start
from vehiclemor.study.plans.training import training_set


def model_behind(model: Any) -> ReducedOrderModel:
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


def count_of(signals: Any, model: Model) -> int:
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


def kept_times(
    chosen: Selection, signals: Sequence[Maneuver]
) -> tuple[np.ndarray, list[slice | np.ndarray]]:
    """Times in s of the result, and which samples of each run these are.

    Raises
    ------
    InputError
        If runs have other output times.
    """
    first, times = signals[0], chosen.times
    if times is None:
        for run, signal in enumerate(signals):
            if (signal.duration, signal.samples) != (first.duration, first.samples):
                raise InputError(
                    f"signals[{run}] has other output times than the first: choose times="
                )
        return first.times, [slice(None)] * len(signals)
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


def starts_of(starts: Any, runs: int, model: Model) -> Sequence[Start]:
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


def parameter_sets(
    parameters: Any, runs: int, reduced: ReducedOrderModel
) -> Sequence[tuple] | None:
    """Parameters (name, value) of each run, none if all have the model's own."""
    if parameters is None:
        return None
    # What is trained on runs says so.
    reduced.for_parameters({})
    of = reduced.model.definition
    if isinstance(parameters, Mapping):
        columns = {
            name: [*map(_plain, _parameter(name, value, of, runs))]
            for name, value in parameters.items()
        }
        names = [*columns]
        return [
            tuple(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)
        ] or None
    whole = isinstance(parameters, Sequence) and len(parameters) == runs
    if not whole or not all(isinstance(own, Mapping) for own in parameters):
        raise InputError(f"parameters is {quoted(parameters)}, not a mapping for each run")
    return [
        tuple((name, _plain(_parameter(name, value, of))) for name, value in own.items())
        for own in parameters
    ]


def _parameter(
    name: str, value: Any, model: ModelDefinition, runs: int | None = None
) -> np.ndarray:
    """Value (size,) of a parameter, or values (runs, size) of all runs; no axis for size 1."""
    whole, axis = parameter_and_axis(model.name, model.parameters, name)
    try:
        array = real_array(value)
    except (TypeError, ValueError):
        raise InputError(f"parameter {name}: {quoted(value)} is not a number") from None
    size = model.parameters[whole].size
    own = () if size == 1 or axis is not None else (size,)
    shapes = [own] if runs is None else [own, (runs, *own)]
    if array.shape not in shapes:
        wanted = " or ".join(map(str, shapes))
        raise InputError(f"parameter {name} has shape {array.shape}, not {wanted}")
    return np.broadcast_to(array, shapes[-1])


def _plain(value: np.ndarray) -> Any:
    """A number or a tuple of numbers, which can be a key."""
    return tuple(value.tolist()) if value.ndim else value.item()
