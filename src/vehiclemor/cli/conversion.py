"""How the text of an option becomes its value: more strictly than the command-line library does."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from cyclopts import Token, convert

from vehiclemor.errors import InputError


def strict(wanted: Any, tokens: Sequence[Token]) -> Any:
    """Value of an option; 1.5 is no integer, and an empty text no path.

    Raises
    ------
    InputError
        If the text is another kind of value.
    """
    for token in tokens:
        name, text = token.keyword or "argument", token.value
        if wanted is int and not text.strip().removeprefix("-").isdecimal():
            raise InputError(f"{name}: {text!r} is not a whole number")
        if Path in (wanted, *get_args(wanted)) and (not text or "\0" in text):
            raise InputError(f"{name}: {text!r} is not a path")
    return convert(wanted, tokens)
