"""Models, methods and maneuvers by entry point: built-ins and plug-ins register the same way.

An entry point of the group `vehiclemor.models` names a `ModelDefinition`, one of
`vehiclemor.methods` a `Method`, one of `vehiclemor.maneuvers` a `Maneuver`.  A component that has a
function `member` is a family: `NAME:NUMBER` is what it gives for the number.
"""

import re
from collections.abc import Collection, Iterable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any
from warnings import warn

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError, PlugInError, blame, blamed, did_you_mean

# Class of the components of a kind, named as in an entry point: most stand in a layer above.
CLASSES = {
    "model": "vehiclemor.multibody.definition:ModelDefinition",
    "method": "vehiclemor.reduction.interface:Method",
    "maneuver": "vehiclemor.inputs.maneuver:Maneuver",
}
# Groups of entry points.
GROUPS = {kind: f"vehiclemor.{kind}s" for kind in CLASSES}
# One name for each member.  No number has more digits.
FAMILY = re.compile(r"([^:]+):(0|[1-9][0-9]{0,17})")


def names(kind: str) -> list[str]:
    """Registered names of a kind (`model`, `method` or `maneuver`), sorted."""
    return sorted(_entries(kind))


def component(kind: str, name: str) -> Any:
    """The registered component; `InputError`, with the nearest names, if none has the name.

    `PlugInError` if it is a plug-in that can't be imported, or is something else.
    """
    entries = _entries(kind)
    if isinstance(name, str) and name not in entries and (family := FAMILY.fullmatch(name)):
        return _member(kind, *family.groups())
    choice(kind, name, entries)
    where = f"{kind} {name!r} ({entries[name].value})"
    try:
        loaded = entries[name].load()
    # A module may even end the interpreter.
    except BaseException as error:
        raise blame(f"{where} can't be imported", entries[name].module, error) from error
    wanted = _class(kind)
    if not isinstance(loaded, wanted):
        class_name = type(loaded).__name__
        raise PlugInError(f"{where} is of type {class_name}: it must be a {wanted.__name__}")
    # Models are built again by name.
    if kind == "model" and loaded.name != name:
        raise PlugInError(f"{where} names itself {quoted(loaded.name)}: it must be the same name")
    return loaded


def _member(kind: str, base: str, number: str) -> Any:
    family, name = component(kind, base), f"{base}:{number}"
    make = getattr(family, "member", None)
    if not callable(make):
        raise InputError(f"unknown {kind} {quoted(name)}; {base} is no family: it has no members")
    where = f"{kind} {name!r} ({_entries(kind)[base].value})"
    with blamed(where, make):
        member = make(int(number))
    wanted = _class(kind)
    if not isinstance(member, wanted) or getattr(member, "name", "") != name:
        raise PlugInError(f"{where} is {quoted(member)}: it must be a {wanted.__name__} {name!r}")
    return member


def choice(kind: str, name: Any, known: Collection[str]) -> str:
    """The name; `InputError` if it is none of the known ones."""
    if isinstance(name, str) and name in known:
        return name
    raise unknown(kind, name, known)


def unknown(kind: str, name: object, known: Iterable[str]) -> InputError:
    """Error for an unknown name, with the nearest known ones."""
    return InputError(f"unknown {kind} {quoted(name)}; {did_you_mean(name, known)}")


@cache
def _class(kind: str) -> type:
    return EntryPoint(kind, CLASSES[kind], "").load()


@cache
def _entries(kind: str) -> dict[str, EntryPoint]:
    choice("kind of component", kind, GROUPS)
    entries: dict[str, EntryPoint] = {}
    registered = entry_points(group=GROUPS[kind])
    # Built-ins come last: no plug-in takes the name of one away.
    for entry in sorted(registered, key=lambda entry: entry.value.startswith("vehiclemor.")):
        other = entries.get(entry.name, entry).value
        if other != entry.value:
            why = f"{other} is left out, since {entry.value} has this name"
            warn(f"{kind} {entry.name!r}: {why}", stacklevel=2)
        entries[entry.name] = entry
    return entries
