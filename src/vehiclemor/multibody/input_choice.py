"""Optional inputs of a model: which ones a run drives, which ones are parameters instead."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError, did_you_mean
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import InputChoice, integral_of
from vehiclemor.parameters import Declared


def driving(definition: ModelDefinition, names: Iterable[str]) -> ModelDefinition:
    """The declaration with the optional inputs among these names as inputs too.

    With the height of a road its rate is driven.  An input that was a parameter is driven then.
    """
    named = {*names}
    driven = {*definition.choice.driven, *named}
    driven |= {q.name for q in definition.optional_inputs if integral_of(q.name) in named}
    constant = {*definition.choice.constant} - driven
    return _chosen(definition, _ordered(definition, driven), _ordered(definition, constant))


def with_overrides(definition: ModelDefinition, overrides: Mapping[str, object]) -> ModelDefinition:
    """The declaration in which each optional input with a value here is a parameter."""
    if not isinstance(overrides, Mapping):
        raise InputError(f"parameters must be a mapping of values by name, not {quoted(overrides)}")
    names = {quantity.name for quantity in definition.optional_inputs}
    return with_constants(definition, names.intersection(overrides))


def with_constants(definition: ModelDefinition, names: Iterable[str]) -> ModelDefinition:
    """The declaration with optional inputs as parameters; `InputError` if there is none such."""
    optional = {quantity.name for quantity in definition.optional_inputs}
    for name in names:
        if name not in optional:
            known = ", ".join(sorted(optional)) or "none"
            hint = did_you_mean(name, optional) or f"optional inputs: {known}"
            raise InputError(f"{name!r} is not an optional input of {definition.name}; {hint}")
    constant = {*definition.choice.constant, *names}
    driven = (name for name in definition.choice.driven if name not in constant)
    return _chosen(definition, _ordered(definition, driven), _ordered(definition, constant))


def _ordered(definition: ModelDefinition, names: Iterable[str]) -> tuple[str, ...]:
    chosen = {*names}
    return tuple(q.name for q in definition.optional_inputs if q.name in chosen)


@lru_cache(maxsize=64)
def _chosen(
    definition: ModelDefinition, driven: tuple[str, ...], constant: tuple[str, ...]
) -> ModelDefinition:
    """The declaration of a choice; the same object for the same arguments, as caches need it."""
    choice = InputChoice(driven, constant)
    if choice == definition.choice:
        return definition
    optional = {quantity.name: quantity for quantity in definition.optional_inputs}
    every_run = (quantity for quantity in definition.inputs if quantity.name not in optional)
    parameters = {
        name: declared for name, declared in definition.parameters.items() if name not in optional
    }
    for name in constant:
        low, high = definition.validity.get(name, (None, None))
        quantity = optional[name]
        parameters[name] = Declared(
            quantity.unit, at_least=low, at_most=high, default=quantity.default
        )
    return replace(
        definition,
        inputs=(*every_run, *(optional[name] for name in driven)),
        parameters=parameters,
        choice=choice,
    )
