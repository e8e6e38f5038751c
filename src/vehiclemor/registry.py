"""Models, methods and maneuvers by entry point: built-ins and plug-ins register the same way.

An entry point of the group `vehiclemor.models` or `vehiclemor.methods` names a module, one of
`vehiclemor.maneuvers` a `Maneuver`.
"""

import difflib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from vehiclemor.errors import InputError

GROUPS = {
    "model": "vehiclemor.models",
    "method": "vehiclemor.methods",
    "maneuver": "vehiclemor.maneuvers",
}


def names(kind: str) -> list[str]:
    """Registered names of a kind (`model`, `method` or `maneuver`), sorted."""
    return sorted(_entries(kind))


def component(kind: str, name: str) -> Any:
    """The registered component.

    Raises
    ------
    InputError
        If no component of that kind has the name (the nearest names are listed), or if it is a
        plug-in that can't be imported.
    """
    entries = _entries(kind)
    if name not in entries:
        raise unknown(kind, name, entries)
    try:
        return entries[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"{kind} {name!r} ({entries[name].value}) can't be imported: {error}"
        ) from error


def unknown(kind: str, name: object, known: Iterable[str]) -> InputError:
    """Error for an unknown name, with the nearest known ones."""
    known = sorted(known)
    near = difflib.get_close_matches(str(name), known, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(known)}"
    return InputError(f"unknown {kind} {str(name)!r}; {hint}")


@cache
def _entries(kind: str) -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUPS[kind])}
