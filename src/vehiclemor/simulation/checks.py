"""Checks at the border of a model that is ready to run, and of what its runs give."""

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from vehiclemor.arguments import loop_array, number, quoted, within
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation, checked_times
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import DEFAULTS

LARGEST = sys.float_info.max
# Slip ratio beyond which the longitudinal force of a tire falls: the wheel locks or spins.
LARGE_SLIP = 0.2
LOCKED = f"slip beyond {LARGE_SLIP:g}, locked or spinning"


def checked_array(value: Any, size: int, name: str, model: str) -> np.ndarray:
    """A finite array (size,) of floats as compiled functions want it, or `InputError`.

    A number is an array of one.
    """
    try:
        array = np.atleast_1d(loop_array(value))
    except (TypeError, ValueError):
        raise InputError(f"{name} is {quoted(value)}, {model} needs {size} numbers") from None
    if array.shape != (size,):
        raise InputError(f"{name} has shape {array.shape}, {model} needs ({size},)")
    if not np.isfinite(array).all():
        index = int(np.flatnonzero(~np.isfinite(array))[0])
        raise InputError(f"{name}[{index}] is not finite")
    return array


def checked_time(time: Any) -> float:
    """A time in s; `InputError` if it is none."""
    return time if type(time) is float and math.isfinite(time) else number("time", time)


def checked_path(
    value: Any, size: int, name: str, samples: int | None = None, finite: bool = True
) -> np.ndarray:
    """A path (samples, size) for compiled functions, finite by default; or `InputError`."""
    try:
        path = loop_array(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be arrays of numbers: {error}") from None
    wanted = f"({'samples' if samples is None else samples}, {size})"
    if path.ndim != 2 or path.shape[1] != size or samples not in (None, len(path)):
        raise InputError(f"{name} have shape {path.shape}, not {wanted}")
    if finite and not np.isfinite(path).all():
        row, column = np.argwhere(~np.isfinite(path))[0]
        raise InputError(f"{name}[{row}, {column}] is not finite")
    return path


def checked_inputs(value: Any, times: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Finite inputs (samples, inputs) for compiled functions; `InputError` names the time."""
    if not len(times):
        raise InputError("inputs are needed at one time at least")
    inputs = checked_path(value, len(names), "inputs", len(times), finite=False)
    if not np.isfinite(inputs).all():
        sample, column = np.argwhere(~np.isfinite(inputs))[0]
        raise InputError(f"input {names[column]} is not finite at t = {times[sample]:.6g} s")
    return inputs


def check_positive(name: str, value: object, smallest: float = 0.0) -> None:
    """Raise `InputError` if a value is no finite positive number, or is below the smallest."""
    number = isinstance(value, int | float | np.integer | np.floating)
    number = number and not isinstance(value, bool | np.timedelta64)
    # The largest number is none of single precision.
    size: Any = float(value) if isinstance(value, np.floating) else value
    # An integer may be too large for a float.
    if not (number and 0.0 < size <= LARGEST and size >= smallest):
        bound = f"at least {smallest:g}" if smallest else "positive"
        raise InputError(f"{name} is {quoted(value)}; it must be a finite number, {bound}")


def output_times(
    given: Any, maneuver: Excitation, repeats: bool = False, begin: float = 0.0
) -> np.ndarray:
    """Output times (samples,) in s that increase within a maneuver, or `InputError`.

    They are a copy that can't be written, as many runs share it.
    By default the maneuver's from `begin` on.  With `repeats` a time may stand twice, as the edges
    of windows do in snapshots.
    """
    if begin:
        within("begin", number("begin", begin), (0.0, maneuver.duration), " s")
    if given is None:
        times = maneuver.times[maneuver.times >= begin]
    else:
        times, end = checked_times(given).copy(), maneuver.duration
        steps = np.diff(times)
        if not np.all(steps >= 0.0 if repeats else steps > 0.0):
            raise InputError("output times must increase")
        if len(times) == 0 or times[0] < begin or times[-1] > end + 1e-9 * end:
            raise InputError(f"output times must lie within the run, {begin:g} to {end:g} s")
    times.flags.writeable = False
    return times


def limits_of(definition: ModelDefinition) -> tuple[list[str], tuple[str, ...], np.ndarray]:
    """Outputs with a range of validity; these and, behind them, loads and slips; limits (k, 2)."""
    names = [quantity.name for quantity in definition.outputs]
    # An input is checked before the run.
    valid = {name: r for name, r in definition.validity.items() if name in names}
    # The smallest positive number: no load is none.
    ranges = [*valid.values(), *((5e-324, np.inf) for _ in definition.loads)]
    slips = watched_slips(definition)
    ranges += [(-LARGE_SLIP, LARGE_SLIP)] * len(slips)
    watched = *valid, *definition.loads, *slips
    return list(valid), watched, np.array(ranges, dtype=float).reshape(-1, 2)


def watched_slips(definition: ModelDefinition) -> tuple[str, ...]:
    """Slip ratios in which a locked or spinning wheel shows; none where steering alone drives."""
    return () if definition.choice == DEFAULTS else definition.slips


def stopped(definition: ModelDefinition, name: str, speeds: np.ndarray) -> bool:
    """Whether a vehicle has stopped that has left the range of an output at these speeds (2,)."""
    if name not in definition.standstill[:1]:
        return False
    slowest = definition.validity[name][0]
    forward, lateral = speeds
    return bool(forward < slowest and abs(lateral) < slowest)


def left_validity(definition: ModelDefinition, name: str, value: float, time: float) -> str:
    """That an output has left its range of validity with this value, at this time in s."""
    low, high = definition.validity[name]
    message = f"{name} is {value:.4g} at t = {time:.6g} s"
    return f"{message}; the model holds from {low:g} to {high:g}"


def wheel_remarks(
    definition: ModelDefinition, first: Sequence[int], times: np.ndarray
) -> list[str]:
    """Which wheels have lifted, locked or spun, and when first, by the first sample of each."""
    remarks: list[str] = []
    # Most runs have none, and some take no longer than to look for them.
    if min(first, default=len(times)) == len(times):
        return remarks
    loads, slips = definition.loads, watched_slips(definition)
    for text, outputs, samples in (
        ("off the ground for a time", loads, first[: len(loads)]),
        (LOCKED, slips, first[len(loads) :]),
    ):
        wheels = [
            f"{name.rpartition('_')[2]} (first at {times.item(sample):.4g} s)"
            for name, sample in zip(outputs, samples, strict=True)
            if sample < len(times)
        ]
        if wheels:
            remarks.append(f"{text}: {', '.join(wheels)}")
    return remarks
