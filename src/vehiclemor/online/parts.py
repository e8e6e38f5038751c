"""A reduced model as plain parts, and made of them again: numbers, texts, arrays by name.

What a method's `fit` gives is a tree of dataclasses and named tuples.  It is written field by
field; the full-order model, and what is the model's own, is only referred to.  What is read can
name the classes and functions that are listed here, or those of a plug-in that is in use, and
nothing else: no text becomes Python.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.codegen.foreign_texts import check_kernel
from vehiclemor.codegen.kernels import Kernels, kernel_sources, kernel_texts
from vehiclemor.errors import InputError
from vehiclemor.online.bounds import check
from vehiclemor.registry import GROUPS
from vehiclemor.simulation.model import Model

# Where the classes and functions are that are parts of reduced models; `bounds` checks their sizes.
ROOMS = ("vehiclemor.reduction.", "vehiclemor.simulation.", "vehiclemor.study.input_range")
PARTS = (
    *("AlgebraicProjection", "Basis", "Cells", "DynamicProjection", "Features"),
    *("FullOrderModel", "GuardedModel", "InputRange", "Offline"),
    *("PathMapModel", "ProjectionWindows", "ReducedSystem"),
    *("ReducedVehicle", "ReplayModel", "System", "TrainingReach", "Trajectory", "Transient"),
    *("Trust", "VehicleShape", "_nothing_told", "_own_path", "_same_state"),
)
# Methods that are.
METHODS = ("encode", "lift", "judge", "slopes")
# Parts that a model may have, each counted wherever it is meant: those of this package have 20,000.
MOST_PARTS = 500_000
# What of a model may be a part of a reduced one.
OWN = ("system", "kernels")
# Types of arrays, and as what they are stored.
STORED = {"float64": "f8", "int64": "i8", "bool": "i1", "complex128": "f8"}


class Writer:
    """Takes a reduced model of a full-order one apart.

    Attributes
    ----------
    arrays
        Place -> array, of floats or whole numbers.
    """

    def __init__(self, model: Model) -> None:
        self.arrays: dict[str, np.ndarray] = {}
        self._known: dict[int, tuple[Any, Any]] = {id(model): (model, {"model": ""})}
        for name in OWN:
            if (own := getattr(model, name, None)) is not None:
                self._known[id(own)] = own, {"model": name}
        self._own_sources = model.kernels.sources

    def part(self, value: Any, place: str) -> Any:
        """A value as JSON has it; its arrays apart.

        Raises
        ------
        InputError
            If it is nothing that can be written, or in it there is such a thing.
        """
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
        if isinstance(value, Kernels):
            if value.sources == self._own_sources:
                return {"model": "kernels"}
            text = "\n".join(s.text for s in value.sources.values())
            with suppress(ValueError):
                kernels_of(text)
                return {"kernels": text}
            raise _unwritable(place, value)
        if names := _fields(kind):
            fields = {name: self.part(getattr(value, name), f"{place}.{name}") for name in names}
            return {"class": _name(value, kind, place), "fields": fields}
        if kind in (tuple, list):
            items = [self.part(item, f"{place}.{i}") for i, item in enumerate(value)]
            return {kind.__name__: items}
        if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            return {"mapping": {key: self.part(v, f"{place}.{key}") for key, v in value.items()}}
        if inspect.ismethod(value) and value.__name__ in METHODS and _fields(type(value.__self__)):
            return {"method": value.__name__, "of": self.part(value.__self__, f"{place}.of")}
        if inspect.isfunction(value):
            return {"function": _name(value, value, place)}
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
    """Makes a reduced model of its parts.

    Parameters
    ----------
    model
        The full-order model that it refers to.
    arrays
        As the writer has left them.
    """

    def __init__(self, model: Model, arrays: Mapping[str, np.ndarray]) -> None:
        self._model, self._arrays = model, arrays
        # Place -> what is made there, and of how many parts it is.
        self._made: dict[str, tuple[Any, int]] = {}
        self._count = 0

    def value(self, part: Any, place: str) -> Any:
        """What a part stands for.

        Raises
        ------
        KeyError, TypeError, ValueError, AttributeError
            If it stands for nothing, or does not fit the rest.
        """
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
        if "model" not in part:
            check(made, self._model)
        self._made[place] = made, self._count - before
        return made

    def _of_kind(self, part: dict[str, Any], place: str) -> Any:
        match part:
            case {"array": name}:
                return self._array(self._arrays[name], part)
            case {"model": ""}:
                return self._model
            case {"model": name} if name in OWN:
                return getattr(self._model, name)
            case {"kernels": text}:
                return kernels_of(text)
            case {"class": name, "fields": fields}:
                made = named(name)
                # What has a default may have come since.
                if not _required(made) <= set(fields) <= set(_fields(made)):
                    raise ValueError(f"{name} has other fields here")
                return made(**{key: self.value(v, f"{place}.{key}") for key, v in fields.items()})
            case {"tuple": items}:
                return tuple(self.value(item, f"{place}.{i}") for i, item in enumerate(items))
            case {"list": items}:
                return [self.value(item, f"{place}.{i}") for i, item in enumerate(items)]
            case {"mapping": items}:
                return {key: self.value(item, f"{place}.{key}") for key, item in items.items()}
            case {"method": name, "of": of}:
                owner = self.value(of, f"{place}.of")
                if name not in METHODS or not inspect.isfunction(getattr(type(owner), name)):
                    raise ValueError(f"{name} is no method")
                return getattr(owner, name)
            case {"function": name} if inspect.isfunction(found := named(name)):
                return found
        raise ValueError(f"{quoted(part)} is no part of a model")

    def _array(self, stored: np.ndarray, part: dict[str, Any]) -> np.ndarray:
        stored = np.ascontiguousarray(stored, dtype=STORED[part["type"]]).ravel()
        complex_pairs = part["type"] == "complex128"
        found = stored.view(complex) if complex_pairs else stored.astype(part["type"])
        if not all(type(size) is int and size >= 0 for size in part["shape"]):
            raise ValueError(f"{quoted(part['shape'])} is no shape")
        found = found.reshape(part["shape"])
        return found.T if part["turned"] else found


def kernels_of(text: str) -> Kernels:
    """Kernels of a text, which is decided on before anything of it is compiled.

    Raises
    ------
    ValueError
        If one of them is not allowed.
    """
    for part in kernel_texts(text):
        check_kernel(part)
    return Kernels(kernel_sources(text))


def named(name: str) -> Any:
    """The dataclass, named tuple or function `module:name` of `PARTS` or of a plug-in.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    module, _, own = name.partition(":")
    if module.startswith(ROOMS):
        with suppress(ImportError):
            import_module(module)
        own = own if own in PARTS else ""
    # Of plug-ins only what is in use already: reading a file imports nothing of theirs.
    elif module.partition(".")[0] not in _plug_ins():
        module = ""
    found = getattr(sys.modules.get(module), own, None)
    fitting = inspect.isfunction(found) or _fields(found)
    if not fitting or getattr(found, "__module__", "") != module:
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


def _required(kind: type) -> set[str]:
    """Names of those without a default."""
    if not dataclasses.is_dataclass(kind):
        return {*_fields(kind)} - {*getattr(kind, "_field_defaults", ())}
    missing = dataclasses.MISSING
    given = (f for f in dataclasses.fields(kind) if f.init)
    return {f.name for f in given if f.default is missing and f.default_factory is missing}


def _name(value: Any, definition: Any, place: str) -> str:
    """`module:name` by which a class or a function is found again."""
    name = f"{definition.__module__}:{definition.__qualname__}"
    try:
        found = named(name)
    except ValueError:
        found = None
    if found is not definition:
        raise _unwritable(place, value)
    return name


def _unwritable(place: str, value: Any) -> InputError:
    return InputError(f"it can't be saved: {place} is {quoted(value)}")
