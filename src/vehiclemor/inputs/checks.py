"""Checks of maneuvers at the border of a model that is ready to run."""

from functools import lru_cache

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation, cached
from vehiclemor.inputs.maneuver import registered
from vehiclemor.inputs.signal import Signal
from vehiclemor.multibody.definition import ModelDefinition

# Part of an input's largest magnitude by which polynomials pass a bound that its samples keep, and
# by which a line between equal values is off.
ROUNDING = 1e-9


def checked_maneuver(maneuver: str | Excitation, definition: ModelDefinition) -> Excitation:
    """A maneuver, also by its name; a signal with all inputs that a model has.

    `InputError` if it is none, gives other inputs than the model has, or one that leaves the bounds
    in which the model declares that it means anything.
    """
    if isinstance(maneuver, str):
        maneuver = registered(maneuver)
    if not isinstance(maneuver, Excitation):
        raise InputError(f"{quoted(maneuver)} is not a maneuver, as vm.maneuver(name) gives one")
    return _checked(maneuver, definition)


def completed(maneuver: Excitation, definition: ModelDefinition) -> Excitation:
    """A maneuver with all inputs of a model in its order, those that it lacks at their defaults.

    `InputError` if it gives others.
    """
    names = tuple(quantity.name for quantity in definition.inputs)
    needed = f"{definition.name} needs {', '.join(names)}"
    for name in maneuver.inputs:
        if name not in names and any(name == q.name for q in definition.optional_inputs):
            alone = f"alone: it is reduced from runs without {name}"
            raise InputError(f"{maneuver} gives input {name}, {needed} {alone}")
    complete = maneuver.for_inputs(names, tuple(q.default or 0.0 for q in definition.inputs))
    if complete.inputs != names:
        raise InputError(f"{maneuver} gives inputs {', '.join(maneuver.inputs)}, {needed}")
    return complete


# A maneuver is checked once for all its runs, and so is a signal that has been completed.
@cached
def _checked(maneuver: Excitation, definition: ModelDefinition) -> Excitation:
    complete = completed(maneuver, definition)
    _check_bounds(complete, definition)
    return complete


@lru_cache(maxsize=64)
def _limits(definition: ModelDefinition) -> np.ndarray | None:
    """Low and high limits (2, inputs) of the inputs, if there are any."""
    anything = -np.inf, np.inf
    ranges = [definition.validity.get(q.name, anything) for q in definition.inputs]
    return None if all(bounds == anything for bounds in ranges) else np.array(ranges).T


@cached
def _check_bounds(maneuver: Excitation, definition: ModelDefinition) -> None:
    if (limits := _limits(definition)) is None:
        return
    # A road has too many waves to be taken between output times.
    extent = _sampled_extent if definition.kind == "structural" else Excitation.extent
    low, high = limits
    smallest, largest, _ = extent(maneuver, limits)
    if (smallest >= low).all() and (largest <= high).all():
        return
    rounding = ROUNDING * np.maximum(-smallest, largest)
    since = extent(maneuver, np.array([low - rounding, high + rounding]))[2]
    j = since.argmin()
    if np.isfinite(since[j]):
        quantity, value = definition.inputs[j], maneuver.at(since[j : j + 1])[0, j]
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        said = f"is {value:.4g}{unit} at t = {since[j]:.6g} s"
        if low[j] <= value <= high[j]:
            # It only just leaves there.
            value = smallest[j] if smallest[j] < low[j] else largest[j]
            said = f"reaches {value:.4g}{unit} after t = {since[j]:.6g} s"
        cubic = isinstance(maneuver, Signal) and maneuver.hold == "cubic"
        hint = "; a cubic hold overshoots its samples, a linear one does not" if cubic else ""
        raise InputError(
            f"{maneuver}: input {quantity.name} {said}; "
            f"{definition.name} holds from {low[j]:g} to {high[j]:g}{unit}{hint}"
        )


def _sampled_extent(maneuver: Excitation, limits: np.ndarray) -> np.ndarray:
    """As `Excitation.extent`, at the output times alone."""
    times, values = maneuver.recorded_inputs
    beyond = (values < limits[0]) | (values > limits[1])
    since = np.where(beyond.any(axis=0), times[beyond.argmax(axis=0)], np.inf)
    return np.array([values.min(axis=0), values.max(axis=0), since])


@cached
def check_resolved(maneuver: Excitation) -> None:
    """Raise `InputError` if the output times are too far apart to show the inputs.

    Between two output times without a corner an input stays within a quarter of its range of the
    straight line, as a sine of three samples a period does; it may leave it once.  The rate of an
    input is shown with it.  A signal is known between them.
    """
    times, between, names = maneuver.times, 0.38, {*maneuver.inputs}
    if len(times) == 1 or isinstance(maneuver, Signal):
        return
    step = times[1]
    values = maneuver.at(times)
    inside = maneuver.at(times[:-1] + between * step)
    # A solver names the time of a value that is not finite.
    if not (np.isfinite(values).all() and np.isfinite(inside).all()):
        return
    off = np.abs(inside - (1.0 - between) * values[:-1] - between * values[1:])
    everywhere = np.concatenate([values, inside])
    rounding = ROUNDING * np.abs(everywhere).max(axis=0)
    wrong = off > 0.25 * np.ptp(everywhere, axis=0) + rounding
    corners = np.searchsorted(times, maneuver.break_points, side="right") - 1
    wrong[corners[(corners >= 0) & (corners < len(wrong))]] = False
    wrong[:, [name.removesuffix("_dot") in names - {name} for name in maneuver.inputs]] = False
    column = int(wrong.sum(axis=0).argmax())
    if wrong[:, column].sum() > 1:
        raise InputError(
            f"{maneuver}: at a frequency factor of {maneuver.frequency_factor:g} input "
            f"{maneuver.inputs[column]} changes faster than output times {step:g} s apart can show"
        )


@cached
def cut_short(maneuver: Excitation) -> str:
    """That a maneuver goes on after the end of its run, if it does."""
    last = max(maneuver.break_points, default=0.0)
    if last <= maneuver.duration:
        return ""
    return f"the maneuver would end at {last:.4g} s, after the run"
