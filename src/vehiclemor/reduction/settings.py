"""Settings of methods: declared with kind, default and bounds, validated at the border."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.registry import unknown

Value = int | float | str
LARGEST_NUMBER = 1e300


@dataclass(frozen=True)
class Setting:
    """One named setting of a method.

    Attributes
    ----------
    kind
        `integer`, `number`, or `text` (one of `choices`, any text if there are none).
    default
        Value where the user names none.
    doc
        One line: meaning and unit.
    minimum
        Smallest allowed number; `above` if it is itself not allowed.
    """

    kind: Literal["integer", "number", "text"]
    default: Value
    doc: str
    minimum: float | None = None
    above: bool = False
    choices: tuple[str, ...] = ()


def validated(
    method: str,
    declared: Mapping[str, Setting],
    given: Mapping[str, object],
    defaults: Mapping[str, Value] | None = None,
) -> dict[str, Value]:
    """All settings of a method: given values checked, the others at their defaults.

    Raises
    ------
    InputError
        If a name is not declared, or a value has the wrong kind or is out of bounds.
    """
    for name in given:
        if name not in declared:
            raise unknown(f"setting of {method}", name, declared)
    settings: dict[str, Value] = {}
    for name, setting in declared.items():
        start = (defaults or {}).get(name, setting.default)
        settings[name] = _checked(f"{method}: {name}", setting, given.get(name, start))
    return settings


def parsed(text: str) -> object:
    """A value from the command line: an integer, a number or text."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _checked(where: str, setting: Setting, value: object) -> Value:
    if setting.kind == "text":
        if not isinstance(value, str) or (setting.choices and value not in setting.choices):
            allowed = ", ".join(setting.choices) or "text"
            raise InputError(f"{where} is {value!r}; allowed: {allowed}")
        return value
    if isinstance(value, np.integer | np.floating):
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} is {value!r}, not {_a(setting.kind)}")
    if abs(value) > LARGEST_NUMBER and abs(value) != math.inf:
        raise InputError(f"{where} is beyond +-{LARGEST_NUMBER:g}")
    if not math.isfinite(value):
        raise InputError(f"{where} is {value}, not finite")
    if setting.kind == "integer":
        if value != int(value):
            raise InputError(f"{where} is {value!r}, not an integer")
        value = int(value)
    else:
        value = float(value)
    if setting.minimum is not None and (
        value < setting.minimum or (setting.above and value == setting.minimum)
    ):
        bound = "above" if setting.above else "at least"
        raise InputError(f"{where} is {value:g}; it must be {bound} {setting.minimum:g}")
    return value


def _a(kind: str) -> str:
    return "an integer" if kind == "integer" else "a number"
