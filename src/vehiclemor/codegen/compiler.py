"""Object code from LLVM modules and from Python loops, by numba's compiler.

Everything here is imported only where something has to be compiled.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import FunctionType, ModuleType
from typing import Any, get_args

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.codegen import AOTCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.np.arrayobj import populate_array

from vehiclemor.codegen import loop_intrinsics
from vehiclemor.codegen.loop_types import declared_arguments

# Straight-line kernels are one long block: with its own limits the compiler finds half of what left
# and right have in common.
for option in ("-slp-schedule-budget=2000000", "-slp-max-look-ahead-depth=6"):
    llvm.set_option("vehiclemor", option)

WORD = ir.IntType(64)
OPTIONS = {
    "nopython": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
INTRINSICS = {
    name: getattr(loop_intrinsics, name)
    for name in ("vector", "matrix", "call_kernel", "call_lanes", "mixed_rows")
}


class _Part(AOTCodeLibrary):
    """Optimised code that is only linked into other code: it gets no machine code of its own."""

    def get_pointer_to_function(self, name: str) -> int:
        """No address: nothing is called from here."""
        del name
        self._ensure_finalized()
        return 0


class _Codegen(JITCPUCodegen):
    """Code for this processor, as numba makes it, but not loaded; statements become vectors too."""

    _library_class = _Part

    def _add_module(self, module: Any) -> None:
        pass

    def _pass_builder(self, **options: Any) -> Any:
        return super()._pass_builder(**{"slp_vectorize": True} | options)

    def set_env(self, env_name: str, env: Any) -> None:
        """Nothing: code without Python objects has no environment."""


class _Target(CPUTarget):
    @property
    def typing_context(self) -> Any:
        return cpu_target.typing_context

    @property
    def target_context(self) -> Any:
        return _context()


@cache
def _context() -> Any:
    context: Any = cpu_target.target_context
    return context.subtarget(_internal_codegen=_Codegen("loops"))


class _Dispatcher(CPUDispatcher):
    targetdescr = _Target("cpu")


@global_compiler_lock
def compiled_module(module: ir.Module, libraries: Sequence[Any] = ()) -> bytes:
    """Object code of an LLVM module; functions of the libraries are linked into it."""
    context = _context()
    library = context.codegen().create_library(module.name)
    module.triple = context.codegen().magic_tuple()[0]
    library.add_ir_module(module)
    for other in libraries:
        library.add_linking_library(other)
    return library.emit_native_object()


def compiled_loops(
    modules: Sequence[ModuleType], entries: Sequence[str], given: Mapping[str, Any]
) -> bytes:
    """Object code of the entries of modules of loops.

    Each entry becomes a C function of one pointer to 64-bit words: the arguments in order, an array
    as its address and its shape, see `loops.words`.

    Parameters
    ----------
    modules
        Their functions know one another by name; a later one takes the place of an earlier.
    entries
        Functions that Python calls, with declared types.
    given
        Further names that the functions use: sizes, and kernels to be inlined.
    """
    functions = linked(modules, given)
    outer, libraries = ir.Module("loops"), []
    for name in entries:
        declared = declared_arguments(functions[name].py_func)
        kinds = tuple(_numba_type(kind) for kind in declared.values())
        functions[name].compile(kinds)
        result = functions[name].overloads[kinds]
        _export(outer, name, result.fndesc)
        libraries.append(result.library)
    return compiled_module(outer, libraries)


def linked(modules: Sequence[ModuleType], given: Mapping[str, Any]) -> dict[str, Any]:
    """Functions of modules of loops, to be compiled, by name."""
    functions: dict[str, Any] = {}
    namespaces = [dict(vars(module)) for module in modules]
    for module, namespace in zip(modules, namespaces, strict=True):
        inlined = getattr(module, "INLINED", ())
        for name, value in vars(module).items():
            if inspect.isfunction(value) and value.__module__ == module.__name__:
                copied = FunctionType(value.__code__, namespace, name)
                copied.__annotations__ = value.__annotations__
                options = OPTIONS | {"forceinline": name in inlined}
                functions[name] = _Dispatcher(copied, targetoptions=options)
    for namespace in namespaces:
        namespace.update(functions | INTRINSICS | dict(given))
    return functions


def _numba_type(declared: Any) -> Any:
    """Type of a declared argument, see `loop_types`."""
    if hasattr(declared, "_fields"):
        fields = [_numba_type(kind) for kind in declared.__annotations__.values()]
        return types.BaseTuple.from_types(fields, declared)
    _, kind, dimensions = get_args(declared) or (declared, "", 0)
    number = getattr(types, kind)
    return types.Array(number, dimensions, "C") if dimensions else number


def _export(module: ir.Module, name: str, described: Any) -> None:
    """A C function that takes the arguments of a compiled one from an array of words."""
    context = _context()
    kind = context.call_conv.get_function_type(described.restype, described.argtypes)
    inner = ir.Function(module, kind, described.llvm_func_name)
    outer = ir.Function(module, ir.FunctionType(WORD, [WORD.as_pointer()]), name)
    builder = ir.IRBuilder(outer.append_basic_block())
    place = iter(range(1 << 20))

    def word() -> Any:
        return builder.load(builder.gep(outer.args[0], [WORD(next(place))]))

    def taken(wanted: Any) -> Any:
        if hasattr(wanted, "types"):
            return context.make_tuple(builder, wanted, [taken(kind) for kind in wanted.types])
        if isinstance(wanted, types.Array):
            return _array(context, builder, wanted, word)
        value = word()
        return builder.bitcast(value, ir.DoubleType()) if wanted == types.float64 else value

    arguments = [taken(wanted) for wanted in described.argtypes]
    _, result = context.call_conv.call_function(
        builder, inner, described.restype, described.argtypes, arguments
    )
    builder.ret(result)


def _array(context: Any, builder: Any, wanted: Any, word: Callable[[], Any]) -> Any:
    array = context.make_array(wanted)(context, builder)
    pointer = context.get_data_type(wanted.dtype).as_pointer()
    data = builder.inttoptr(word(), pointer)
    shape = [word() for _ in range(wanted.ndim)]
    size, strides = WORD(8), []
    for length in reversed(shape):
        strides.insert(0, size)
        size = builder.mul(size, length)
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=WORD(8), meminfo=None)
    return array._getvalue()
