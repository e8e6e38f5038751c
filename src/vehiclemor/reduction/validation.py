"""The border of methods: settings that come in, and what a fit and its runs give back."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydantic import ValidationError

from vehiclemor.arguments import quoted
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.cars import difference
from vehiclemor.reduction.interface import FitOther, Method, Offline, ReducedModel
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.registry import unknown
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import STATUSES, Trajectory


def validated(
    method: Method,
    kind: str,
    given: Mapping[str, object],
    preset: str = "recommended",
    coordinates: int | None = None,
) -> Any:
    """All settings of a method: those given, else those of the preset, else the defaults.

    Parameters
    ----------
    coordinates
        Number of the model's coordinates: a rank that is not given is at most that.

    Returns
    -------
    Settings
        An instance of `method.settings[kind]`.

    Raises
    ------
    InputError
        If a name is not declared, or a value has the wrong kind or is out of bounds.
    """
    presets = method.presets_of(kind)
    if not isinstance(preset, str) or preset not in presets:
        raise unknown(f"preset of {method.name}", preset, presets)
    declared = method.settings.get(kind, Settings)
    for name in given:
        if name not in declared.model_fields:
            raise unknown(f"setting of {method.name}", name, declared.model_fields)
    chosen = dict(presets[preset])
    if coordinates is not None and "rank" in declared.model_fields:
        rank = chosen.get("rank", declared.model_fields["rank"].default)
        if isinstance(rank, int) and rank > coordinates:
            chosen["rank"] = coordinates
    try:
        return declared.model_validate(chosen | dict(given))
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{method.name}: {first['loc'][0]} {_wrong(first)}") from None


def fitted(
    method: Method, model: Model, training: Training, settings: Any, others: FitOther | None = None
) -> ReducedModel:
    """What a method's `fit` gives, checked.

    Raises
    ------
    InputError
        If it learns from its own car alone and a training run is of another one, or `fit` refuses.
    """
    for run in training if method.learns_from == "own" else ():
        if name := difference(model, run.model):
            raise InputError(
                f"{method.name} learns from runs of the car that it reduces alone: {name} of a "
                f"training run is another"
            )
    more = (others,) if others and method.fits_others else ()
    return checked_fit(method.name, method.fit(model, training, settings, *more))


def of_car(method: Method, reduced: ReducedModel, model: Model, settings: Any) -> ReducedModel:
    """A reduced model remade for another car: what follows from its parameters, and no fit.

    Raises
    ------
    InputError
        If the method does not know how.
    """
    if (remade := getattr(reduced, "for_car", None)) is not None:
        return checked_fit(method.name, remade(model))
    if method.learns_from == "inputs":
        return fitted(method, model, (), settings)
    raise InputError(
        f"{method.name} is fitted to one car: reduce the model with the other parameters"
    )


def checked_fit(method: str, reduced: Any) -> Any:
    """A reduced model; `TypeError` if what `fit` gave is none."""
    for name in ("simulate", "best_approximation", "offline", "effective_rank"):
        if not hasattr(reduced, name):
            raise TypeError(f"method {method!r}: fit gives {quoted(reduced)}, which has no {name}")
    if not isinstance(reduced.offline, Offline):
        raise TypeError(f"method {method!r}: offline is {quoted(reduced.offline)}, no Offline")
    if not isinstance(reduced.effective_rank, int | np.integer):
        rank = quoted(reduced.effective_rank)
        raise TypeError(f"method {method!r}: effective_rank is {rank}, no whole number")
    return reduced


def checked_run(model: Model, maneuver: Maneuver, reduced: Any, run: Any) -> Trajectory:
    """A trajectory at the output times; `TypeError` if what `simulate` gave is none."""
    whose = f"{type(reduced).__module__}.{type(reduced).__name__}: simulate gives"
    if not isinstance(run, Trajectory):
        raise TypeError(f"{whose} {quoted(run)}, no Trajectory")
    samples = maneuver.samples
    for name in ("coordinates", "speeds", "outputs"):
        shape = (samples, len(getattr(model, name)))
        found = np.asarray(getattr(run, name))
        if found.shape != shape or found.dtype != float:
            raise TypeError(f"{whose} {name} {found.shape} of {found.dtype}, not {shape} of floats")
    if np.shape(run.time) != (samples,):
        raise TypeError(f"{whose} {np.size(run.time)} times, not the {samples} of the maneuver")
    if run.status not in STATUSES or not isinstance(run.seconds, float | int):
        raise TypeError(f"{whose} status {run.status!r} and seconds {quoted(run.seconds)}")
    if not isinstance(run.counts, Mapping):
        raise TypeError(f"{whose} counts {quoted(run.counts)}, not numbers by name")
    return run


def _wrong(error: Any) -> str:
    """What is wrong with a value, in the words of this package."""
    value, limits = error["input"], error.get("ctx", {})
    words: dict[str, Callable[[], str]] = {
        "greater_than_equal": lambda: f"is {value:g}; it must be at least {limits['ge']:g}",
        "greater_than": lambda: f"is {value:g}; it must be above {limits['gt']:g}",
        "less_than_equal": lambda: f"is {value:g}; it must be at most {limits['le']:g}",
        "less_than": lambda: f"is {value:g}; it must be below {limits['lt']:g}",
        "int_type": lambda: f"is {value!r}, not an integer",
        "float_type": lambda: f"is {value!r}, not a number",
        "string_type": lambda: f"is {value!r}; allowed: text",
        "literal_error": lambda: f"is {value!r}; allowed: {_listed(limits['expected'])}",
    }
    return words.get(error["type"], lambda: error["msg"].removeprefix("Value error, "))()


def _listed(expected: str) -> str:
    """Pydantic's "'a', 'b' or 'c'" as "a, b, c"."""
    return expected.replace(" or ", ", ").replace("'", "")
