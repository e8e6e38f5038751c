"""The border of methods: settings that come in, and what a fit and its runs give back."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import ValidationError

from vehiclemor.arguments import complaint, quoted
from vehiclemor.exceptions import InputError, PlugInError, blamed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import STATE_KINDS
from vehiclemor.reduction.fallback import with_fallback
from vehiclemor.reduction.interface import MEMBERS, FittedModel, Method, OfflineCost
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, Settings
from vehiclemor.reduction.training import Training, difference
from vehiclemor.registry import choice
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import STATUSES, Start, Trajectory


def validated(
    method: Method,
    kind: str,
    given: Mapping[str, object],
    preset: str = "recommended",
    coordinates: int | None = None,
) -> Any:
    """All settings of a method: those given, else those of the preset, else the defaults.

    Of the number of the model's coordinates see `AT_MOST_COORDINATES`.  `InputError` if a name is
    not declared, or a value has the wrong kind or is out of bounds.
    """
    presets = method.presets_of(kind)
    choice(f"preset of {method.name}", preset, presets)
    declared = method.settings.get(kind, Settings)
    for name in given:
        if name in ("bounds", "trust") and name not in declared.model_fields:
            of = "vm.reduce(...).simulate() takes bounds and trust"
            raise InputError(f"{name} is no setting of {method.name}: {of}")
        choice(f"setting of {method.name}", name, declared.model_fields)
    chosen: dict[str, Any] = dict(presets[preset])
    with blamed(f"method {method.name!r}: settings", declared):
        for name, field in declared.model_fields.items():
            if coordinates is not None and AT_MOST_COORDINATES in field.metadata:
                chosen[name] = min(chosen.get(name, field.default), coordinates)
        try:
            return declared.model_validate(chosen | dict(given))
        except ValidationError as error:
            first = error.errors()[0]
            name = first["loc"][0] if first["loc"] else "settings"
            raise InputError(f"{method.name}: {name} {complaint(first)}") from None


def checked_settings(method: Method, model: Model, settings: Any) -> None:
    """Raise `InputError` if validated settings don't fit a model."""
    with blamed(f"method {method.name!r}: check", method.check):
        method.check(model, settings)


def fitted(method: Method, model: Model, training: Training, settings: Any) -> FittedModel:
    """What a method's `fit` gives, checked, with the fallback of the settings.

    `InputError` if it learns from runs and one of these is of another model, or `fit` refuses.
    """
    for run in training if method.learns_from == "runs" else ():
        if name := difference(model, run.model):
            raise InputError(
                f"{method.name} learns from runs of the model that it reduces alone: {name} of a "
                f"training run is another"
            )
    with blamed(f"method {method.name!r}: fit", method.fit):
        reduced = checked_fit(method.name, method.fit(model, training, settings))
    return with_fallback(reduced, model, settings)


def for_model(method: Method, reduced: FittedModel, model: Model, settings: Any) -> FittedModel:
    """What a method gives of a model with other parameters; `InputError` if it learns from runs."""
    remade, before = getattr(reduced, "for_model", None), getattr(reduced, "model", model)
    if method.learns_from == "runs" and (remade is None or difference(before, model)):
        raise InputError(
            f"{method.name} is trained on runs of one model: reduce that with the other parameters"
        )
    # Of a model with online parameters the others ask for a new fit.
    if remade is not None and not (model.definition.online and difference(before, model)):
        with blamed(f"method {method.name!r}: for_model", remade):
            return checked_fit(method.name, remade(model))
    return fitted(method, model, (), settings)


def checked_fit(method: str, reduced: Any) -> Any:
    """A reduced model; `PlugInError` if what `fit` gave is none."""
    for name in MEMBERS:
        if not hasattr(reduced, name):
            raise PlugInError(f"method {method!r}: fit: {quoted(reduced)} has no {name}")
    if not isinstance(reduced.offline, OfflineCost):
        raise PlugInError(
            f"method {method!r}: offline is {quoted(reduced.offline)}, no OfflineCost"
        )
    if not isinstance(reduced.order, int | np.integer):
        raise PlugInError(f"method {method!r}: order is {quoted(reduced.order)}, no whole number")
    return reduced


def checked_run(model: Model, maneuver: Excitation, start: Start, reduced: Any) -> Trajectory:
    """A run of a reduced model at the output times; `PlugInError` if it gives none."""
    whose = f"{type(reduced).__module__}.{type(reduced).__name__}: simulate"
    with blamed(whose, reduced):
        run = reduced.simulate(maneuver, start)
    whose += " gives"
    if not isinstance(run, Trajectory):
        raise PlugInError(f"{whose} {quoted(run)}, no Trajectory")
    columns = {name: (len(getattr(model, name)),) for name in (*STATE_KINDS, "outputs")}
    for name, size in {"times": (), **columns}.items():
        shape = (maneuver.samples, *size)
        values = np.asarray(getattr(run, name))
        if values.shape != shape or values.dtype != float:
            of_type = f"{values.shape} of {values.dtype}"
            raise PlugInError(f"{whose} {name} {of_type}, not {shape} floats")
    if run.status not in STATUSES or not isinstance(run.seconds, float | int):
        raise PlugInError(f"{whose} status {run.status!r} and seconds {quoted(run.seconds)}")
    if not isinstance(run.counts, Mapping):
        raise PlugInError(f"{whose} counts {quoted(run.counts)}, not numbers by name")
    return run
