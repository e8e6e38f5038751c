"""The border where settings come in: one clear line for whatever is wrong with them."""

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from vehiclemor.errors import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import Settings
from vehiclemor.registry import unknown


def validated(
    method: Method, kind: str, given: Mapping[str, object], preset: str = "recommended"
) -> Any:
    """All settings of a method: those given, else those of the preset, else the defaults.

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
    if preset not in presets:
        raise unknown(f"preset of {method.name}", preset, presets)
    declared = method.settings.get(kind, Settings)
    for name in given:
        if name not in declared.model_fields:
            raise unknown(f"setting of {method.name}", name, declared.model_fields)
    try:
        return declared.model_validate({**presets[preset], **given})
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{method.name}: {first['loc'][0]} {_wrong(first)}") from None


def _wrong(error: Any) -> str:
    """What is wrong with a value, in the words of this package."""
    value, limits = error["input"], error.get("ctx", {})
    words: dict[str, Callable[[], str]] = {
        "greater_than_equal": lambda: f"is {value:g}; it must be at least {limits['ge']:g}",
        "greater_than": lambda: f"is {value:g}; it must be above {limits['gt']:g}",
        "less_than_equal": lambda: f"is {value:g}; it must be at most {limits['le']:g}",
        "int_type": lambda: f"is {value!r}, not an integer",
        "float_type": lambda: f"is {value!r}, not a number",
        "string_type": lambda: f"is {value!r}; allowed: text",
        "literal_error": lambda: f"is {value!r}; allowed: {_listed(limits['expected'])}",
    }
    return words.get(error["type"], lambda: error["msg"].removeprefix("Value error, "))()


def _listed(expected: str) -> str:
    """Pydantic's "'a', 'b' or 'c'" as "a, b, c"."""
    return expected.replace(" or ", ", ").replace("'", "")
