"""Kernels of a model or a reduced model: source, machine code, calls from Python."""

from __future__ import annotations

import ctypes
import hashlib
import re
from collections.abc import Mapping
from ctypes import addressof, c_char
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.cache import compiler_identity, fetched, once
from vehiclemor.codegen.machine_code import MachineCode
from vehiclemor.codegen.sources import source_digest


@dataclass(frozen=True)
class KernelSource:
    """Text of a kernel, and what it wants of its arrays.

    Attributes
    ----------
    name
        Of the kernel.
    text
        Straight-line source, as `kernel_source` prints it.
    arguments
        Names of its arguments without scratch space, the result last.
    sizes
        Smallest number of floats of each argument.
    dimensions
        Of the result.
    """

    name: str
    text: str
    arguments: tuple[str, ...]
    sizes: tuple[int, ...]
    dimensions: int

    def check(self, *lengths: int) -> None:
        """Raise `ValueError` if the kernel reads or writes more floats than its arguments have.

        Parameters
        ----------
        lengths
            Of the arguments in order, as far as they are known.
        """
        for argument, size, length in zip(self.arguments, self.sizes, lengths, strict=False):
            if size > length:
                raise ValueError(f"kernel {self.name}: {argument} has {length} floats, not {size}")


class BareKernel(NamedTuple):
    """A compiled function of a model for integrators of others.

    Nothing is checked: arguments are C-contiguous arrays of floats that can be written, as long as
    the model's.

    Attributes
    ----------
    address
        Of `void f(double *x, double *u, double *constants, double *result)`.
    constants
        Third argument: hoisted constants of the model.
    function, constants_address
        The same for Python, by addresses.
    owner
        Keeps the machine code.
    """

    address: int
    constants: np.ndarray
    function: Any
    constants_address: int
    owner: Any

    def __call__(self, x: np.ndarray, u: np.ndarray, result: np.ndarray) -> None:
        """Write the result at a state and inputs."""
        arrays: Any = x, u, result
        first, second, last = [addressof(c_char.from_buffer(array)) for array in arrays]
        self.function(first, second, self.constants_address, last)


class Kernels:
    """Kernels by name, each compiled when it is first used.

    Parameters
    ----------
    sources
        Name -> source.
    """

    def __init__(self, sources: Mapping[str, KernelSource]) -> None:
        self.sources = dict(sources)

    def __contains__(self, name: str) -> bool:
        return name in self.sources

    def address(self, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
        """Address of a kernel's machine code, for loops; 0 where there is no such kernel.

        Parameters
        ----------
        lanes
            Samples that it takes at once, see `llvm_kernels.kernel_module`.
        results
            Numbers of the results that it computes, in their new order; all where none are named.
        """
        return _machine(self.sources[name], lanes, results)[0] if name in self.sources else 0

    def bare(self, name: str, constants: np.ndarray) -> BareKernel:
        """A kernel of states and inputs without its checks."""
        address, function, code = _machine(self.sources[name])
        return BareKernel(address, constants, function, constants.ctypes.data, code)

    def call(self, name: str, *arrays: np.ndarray) -> None:
        """Run a kernel.

        Parameters
        ----------
        arrays
            Arguments in order, the result last: C-contiguous floats.

        Raises
        ------
        TypeError
            If an array is too short or of another kind.
        """
        source = self.sources[name]
        function = _machine(source, 1)[1]
        function(*[_checked(source, k, array) for k, array in enumerate(arrays)])


def _checked(source: KernelSource, place: int, array: Any) -> int:
    last = place == len(source.arguments) - 1
    dimensions, size = source.dimensions if last else 1, source.sizes[place]
    if not (
        isinstance(array, np.ndarray)
        and array.dtype == np.float64
        and array.flags.c_contiguous
        and array.ndim == dimensions
        and array.size >= size
        and (not last or array.flags.writeable)
    ):
        kind = f"{array.dtype}{array.shape}" if hasattr(array, "dtype") else type(array)
        raise TypeError(
            f"{source.name}: {source.arguments[place].removeprefix('_')} must be a C-contiguous "
            f"array of at least {size} floats with {dimensions} dimension(s), not {kind}"
        )
    return array.ctypes.data


@once
def _machine(
    source: KernelSource, lanes: int = 1, results: tuple[int, ...] = ()
) -> tuple[int, Any, MachineCode]:
    """Address and C function of a kernel, and what owns its machine code."""
    of_results = ",".join(map(str, results))
    parts = [source.text, str(lanes), of_results, source_digest(("codegen",)), compiler_identity()]
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]

    def make() -> bytes:
        from vehiclemor.codegen.compiler import compiled_module
        from vehiclemor.codegen.llvm_kernels import kernel_module
        from vehiclemor.codegen.operations import Kernel

        kernel = Kernel(source.text)
        return compiled_module(kernel_module([kernel.of(results) if results else kernel], lanes))

    code = MachineCode(fetched(f"kernels/{source.name}-{key}.o", make))
    address = code.address(source.name)
    pointers = [ctypes.c_void_p] * len(source.arguments)
    return address, ctypes.CFUNCTYPE(None, *pointers)(address), code


def kernel_sources(text: str) -> dict[str, KernelSource]:
    """Sources of the kernels in a text, by name."""
    parts = re.split(r"\n+(?=def )", text.strip())
    return {source.name: source for source in (_source(f"{part}\n") for part in parts)}


# Models with other parameters ask for the same again.
@lru_cache(maxsize=64)
def _source(text: str) -> KernelSource:
    from vehiclemor.codegen.operations import Kernel

    kernel = Kernel(text)
    sizes = tuple(kernel.sizes[name] for name in kernel.pointers)
    return KernelSource(kernel.name, text, tuple(kernel.pointers), sizes, kernel.dimensions)
