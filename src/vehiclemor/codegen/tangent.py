"""Products of a kernel's Jacobian with directions, by machine code made when it is first needed."""

import ctypes
import hashlib
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.codegen.cache import fetched, once
from vehiclemor.codegen.kernels import Kernels, KernelSource, kernel_sources
from vehiclemor.codegen.sources import source_digest
from vehiclemor.codegen.vector_lanes import DIRECTIONS
from vehiclemor.short_repr import ShortRepr

# So few directions are taken one by one: the code for many takes longer to compile.
FEW = 4


def tangent_source(source: KernelSource, arguments: Sequence[str]) -> KernelSource:
    """Source of the tangent of a kernel, see `tangent_text`; kept on disk."""
    parts = [source.text, *arguments, source_digest(("codegen",))]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]

    def make() -> bytes:
        from vehiclemor.codegen.tangent_text import tangent_text

        (found,) = kernel_sources(tangent_text(source.text, arguments)).values()
        return json.dumps(asdict(found)).encode()

    written = json.loads(fetched(f"tangents/{source.name}-{digest}.json", make))
    written |= {key: tuple(written[key]) for key in ("arguments", "sizes")}
    return KernelSource(**written)


@dataclass(frozen=True, eq=False)
class Tangent(ShortRepr):
    """The tangent of a kernel along one of its arguments.

    Attributes
    ----------
    source
        Its text.
    size, width
        Numbers of floats of the result and of the argument.
    moving
        Places of the argument on which results depend; the others' columns are zero.
    """

    source: KernelSource
    size: int
    width: int
    moving: np.ndarray

    @cached_property
    def _units(self) -> np.ndarray:
        """Directions along the places that matter, filled up."""
        units = np.zeros((self._rows(len(self.moving)), self.width))
        units[np.arange(len(self.moving)), self.moving] = 1.0
        return units

    def _rows(self, count: int) -> int:
        return count if count <= FEW else -(-count // DIRECTIONS) * DIRECTIONS

    def columns(self, arrays: Sequence[np.ndarray], directions: np.ndarray) -> np.ndarray:
        """Products with directions (k, width), as rows (k, size).

        Parameters
        ----------
        arrays
            The kernel's own arguments in order, as `Kernels.call` wants them, without the result.
        """
        seeds = np.zeros((self._rows(len(directions)), self.width))
        seeds[: len(directions)] = directions
        return self._products(arrays, seeds)[: len(directions)]

    def jacobian(self, arrays: Sequence[np.ndarray]) -> np.ndarray:
        """Derivatives (size, width) by the entries of the argument."""
        found = np.zeros((self.width, self.size))
        if len(self.moving):
            found[self.moving] = self._products(arrays, self._units)[: len(self.moving)]
        return np.ascontiguousarray(found.T)

    def _products(self, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
        rows, lanes = len(seeds), 1 if len(seeds) <= FEW else DIRECTIONS
        result = np.empty((rows, self.size))
        given = [*arrays, seeds[0], result[0]]
        for array, size in zip(given, self.source.sizes, strict=True):
            if array.size < size or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise TypeError(
                    f"{self.source.name}: {size} floats, not {array.dtype}{array.shape}"
                )
        function, pointers = _function(self.source, lanes), [array.ctypes.data for array in given]
        for _ in range(0, rows, lanes):
            function(*pointers, *((self.width, self.size) if lanes > 1 else ()))
            pointers[-2] += 8 * lanes * self.width
            pointers[-1] += 8 * lanes * self.size
        return result


@once
def _function(source: KernelSource, lanes: int) -> Callable[..., None]:
    """Machine code of a tangent as a C function; in lanes it is told how long rows are."""
    kinds: list[Any] = [ctypes.c_void_p] * len(source.arguments)
    kinds += [ctypes.c_int64] * (2 if lanes > 1 else 0)
    return ctypes.CFUNCTYPE(None, *kinds)(
        Kernels({source.name: source}).address(source.name, lanes)
    )


@once
def tangent(source: KernelSource, argument: str, size: int, width: int) -> Tangent:
    """The tangent of a kernel along one of its arguments, such as `_x`.

    Parameters
    ----------
    size, width
        Numbers of floats of the kernel's result and of the argument.
    """
    found = tangent_source(source, (argument,))
    places = re.findall(rf"_seed{argument}\[(\d+)\]", found.text)
    return Tangent(found, size, width, np.unique(np.array(places, dtype=np.int64)))
