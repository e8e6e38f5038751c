"""Kernels of a model or a reduced model: derivations on disk, machine code, calls from Python.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the kernels'
operations are cached under the hash of the source that derives them: the model, the symbolic layer
and this one.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Iterable
from ctypes import addressof, c_char
from dataclasses import asdict
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.codegen.cache import (
    cache_folder,
    cached_by_one_thread,
    compiler_identity,
    digest_of,
    from_cache,
)
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.sources import plug_in_digest, source_digest

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

LAYERS = ("multibody", "symbolic", "codegen")
# Kernels that are no functions of a program.
BESIDE = ("constants", "jacobian_entries", "jacobian_product")


class BareKernel(NamedTuple):
    """A compiled function of a model for other integrators.

    Nothing is checked: arguments are writable C-contiguous arrays of floats, as long as the
    model's.  The address is that of `void f(double *x, double *u, double *constants,
    double *result)`, constants are its third argument; function and constants address are the same
    for Python.  The owner holds the machine code in memory.
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
    """Kernels, each compiled at its first use; `sources` are their operations by name."""

    def __init__(self, kernels: Iterable[Kernel]) -> None:
        self.sources = {kernel.name: kernel for kernel in kernels}

    def __contains__(self, name: str) -> bool:
        return name in self.sources

    def address(self, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
        """Address of a kernel's machine code, for loops; 0 if there is no such kernel.

        It takes `lanes` samples at once, see `llvm_kernels.kernel_module`, and computes the results
        with these indices, in this order; all if none are named.
        """
        if name not in self.sources:
            return 0
        kernel = self.sources[name]
        if results:
            kernel = _of(kernel, results)
        return _machine(kernel, lanes)[0]

    def bare(self, name: str, constants: np.ndarray) -> BareKernel:
        """A kernel of states and inputs without its checks."""
        address, function, code = _machine(self.sources[name])
        return BareKernel(address, constants, function, constants.ctypes.data, code)

    def call(self, name: str, *arrays: np.ndarray) -> None:
        """Run a kernel on its arguments, the result last; `TypeError` if one does not fit."""
        kernel = self.sources[name]
        function = _machine(kernel, 1)[1]
        function(*[_checked(kernel, k, array) for k, array in enumerate(arrays)])

    # Of those that are derived from a program:

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Function -> shape of its result."""
        return {name: k.shape for name, k in self.sources.items() if name not in BESIDE}

    @property
    def constants(self) -> int:
        """Number of hoisted constants, which the kernel `constants` computes from parameters."""
        return self.sources["constants"].shape[0]

    @property
    def source(self) -> str:
        """All kernels, in one line each."""
        return "\n".join(map(repr, self.sources.values()))

    @cached_property
    def operations(self) -> dict[str, dict[str, int]]:
        """Function -> exact counts of its operations, see `Kernel.counts`."""
        return {name: self.sources[name].counts for name in ("constants", *self.shapes)}


def _checked(kernel: Kernel, index: int, array: Any) -> int:
    """Address of the array for an argument of a kernel."""
    last = index == len(kernel.arguments) - 1
    dimensions, size = len(kernel.shape) if last else 1, kernel.sizes[index]
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
            f"{kernel.name}: {kernel.arguments[index].removeprefix('_')} must be a C-contiguous "
            f"array of at least {size} floats with {dimensions} dimension(s), not {kind}"
        )
    return array.ctypes.data


class MachineCode:
    """Functions of an object file in memory, at addresses in this process.

    LLVM's loader loads it, without a compiler.
    """

    def __init__(self, content: bytes) -> None:
        import llvmlite.binding as llvm

        # The engine owns the memory of the code, and its target machine.
        machine = _target().create_target_machine()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of a function."""
        address = self._engine.get_function_address(name)
        if not address:
            raise ImportError(f"the object code has no function {name}")
        return address


@cached_by_one_thread
def _target() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple())


_of = lru_cache(maxsize=64)(Kernel.of)


@cached_by_one_thread
def _machine(kernel: Kernel, lanes: int = 1) -> tuple[int, Any, MachineCode]:
    """Address and C function of a kernel, and the owner of its machine code."""
    parts = repr(kernel), str(lanes), source_digest(("codegen",)), compiler_identity()

    def make() -> bytes:
        from vehiclemor.codegen.compiler import compiled_module
        from vehiclemor.codegen.llvm_kernels import kernel_module

        return compiled_module(kernel_module(kernel, lanes))

    code = MachineCode(from_cache(f"kernels/{kernel.name}-{digest_of(parts)}.o", make))
    address = code.address(kernel.name)
    pointers = [ctypes.c_void_p] * len(kernel.arguments)
    # Calls keep the interpreter's lock: to acquire it again takes longer than a call.
    return address, ctypes.PYFUNCTYPE(None, *pointers)(address), code


def derivation(name: str, derive: Callable[[], Program], choice: str = "") -> Kernels:
    """The kernels of a model: from disk, or by `derive` and then written there.

    Choice tells apart what one function derives for other arguments.
    """

    def make() -> bytes:
        # Nothing else is symbolic: a model that was derived before starts without SymPy.
        from vehiclemor.codegen.lowering import kernels_of

        return json.dumps([asdict(kernel) for kernel in kernels_of(derive()).values()]).encode()

    return _read(from_cache(_file(name, derive, choice), make))


def is_derived(name: str, derive: Callable[[], Program], choice: str = "") -> bool:
    """Whether the derivation of a model is on disk."""
    return (cache_folder() / _file(name, derive, choice)).exists()


def _file(name: str, derive: Callable[[], Program], choice: str) -> str:
    sources = source_digest(LAYERS), plug_in_digest((derive,))
    parts = *sources, name, choice, f"sympy {version('sympy')}"
    return f"derivations/{name}_{digest_of(parts)}.json"


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(content: bytes) -> Kernels:
    return Kernels(map(Kernel.read, json.loads(content)))
