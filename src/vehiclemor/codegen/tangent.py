"""Products of a kernel's Jacobian with directions, by machine code made when it is first needed."""

import ctypes
import hashlib
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vehiclemor.codegen.kernels import Kernels, KernelSource, kernel_sources
from vehiclemor.codegen.object_cache import fetched
from vehiclemor.codegen.once import once
from vehiclemor.codegen.sources import source_digest
from vehiclemor.codegen.vector_lanes import DIRECTIONS
from vehiclemor.short_repr import ShortRepr

# So few directions are taken one by one: the code for many takes longer to compile.
FEW = 4


def tangent_source(source: KernelSource, arguments: Sequence[str]) -> KernelSource:
    """Source of the tangent of a kernel, see `tangent_text`; kept on disk."""
    parts = [source.text, *arguments, source_digest(("codegen",), (), ())]
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
    size
        Number of floats of the result.
    moving
        Places of the argument on which results depend; the others' columns are zero.
    """

    source: KernelSource
    size: int
    moving: np.ndarray

    def columns(self, arrays: Sequence[np.ndarray], directions: np.ndarray) -> np.ndarray:
        """Products with directions (k, argument), as rows (k, size).

        Parameters
        ----------
        arrays
            The kernel's own arguments in order, as `Kernels.call` wants them, without the result.
        """
        count, width = directions.shape
        lanes = 1 if count <= FEW else DIRECTIONS
        rows = -(-count // lanes) * lanes
        seeds, result = np.zeros((rows, width)), np.zeros((rows, self.size))
        seeds[:count] = directions
        given = [*arrays, seeds[0], result[0]]
        for array, size in zip(given, self.source.sizes, strict=True):
            if array.size < size or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise TypeError(
                    f"{self.source.name}: {size} floats, not {array.dtype}{array.shape}"
                )
        function, pointers = _function(self.source, lanes), [array.ctypes.data for array in given]
        for _ in range(0, rows, lanes):
            function(*pointers, *((width, self.size) if lanes > 1 else ()))
            pointers[-2] += 8 * lanes * width
            pointers[-1] += 8 * lanes * self.size
        return result[:count]

    def jacobian(self, arrays: Sequence[np.ndarray], width: int) -> np.ndarray:
        """Derivatives (size, width) by the entries of the argument."""
        found = np.zeros((self.size, width))
        if len(self.moving):
            found[:, self.moving] = self.columns(arrays, np.eye(width)[self.moving]).T
        return found


@once
def _function(source: KernelSource, lanes: int) -> Callable[..., None]:
    """Machine code of a tangent as a C function; in lanes it is told how long rows are."""
    kinds: list[Any] = [ctypes.c_void_p] * len(source.arguments)
    kinds += [ctypes.c_int64] * (2 if lanes > 1 else 0)
    return ctypes.CFUNCTYPE(None, *kinds)(
        Kernels({source.name: source}).address(source.name, lanes)
    )


@once
def tangent(source: KernelSource, argument: str, size: int) -> Tangent:
    """The tangent of a kernel along one of its arguments, such as `_x`.

    Parameters
    ----------
    size
        Number of floats of the kernel's result.
    """
    found = tangent_source(source, (argument,))
    places = re.findall(rf"_seed{argument}\[(\d+)\]", found.text)
    return Tangent(found, size, np.unique(np.array(places, dtype=np.int64)))
