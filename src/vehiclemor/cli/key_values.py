"""Options that are given as key=value, several times."""

from collections.abc import Iterable

from vehiclemor.errors import InputError


def key_values(option: str, given: Iterable[str]) -> dict[str, object]:
    """Key -> an integer, a number or text; numbers separated by commas are a list.

    Raises
    ------
    InputError
        If something is not key=value, or a key is given twice.
    """
    found: dict[str, object] = {}
    for text in given:
        key, separator, value = text.partition("=")
        if not separator or not key:
            raise InputError(f"{option} {text!r} is not key=value")
        if key in found:
            raise InputError(f"{option} {key} is given twice")
        found[key] = parsed(value)
    return found


def parsed(text: str) -> object:
    """An integer, a number, a list of numbers separated by commas, or text."""
    for kind in (int, float, _numbers):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]
