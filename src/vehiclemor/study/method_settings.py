"""Settings of methods as studies store them: plain values by name, complete and validated."""

from collections.abc import Mapping
from typing import Any

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import Value
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model

Settings = dict[str, Value]


def complete_settings(
    model: Model,
    method_name: str,
    given: Mapping[str, object] | None = None,
    preset: str = "recommended",
) -> Settings:
    """All settings of a method for a model, validated.

    That a method refuses a model is a result: what was set for a model of another kind can't be
    judged here, and nothing is set.

    Raises
    ------
    InputError
        If the preset, a name or a value is wrong.
    """
    method: Method = component("method", method_name)
    if not method.accepts(model)[0]:
        return {}
    coordinates = len(model.coordinates)
    return validated(method, model.kind, given or {}, preset, coordinates).model_dump()


def for_method(model: Model, method_name: str, settings: Settings) -> Any:
    """Complete settings as `check` and `fit` of the method take them."""
    return validated(component("method", method_name), model.kind, settings)


def default_settings(model: Model, method_name: str) -> Settings:
    """Declared names and defaults; none for a kind of model that the method doesn't know."""
    method: Method = component("method", method_name)
    if model.kind not in method.settings:
        return {}
    return {name: field.default for name, field in method.settings[model.kind].model_fields.items()}
