"""Optional inputs of a model: which ones a run drives, which ones are parameters instead."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from vehiclemor.exceptions import InputError, did_you_mean
from vehiclemor.parameters import Declared

if TYPE_CHECKING:
    from vehiclemor.multibody.definition import ModelDefinition


@dataclass(frozen=True)
class InputChoice:
    """Optional inputs of a run in declared order; those in neither tuple are their defaults.

    Attributes
    ----------
    driven
        Inputs that change with time.
    constant
        Inputs whose values are parameters of the model.
    """

    driven: tuple[str, ...] = ()
    constant: tuple[str, ...] = ()


DEFAULTS = InputChoice()


def driving(definition: ModelDefinition, names: Iterable[str]) -> ModelDefinition:
    """The declaration whose inputs are those of every run, and the optional ones among the names.

    Optional inputs that were parameters stay parameters if they are not named.
    """
    names = set(names)
    constant = (name for name in definition.choice.constant if name not in names)
    return _chosen(definition, _ordered(definition, names), _ordered(definition, constant))


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
