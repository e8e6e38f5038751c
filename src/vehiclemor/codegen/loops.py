"""Compiled loops with the kernels they call, cached by content and called from Python."""

from __future__ import annotations

import ctypes
import inspect
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any, get_args

import numpy as np

from vehiclemor.codegen.cache import cached_by_one_thread, compiler_identity, digest_of, from_cache
from vehiclemor.codegen.kernels import MachineCode
from vehiclemor.codegen.loop_types import declared_arguments
from vehiclemor.codegen.sources import source_digest

_ENTRY = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)


Kind = tuple[str, str, int]
DTYPES = {"d": np.dtype(np.float64), "l": np.dtype(np.int64)}
# Words of numbers, and of arrays by their dimensions.
LONG, FLOAT = struct.Struct("q"), struct.Struct("d")
ARRAYS = [struct.Struct(f"{dimensions + 1}q") for dimensions in range(4)]


@dataclass(frozen=True, eq=False)
class Ready:
    """A bundle of arrays and numbers in words, for many runs; it must not change."""

    bundle: Any
    words: bytes


def ready(bundle: Any) -> Ready:
    """A named tuple as an argument of loops, its arrays checked."""
    return Ready(bundle, _words(type(bundle).__name__, _kinds(type(bundle)), bundle))


class Prepared:
    """A loop with its arguments in words, some of which may be replaced from run to run."""

    __slots__ = ("_arguments", "_entry", "_given", "_offsets", "words")

    def __init__(
        self,
        entry: Callable[[Any], int],
        packed: bytes,
        offsets: Mapping[str, int],
        arguments: tuple[Any, ...],
    ) -> None:
        self._entry, self._offsets = entry, offsets
        # They own the memory at the addresses in the words.
        self._arguments = arguments
        self._given: dict[str, Ready] = {}
        self.words = (ctypes.c_int64 * (len(packed) // 8)).from_buffer_copy(packed)

    def __call__(self) -> int:
        """Run the loop; the lock of the interpreter is released meanwhile."""
        return self._entry(self.words)

    def give(self, name: str, bundle: Ready) -> None:
        """Replace an argument that is a bundle."""
        address = ctypes.addressof(self.words) + LONG.size * self._offsets[name]
        ctypes.memmove(address, bundle.words, len(bundle.words))
        self._given[name] = bundle

    def address(self, name: str) -> int:
        """Index of the word with the address of an array; its shape follows."""
        return self._offsets[name]


class Loop:
    """A compiled loop as a function of arrays, numbers and named tuples of these."""

    def __init__(self, name: str, declared: Mapping[str, Any], code: MachineCode) -> None:
        self.name = name
        self._kinds = [_kinds(kind, argument) for argument, kind in declared.items()]
        self._entry, self._code = _ENTRY(code.address(name)), code
        # Index of the first word of each argument and of each part of a bundle.
        self._offsets, offset = {}, 0
        for argument, kinds in zip(declared, self._kinds, strict=True):
            self._offsets[argument] = offset
            for part, _, dimensions in kinds:
                self._offsets[part] = offset
                offset += dimensions + 1

    def __call__(self, *arguments: Any) -> int:
        """Run the loop; the lock of the interpreter is released meanwhile."""
        return self.prepared(*arguments)()

    def prepared(self, *arguments: Any) -> Prepared:
        """The loop with its arguments; `TypeError` if one does not fit."""
        name = self.name
        packed = b"".join(
            [
                value.words if type(value) is Ready else _words(name, kinds, value)
                for kinds, value in zip(self._kinds, arguments, strict=True)
            ]
        )
        return Prepared(self._entry, packed, self._offsets, arguments)


def address_of_array(array: np.ndarray) -> int:
    """Address of the first entry of a writable C-contiguous array that is not empty."""
    # In a third of the time of `array.ctypes.data`.
    return ctypes.addressof(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]


def _words(loop: str, kinds: Sequence[Kind], value: Any) -> bytes:
    """Words of an argument: an array is its address and its shape."""
    if len(kinds) == 1 and not isinstance(value, tuple):
        return _part(loop, kinds[0], value)
    pairs = zip(kinds, _flat(value), strict=True)
    return b"".join([_part(loop, kind, part) for kind, part in pairs])


def _part(loop: str, kind: Kind, part: Any) -> bytes:
    name, code, dimensions = kind
    if not dimensions:
        return LONG.pack(int(part)) if code == "l" else FLOAT.pack(part)
    if not (
        isinstance(part, np.ndarray)
        and part.ndim == dimensions
        and part.dtype == DTYPES[code]
        and (flags := part.flags).c_contiguous
    ):
        kind_of_part = f"{part.dtype}{part.shape}" if hasattr(part, "dtype") else type(part)
        raise TypeError(
            f"{loop}: {name} must be a C-contiguous array {code}[{dimensions}], not {kind_of_part}"
        )
    address = address_of_array(part) if flags.writeable and part.size else part.ctypes.data
    return ARRAYS[dimensions].pack(address, *part.shape)


def _flat(value: Any) -> list[Any]:
    """Parts of an argument, named tuples taken apart."""
    if not isinstance(value, tuple):
        return [value]
    return [part for field in value for part in _flat(field)]


@cached_by_one_thread
def loops(modules: tuple[str, ...], entries: tuple[str, ...]) -> dict[str, Loop]:
    """Compiled entries, functions with declared types, of modules of loops.

    Modules are named below this package; a function of a later one replaces an earlier one of the
    same name.
    """
    imported = [import_module(f"vehiclemor.{name}") for name in modules]
    key = digest_of([loops_digest(modules), *modules, *entries, compiler_identity()])

    def make() -> bytes:
        from vehiclemor.codegen.compiler import compiled_loops

        return compiled_loops(imported, entries)

    code = MachineCode(from_cache(f"loops/{modules[-1].rpartition('.')[2]}-{key}.o", make))
    functions = {name: _entry(imported, name) for name in entries}
    return {
        name: Loop(name, declared_arguments(function), code) for name, function in functions.items()
    }


def loops_digest(modules: Sequence[str]) -> str:
    """Hash of the source of loops, and of this layer, which compiles them."""
    files = [f"{name.replace('.', '/')}.py" for name in modules]
    return source_digest(("codegen",), files)


def _entry(modules: Sequence[ModuleType], name: str) -> Any:
    for module in reversed(modules):
        if inspect.isfunction(entry := vars(module).get(name)):
            return entry
    raise ImportError(f"no module of loops has the entry {name}")


@cache
def _kinds(declared: Any, name: str = "") -> Sequence[Kind]:
    """Name, type code and dimensions of the parts of a declared type."""
    if not hasattr(declared, "_fields"):
        _, number, dimensions = get_args(declared)
        return [(name, "d" if number == "float64" else "l", dimensions)]
    fields = declared.__annotations__.items()
    return [kind for field, inner in fields for kind in _kinds(inner, f"{name}.{field}")]
