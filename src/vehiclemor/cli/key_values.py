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
        found[key] = _parsed(value)
    return found


def _parsed(text: str) -> object:
    for kind in (int, float, lambda listed: [float(number) for number in listed.split(",")]):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
