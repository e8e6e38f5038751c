"""Kernels of a model or a reduced model: derived once and kept, machine code, calls from Python.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the kernels'
operations are kept with all that describes them, under the hash of the source that they were
derived by: the model, the symbolic layer and this one.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Iterable
from ctypes import addressof, c_char
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.codegen.cache import cache_folder, compiler_identity, digest_of, fetched, once
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.sources import plug_in_digest, source_digest
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

LAYERS = ("multibody", "symbolic", "codegen")
# Kernels beside the functions of a program.
BESIDE = ("constants", "jacobian_entries", "jacobian_product")


class BareKernel(NamedTuple):
    """A compiled function of a model for integrators of others.

    Nothing is checked: arguments are C-contiguous arrays of floats that can be written, as long as
    the model's.  The address is that of `void f(double *x, double *u, double *constants,
    double *result)`, constants are its third argument; function and constants address are the same
    for Python, and the owner keeps the machine code.
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
    """Kernels, each compiled when it is first used; `sources` are their operations, by name."""

    def __init__(self, kernels: Iterable[Kernel]) -> None:
        self.sources = {kernel.name: kernel for kernel in kernels}

    def __contains__(self, name: str) -> bool:
        return name in self.sources

    def address(self, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
        """Address of a kernel's machine code, for loops; 0 where there is no such kernel.

        It takes `lanes` samples at once, see `llvm_kernels.kernel_module`, and computes the results
        of these places, in this order; all where none are named.
        """
        if name not in self.sources:
            return 0
        kernel = self.sources[name]
        return _machine(_of(kernel, results) if results else kernel, lanes)[0]

    def bare(self, name: str, constants: np.ndarray) -> BareKernel:
        """A kernel of states and inputs without its checks."""
        address, function, code = _machine(self.sources[name])
        return BareKernel(address, constants, function, constants.ctypes.data, code)

    def call(self, name: str, *arrays: np.ndarray) -> None:
        """Run a kernel on its arguments, the result last; `TypeError` if it can't take one."""
        kernel = self.sources[name]
        function = _machine(kernel, 1)[1]
        function(*[_checked(kernel, k, array) for k, array in enumerate(arrays)])


def _checked(kernel: Kernel, place: int, array: Any) -> int:
    last = place == len(kernel.arguments) - 1
    dimensions, size = len(kernel.shape) if last else 1, kernel.sizes[place]
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
            f"{kernel.name}: {kernel.arguments[place].removeprefix('_')} must be a C-contiguous "
            f"array of at least {size} floats with {dimensions} dimension(s), not {kind}"
        )
    return array.ctypes.data


class MachineCode:
    """Functions of an object file in memory, at addresses in this process.

    LLVM's own loader loads it, without what has compiled it.
    """

    def __init__(self, content: bytes) -> None:
        import llvmlite.binding as llvm

        # The engine owns the memory in which the code lies, and its target machine.
        machine = _target().create_target_machine()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of a function."""
        found = self._engine.get_function_address(name)
        if not found:
            raise ImportError(f"the object code has no function {name}")
        return found


@once
def _target() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple())


_of = lru_cache(maxsize=64)(Kernel.of)


@once
def _machine(kernel: Kernel, lanes: int = 1) -> tuple[int, Any, MachineCode]:
    """Address and C function of a kernel, and what owns its machine code."""
    parts = repr(kernel), str(lanes), source_digest(("codegen",)), compiler_identity()

    def make() -> bytes:
        from vehiclemor.codegen.compiler import compiled_module
        from vehiclemor.codegen.llvm_kernels import kernel_module

        return compiled_module(kernel_module([kernel], lanes))

    code = MachineCode(fetched(f"kernels/{kernel.name}-{digest_of(parts)}.o", make))
    address = code.address(kernel.name)
    pointers = [ctypes.c_void_p] * len(kernel.arguments)
    # It keeps the lock of the interpreter, which takes longer to get back than one call lasts.
    return address, ctypes.PYFUNCTYPE(None, *pointers)(address), code


@dataclass(frozen=True, eq=False)
class Derivation(ShortRepr):
    """What is left of a program: kernels by name; `constants` gives those of the parameters."""

    sources: dict[str, Kernel]

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Function -> shape of its result."""
        return {name: k.shape for name, k in self.sources.items() if name not in BESIDE}

    @property
    def constants(self) -> int:
        """Number of hoisted constants."""
        return self.sources["constants"].shape[0]

    @property
    def source(self) -> str:
        """All kernels, in one line each."""
        return "\n".join(map(repr, self.sources.values()))

    @cached_property
    def operations(self) -> dict[str, dict[str, int]]:
        """Function -> exact counts of its operations, see `Kernel.counts`."""
        return {name: self.sources[name].counts for name in ("constants", *self.shapes)}

    @cached_property
    def kernels(self) -> Kernels:
        """The kernels, compiled when they are first used."""
        return Kernels(self.sources.values())


def derivation(name: str, derive: Callable[[], Program]) -> Derivation:
    """The derivation of a model: from disk, or made by `derive` and written there."""

    def make() -> bytes:
        # Only here is anything symbolic: a model that was derived before starts without it.
        from vehiclemor.codegen.lowering import kernels_of

        return json.dumps([asdict(kernel) for kernel in kernels_of(derive()).values()]).encode()

    return _read(fetched(_file(name, derive), make))


def is_derived(name: str, derive: Callable[[], Program]) -> bool:
    """Whether the derivation of a model is on disk."""
    return (cache_folder() / _file(name, derive)).exists()


def _file(name: str, derive: Callable[[], Program]) -> str:
    parts = source_digest(LAYERS), plug_in_digest((derive,)), name, f"sympy {version('sympy')}"
    return f"derivations/{name}_{digest_of(parts)}.json"


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(content: bytes) -> Derivation:
    kernels = map(Kernel.read, json.loads(content))
    return Derivation({kernel.name: kernel for kernel in kernels})
