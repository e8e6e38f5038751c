"""Measured numbers by name, and texts that hold them as `{{ n("NAME", ".1e") }}`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jinja2

FILE = Path(__file__).with_name("numbers.json")
# 4.9e-07 is printed as 4.9e-7.
EXPONENT = re.compile(r"e([+-])0*(\d)")
Entries = Mapping[str, Mapping[str, Any]]


def load(path: Path = FILE) -> dict[str, dict[str, Any]]:
    """All numbers: name -> value, unit, source, command."""
    return json.loads(path.read_text(encoding="utf-8"))


def shown(value: float, form: str) -> str:
    """A number as texts print it, by a format specification of Python."""
    text = f"{round(value) if form == 'd' else value:{form}}"
    return EXPONENT.sub(lambda match: "e" + match[1].replace("+", "") + match[2], text)


def render(text: str, numbers: Entries | None = None, name: str = "text") -> str:
    """A text with its numbers; a missing one raises, and is named with the text."""
    entries = load() if numbers is None else numbers

    def n(key: str, form: str = "") -> float | str:
        if key not in entries:
            raise KeyError(f"{name}: no number {key!r}; `python paper/measured_numbers.py --list`")
        value = entries[key]["value"]
        return shown(value, form) if form else value

    return _rendered(text, n)


def names_in(text: str) -> set[str]:
    """Names of the numbers that a text asks for."""
    names: set[str] = set()

    def n(key: str, form: str = "") -> float | str:
        names.add(key)
        return shown(2.0, form) if form else 2.0

    _rendered(text, n)
    return names


def _rendered(text: str, n: Callable[..., float | str]) -> str:
    environment = jinja2.Environment(  # noqa: S701 - Markdown of this repository, no HTML
        undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    return environment.from_string(text, globals={"n": n, "shown": shown}).render()
