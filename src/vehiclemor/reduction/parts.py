"""A reduced model as JSON and arrays, and read from them again, by the declared types of fields.

What a method's `fit` gives is a tree of dataclasses and named tuples.  A field is written as its
declared type says, and read as that; where a type leaves the class open, as of the root, its name
is written too.  The full-order model and its system are only referred to.  A file can name the
classes of this package that check their sizes, see `sizes`, and those of a plug-in that is in use,
and nothing else.  Operations of kernels are arrays of numbers: no text becomes Python.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from vehiclemor.arguments import quoted, require
from vehiclemor.codegen.operations import Operation, as_arrays, of_arrays
from vehiclemor.exceptions import InputError
from vehiclemor.registry import GROUPS
from vehiclemor.simulation.model import Model

# Where the classes are that may be parts of reduced models.
ROOMS = ("vehiclemor.reduction.", "vehiclemor.simulation.")
# Types of arrays, and as what they are stored.
STORED = {"float64": "f8", "int64": "i8", "bool": "i1", "complex128": "f8"}
SCALARS = (bool, int, float, str, type(None))
OPERATIONS = tuple[Operation, ...]
OPERATION_ARRAYS = ("kinds", "arguments", "numbers")
# Keys that no field has.
ARRAY, CLASS, REFERENCE = "@array", "@class", "@full"


class Parts:
    """Writes and reads the parts of a reduced model; the arrays stand beside them, by path."""

    def __init__(self, model: Model, arrays: Mapping[str, np.ndarray] | None = None) -> None:
        self.arrays = dict(arrays or {})
        self._full = {"model": model, "system": getattr(model, "system", None)}

    def write(self, value: Any, path: str, declared: Any = Any) -> Any:
        """A value as JSON, its arrays aside; `InputError` if it can't be written."""
        if isinstance(value, np.bool_ | np.integer | np.floating):
            value = value.item()
        kind = type(value)
        try:
            choice = _chosen(_choices(declared), kind, path)
        except ValueError:
            raise _unwritable(path, value) from None
        if kind in SCALARS:
            return value
        for name, full in self._full.items():
            if value is full:
                return {REFERENCE: name}
        if kind is np.ndarray and value.dtype.name in STORED:
            return self._write_array(value, path)
        if choice == OPERATIONS:
            arrays = as_arrays(value)
            return {name: self._write_array(arrays[name], f"{path}.{name}") for name in arrays}
        if types := _fields(kind):
            fields: dict[str, Any] = {}
            if kind is not _record(declared):
                fields[CLASS] = _name(value, path)
            for name, of in types.items():
                fields[name] = self.write(getattr(value, name), f"{path}.{name}", of)
            return fields
        if kind in (tuple, list) and len(types := _item_types(choice, len(value))) == len(value):
            items = enumerate(zip(value, types, strict=True))
            return [self.write(item, f"{path}.{i}", of) for i, (item, of) in items]
        if kind is dict and all(isinstance(key, str) for key in value):
            of = _value_type(choice)
            return {name: self.write(inner, f"{path}.{name}", of) for name, inner in value.items()}
        raise _unwritable(path, value)

    def _write_array(self, value: np.ndarray, path: str) -> dict[str, Any]:
        # Products of matrices are rounded as their numbers stand in memory.
        turned = value.ndim > 1 and value.flags.f_contiguous and not value.flags.c_contiguous
        stored: Any = np.array(value.T if turned else value, order="C")
        if stored.dtype == complex:
            stored = np.stack([stored.real, stored.imag], axis=-1)
        self.arrays[path] = stored.astype(STORED[value.dtype.name])
        return {ARRAY: value.dtype.name, "turned": turned}

    def read(self, part: Any, path: str, declared: Any = Any) -> Any:
        """The value of a declared type; various errors if the part stands for none."""
        choices = _choices(declared)
        if not isinstance(part, dict):
            value = self._read_items(part, path, choices) if isinstance(part, list) else part
        elif REFERENCE in part:
            value = self._full[part[REFERENCE]]
        elif ARRAY in part:
            value = self._read_array(part, path)
        elif OPERATIONS in choices:
            value = of_arrays(*(self._read_array(part[n], f"{path}.{n}") for n in OPERATION_ARRAYS))
        else:
            kind = named(part[CLASS]) if CLASS in part else _record(declared)
            inner = {name: value for name, value in part.items() if name != CLASS}
            if kind is None:
                types = dict.fromkeys(inner, _value_type(_chosen(choices, dict, path)))
            else:
                types = _fields(kind)
            fields = {n: self.read(part, f"{path}.{n}", types[n]) for n, part in inner.items()}
            value: Any = fields if kind is None else kind(**fields)
            # A plug-in's class may derive from one of this package.
            if hasattr(value, "check_sizes"):
                value.check_sizes()
        _chosen(choices, type(value), path)
        return value

    def _read_items(self, part: list[Any], path: str, choices: Sequence[Any]) -> Any:
        kind = list if any(_allows(choice, list) for choice in choices) else tuple
        types = _item_types(_chosen(choices, kind, path), len(part))
        items = enumerate(zip(part, types, strict=True))
        return kind(self.read(item, f"{path}.{i}", of) for i, (item, of) in items)

    def _read_array(self, part: Mapping[str, Any], path: str) -> np.ndarray:
        kind = part[ARRAY]
        stored = np.array(self.arrays[path], dtype=STORED[kind], order="C")
        if kind == "complex128":
            require(stored.shape[-1] == 2, path)
            stored = stored.view(complex)[..., 0]
        value = stored.astype(kind, order="C")
        return value.T if part["turned"] else value


def named(name: str) -> Any:
    """The class `module:name` of a part; `ValueError` if it is anything else."""
    module, _, attribute = name.partition(":")
    # Of plug-ins only what is in use already: reading a file imports nothing of theirs.
    if module.startswith(ROOMS):
        with suppress(ImportError):
            import_module(module)
    kind = getattr(sys.modules.get(module), attribute, None)
    if not (_is_part(kind) and kind.__module__ == module):
        raise ValueError(f"there is no {name}")
    return kind


def _is_part(kind: Any) -> bool:
    """Whether it is a dataclass or named tuple that checks its sizes, or that of a plug-in."""
    if not _fields(kind):
        return False
    if kind.__module__.startswith(ROOMS):
        return hasattr(kind, "check_sizes")
    return kind.__module__.partition(".")[0] in _plug_ins()


@cache
def _plug_ins() -> set[str]:
    """Top-level packages with methods, besides this one."""
    tops = {entry.module.partition(".")[0] for entry in entry_points(group=GROUPS["method"])}
    return tops - {"vehiclemor"}


def _name(value: Any, path: str) -> str:
    """`module:name` by which `named` gives its class."""
    name = f"{type(value).__module__}:{type(value).__qualname__}"
    with suppress(ValueError):
        if named(name) is type(value):
            return name
    raise _unwritable(path, value)


def _unwritable(path: str, value: Any) -> InputError:
    return InputError(f"it can't be saved: {path} is {quoted(value)}")


@cache
def _fields(kind: Any) -> Mapping[str, Any]:
    """Fields of a dataclass or named tuple with their declared types; none of anything else."""
    if not isinstance(kind, type):
        return {}
    names = getattr(kind, "_fields", ()) if issubclass(kind, tuple) else ()
    if dataclasses.is_dataclass(kind):
        names = [field.name for field in dataclasses.fields(kind) if field.init]
    try:
        hints = get_type_hints(kind)
    except NameError:
        # A plug-in's type that is known to its type checker alone.
        hints = {}
    return {name: hints.get(name, Any) for name in names}


def _choices(declared: Any) -> tuple[Any, ...]:
    """The types that a declared one allows."""
    return get_args(declared) if get_origin(declared) in (Union, UnionType) else (declared,)


def _record(declared: Any) -> Any:
    """The class of a declared type that leaves none open; else none."""
    records = [choice for choice in _choices(declared) if _is_part(choice)]
    return records[0] if len(records) == 1 else None


def _allows(choice: Any, kind: type) -> bool:
    """Whether a value of a class may stand where a type is declared."""
    origin = get_origin(choice) or choice
    if origin is Any or not isinstance(origin, type) or getattr(origin, "_is_protocol", False):
        # An open type doesn't say whether a list of JSON was a list or a tuple, a table a mapping.
        return kind not in (list, dict)
    if origin is float:
        return kind in (float, int)
    # To Python a truth value is an integer, and a list a sequence.
    return kind is origin or (kind not in (bool, list) and issubclass(kind, origin))


def _chosen(choices: Sequence[Any], kind: type, path: str) -> Any:
    """The type among the declared ones that allows a class; `ValueError` if none does."""
    for choice in choices:
        if _allows(choice, kind):
            return choice
    raise ValueError(f"{path} is of type {kind.__name__}, which is not declared")


def _item_types(choice: Any, count: int) -> Sequence[Any]:
    """Declared types of so many items of a tuple or list."""
    types = get_args(choice)
    if get_origin(choice) is tuple and types[-1:] != (...,):
        return types
    return (types[0] if types else Any,) * count


def _value_type(choice: Any) -> Any:
    """Declared type of the values of a mapping."""
    return (get_args(choice) or (str, Any))[1]
