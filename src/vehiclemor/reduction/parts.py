"""A reduced model as plain parts, and made of them again: numbers, texts, arrays by name.

What a method's `fit` gives is a tree of dataclasses and named tuples.  It is written field by
field; the full-order model and its system are only referred to.  What is read can name the classes
of this package that check their sizes, see `sizes`, and those of a plug-in that is in use, and
nothing else.  Operations of kernels are arrays of numbers: no text becomes Python.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from types import UnionType
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.array_shapes import require
from vehiclemor.codegen.operations import Operation, as_arrays, of_arrays
from vehiclemor.exceptions import InputError
from vehiclemor.registry import GROUPS
from vehiclemor.simulation.model import Model

# Where the classes are that may be parts of reduced models.
ROOMS = ("vehiclemor.reduction.", "vehiclemor.simulation.")
# Parts that a model may have, each counted wherever it is meant: those of this package have 20,000.
MOST_PARTS = 500_000
# Types of arrays, and as what they are stored.
STORED = {"float64": "f8", "int64": "i8", "bool": "i1", "complex128": "f8"}


class Writer:
    """Takes a reduced model of a full-order one apart; `arrays` are by place."""

    def __init__(self, model: Model) -> None:
        self.arrays: dict[str, np.ndarray] = {}
        self._known: dict[int, tuple[Any, Any]] = {id(model): (model, {"model": ""})}
        if (system := getattr(model, "system", None)) is not None:
            self._known[id(system)] = system, {"model": "system"}

    def part(self, value: Any, place: str) -> Any:
        """A value as JSON has it, its arrays apart; `InputError` if it can't be written."""
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.bool_ | np.integer | np.floating):
            return value.item()
        if id(value) in self._known:
            return self._known[id(value)][1]
        found = self._described(value, place)
        # Kept with it: the number of an object that is no more may be another's.
        self._known[id(value)] = value, found if "array" in found else {"same": place}
        return found

    def _described(self, value: Any, place: str) -> dict[str, Any]:
        kind = type(value)
        if isinstance(value, np.ndarray) and value.dtype.name in STORED:
            return self._array(value, place)
        if names := _fields(kind):
            name = _name(value, place)
            fields = {name: self.part(getattr(value, name), f"{place}.{name}") for name in names}
            return {"class": name, "fields": fields}
        if kind is tuple and value and isinstance(value[0], Operation):
            arrays = as_arrays([*value])
            return {"operations": {n: self._array(a, f"{place}.{n}") for n, a in arrays.items()}}
        if kind in (tuple, list):
            items = [self.part(item, f"{place}.{i}") for i, item in enumerate(value)]
            return {kind.__name__: items}
        if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            return {"mapping": {key: self.part(v, f"{place}.{key}") for key, v in value.items()}}
        raise _unwritable(place, value)

    def _array(self, value: np.ndarray, place: str) -> dict[str, Any]:
        # Products of matrices are rounded as their numbers stand in memory.
        turned = value.ndim > 1 and value.flags.f_contiguous and not value.flags.c_contiguous
        value = value.T if turned else value
        kind, shape, stored = value.dtype.name, value.shape, np.ascontiguousarray(value)
        stored = stored.view(float).reshape(*shape, 2) if kind == "complex128" else stored
        self.arrays[place] = stored.astype(STORED[kind])
        return {"array": place, "type": kind, "shape": list(shape), "turned": turned}


class Reader:
    """Makes a reduced model of its parts, and of the full-order model that these refer to."""

    def __init__(self, model: Model, arrays: Mapping[str, np.ndarray]) -> None:
        self._model, self._arrays = model, arrays
        # Place -> what is made there, and of how many parts it is.
        self._made: dict[str, tuple[Any, int]] = {}
        self._count = 0

    def value(self, part: Any, place: str) -> Any:
        """What a part stands for; it raises various errors if that is nothing, or does not fit."""
        before = self._count
        self._count += 1
        if not isinstance(part, dict):
            return part
        if "same" in part:
            made, count = self._made[part["same"]]
            self._count += count
            if self._count > MOST_PARTS:
                raise ValueError(f"{place} has too many parts")
            return made
        made = self._of_kind(part, place)
        self._made[place] = made, self._count - before
        return made

    def _of_kind(self, part: dict[str, Any], place: str) -> Any:
        match part:
            case {"array": name}:
                return self._array(self._arrays[name], part)
            case {"model": ""}:
                return self._model
            case {"model": "system" as name}:
                return getattr(self._model, name)
            case {"class": name, "fields": fields}:
                kind = named(name)
                made = kind(**{key: self.value(v, f"{place}.{key}") for key, v in fields.items()})
                _check(made)
                return made
            case {"operations": arrays}:
                return of_arrays(
                    *(self.value(arrays[n], place) for n in ("kinds", "arguments", "numbers"))
                )
            case {"tuple": items}:
                return tuple(self.value(item, f"{place}.{i}") for i, item in enumerate(items))
            case {"list": items}:
                return [self.value(item, f"{place}.{i}") for i, item in enumerate(items)]
            case {"mapping": items}:
                return {key: self.value(item, f"{place}.{key}") for key, item in items.items()}
        raise ValueError(f"{quoted(part)} is no part of a model")

    def _array(self, stored: np.ndarray, part: dict[str, Any]) -> np.ndarray:
        stored = np.ascontiguousarray(stored, dtype=STORED[part["type"]]).ravel()
        complex_pairs = part["type"] == "complex128"
        found = stored.view(complex) if complex_pairs else stored.astype(part["type"])
        if not all(type(size) is int and size >= 0 for size in part["shape"]):
            raise ValueError(f"{quoted(part['shape'])} is no shape")
        found = found.reshape(part["shape"])
        return found.T if part["turned"] else found


def named(name: str) -> Any:
    """The dataclass or named tuple `module:name` that checks its sizes, or is of a plug-in.

    `ValueError` if it is anything else.
    """
    module, _, own = name.partition(":")
    # Of plug-ins only what is in use already: reading a file imports nothing of theirs.
    known = module.partition(".")[0] in _plug_ins()
    if module.startswith(ROOMS):
        with suppress(ImportError):
            import_module(module)
    found = getattr(sys.modules.get(module), own, None)
    known = known or (module.startswith(ROOMS) and hasattr(found, "check_sizes"))
    if not (known and _fields(found) and found.__module__ == module):
        raise ValueError(f"there is no {name}")
    return found


@cache
def _plug_ins() -> set[str]:
    """Top-level packages with methods, besides this one."""
    tops = {entry.module.partition(".")[0] for entry in entry_points(group=GROUPS["method"])}
    return tops - {"vehiclemor"}


def _fields(kind: Any) -> tuple[str, ...]:
    """Names of the fields of a dataclass or named tuple; none of anything else."""
    if not isinstance(kind, type):
        return ()
    if dataclasses.is_dataclass(kind):
        return tuple(f.name for f in dataclasses.fields(kind) if f.init)
    return getattr(kind, "_fields", ()) if issubclass(kind, tuple) else ()


def _name(value: Any, place: str) -> str:
    """`module:name` by which its class is found again."""
    name = f"{type(value).__module__}:{type(value).__qualname__}"
    with suppress(ValueError):
        if named(name) is type(value):
            return name
    raise _unwritable(place, value)


def _unwritable(place: str, value: Any) -> InputError:
    return InputError(f"it can't be saved: {place} is {quoted(value)}")


def _check(part: Any) -> None:
    """Raise `ValueError` if a part is not what others will take it for."""
    if type(part).__module__.startswith("vehiclemor."):
        for name, kind in _declared(type(part)).items():
            require(_is(getattr(part, name), kind), name)
    # A plug-in's class may be made of one of ours.
    if hasattr(part, "check_sizes"):
        part.check_sizes()


@cache
def _declared(kind: type) -> Mapping[str, Any]:
    """Fields of a dataclass or a named tuple, with their types."""
    hints = get_type_hints(kind)
    return {name: of for name, of in hints.items() if get_origin(of) is not ClassVar}


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is of a declared type; what is made of others is of it in all its parts."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return any(_is(value, one) for one in inner)
    if origin is tuple and inner[-1:] != (...,):
        fits = isinstance(value, tuple) and len(value) == len(inner)
        return fits and all(map(_is, value, inner))
    if origin in (tuple, list):
        return isinstance(value, origin) and all(_is(part, inner[0]) for part in value)
    if origin in (dict, Mapping):
        return isinstance(value, Mapping) and all(_is(v, inner[1]) for v in value.values())
    if origin is Callable:
        return False
    if kind is Any or getattr(kind, "_is_protocol", False):
        return True
    # A truth value is a whole number to Python, and that is a float to the type's author.
    wider = (float, int) if kind is float else kind
    return isinstance(value, wider) and (kind is bool or not isinstance(value, bool))
