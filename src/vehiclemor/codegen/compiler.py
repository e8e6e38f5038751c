"""Object code from LLVM modules and from Python loops, by numba's compiler.

Everything here is imported only where something has to be compiled.  Here alone numba is used, and
what of it is no public interface: its `cfunc` makes loops that take 13 to 28 % longer, and every
process would have to import it (0.2 s).  A test names the versions with which it works.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType, ModuleType
from typing import Any, get_args

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.codegen import AOTCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUTargetOptions
from numba.core.errors import TypingError
from numba.core.options import TargetOptions
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from vehiclemor.codegen.instructions import DOUBLE, FLAGS, constant, spread
from vehiclemor.codegen.loop_types import declared_arguments
from vehiclemor.codegen.operations import LANES

# Straight-line kernels are one long block: with its default limits the compiler packs half of the
# operations that left and right have in common.
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


class _Part(AOTCodeLibrary):
    """Optimised code that is only linked into other code: it becomes no machine code alone."""

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


class _Options(CPUTargetOptions):
    noalias = TargetOptions.Mapping("noalias")


class _Target(CPUTarget):
    options = _Options

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


def compiled_loops(modules: Sequence[ModuleType], entries: Sequence[str]) -> bytes:
    """Object code of the entries of modules of loops.

    Each entry becomes a C function of one pointer to 64-bit words: the arguments in order, an array
    as its address and its shape, see `loops.words`.  Functions know one another by name, those of a
    later module replace earlier ones.
    """
    functions = linked(modules)
    outer, libraries = ir.Module("loops"), []
    for name in entries:
        declared = declared_arguments(functions[name].py_func)
        kinds = tuple(_numba_type(kind) for kind in declared.values())
        functions[name].compile(kinds)
        result = functions[name].overloads[kinds]
        _export(outer, name, result.fndesc)
        libraries.append(result.library)
    return compiled_module(outer, libraries)


def linked(modules: Sequence[ModuleType]) -> dict[str, Any]:
    """Functions of modules of loops, to be compiled, by name."""
    functions: dict[str, Any] = {}
    namespaces = [dict(vars(module)) for module in modules]
    for module, namespace in zip(modules, namespaces, strict=True):
        inlined, disjoint = (getattr(module, name, ()) for name in ("INLINED", "DISJOINT"))
        for name, value in vars(module).items():
            if inspect.isfunction(value) and value.__module__ == module.__name__:
                copied = FunctionType(value.__code__, namespace, name)
                copied.__annotations__ = value.__annotations__
                options = OPTIONS | {"forceinline": name in inlined, "noalias": name in disjoint}
                functions[name] = _Dispatcher(copied, targetoptions=options)
    for namespace in namespaces:
        namespace.update(functions | INTRINSICS)
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
    index = iter(range(1 << 20))

    def word() -> Any:
        return builder.load(builder.gep(outer.args[0], [WORD(next(index))]))

    def taken(wanted: Any) -> Any:
        if hasattr(wanted, "types"):
            return context.make_tuple(builder, wanted, [taken(kind) for kind in wanted.types])
        if isinstance(wanted, types.Array):
            pointer = context.get_data_type(wanted.dtype).as_pointer()
            data = builder.inttoptr(word(), pointer)
            shape = [word() for _ in range(wanted.ndim)]
            return _array(context, builder, wanted, data, shape)
        value = word()
        return builder.bitcast(value, ir.DoubleType()) if wanted == types.float64 else value

    arguments = [taken(wanted) for wanted in described.argtypes]
    _, result = context.call_conv.call_function(
        builder, inner, described.restype, described.argtypes, arguments
    )
    builder.ret(result)


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Sequence[Any]) -> Any:
    """A C-contiguous array of a shape at an address."""
    array, size, strides = context.make_array(kind)(context, builder), WORD(8), []
    for length in reversed(shape):
        strides.insert(0, size)
        size = builder.mul(size, length)
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=WORD(8), meminfo=None)
    return array._getvalue()


@intrinsic
def vector(typing_context: Any, buffer: Any, first: Any, size: Any) -> Any:
    """See `loop_types.vector`."""
    del typing_context
    kind = types.Array(types.float64, 1, "C")
    return kind(buffer, first, size), _view(kind)


@intrinsic
def matrix(typing_context: Any, buffer: Any, first: Any, rows: Any, columns: Any) -> Any:
    """See `loop_types.matrix`."""
    del typing_context
    kind = types.Array(types.float64, 2, "C")
    return kind(buffer, first, rows, columns), _view(kind)


def _view(kind: Any) -> Callable[..., Any]:
    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        buffer = context.make_array(sig.args[0])(context, builder, args[0])
        first, *shape = [
            context.cast(builder, value, given, types.intp)
            for value, given in zip(args[1:], sig.args[1:], strict=True)
        ]
        return _array(context, builder, kind, builder.gep(buffer.data, [first]), shape)

    return generate


@intrinsic
def call_kernel(typing_context: Any, kernels: Any, index: Any, *arrays: Any) -> Any:
    """See `loop_types.call_kernel`."""
    del typing_context
    _require_plain(*arrays)
    packed: Any = types.StarArgTuple.from_types(arrays)
    return types.void(kernels, index, packed), _call_kernel


def _call_kernel(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    pointers = []
    packed, kinds = args[2], sig.args[2]
    for value, kind in zip(cgutils.unpack_tuple(builder, packed, len(kinds)), kinds, strict=True):
        pointers.append(context.make_array(kind)(context, builder, value).data)
    # Step kernels call other kernels of the list; kernels that don't take this argument ignore it.
    kernels = context.make_array(sig.args[0])(context, builder, args[0])
    pointers.append(builder.bitcast(kernels.data, DOUBLE.as_pointer()))
    return _call_address(context, builder, sig, args, pointers)


@intrinsic
def call_lanes(
    typing_context: Any,
    kernels: Any,
    index: Any,
    path: Any,
    inputs: Any,
    constants: Any,
    result: Any,
    first: Any,
) -> Any:
    """See `loop_types.call_lanes`."""
    del typing_context
    _require_plain(path, inputs, constants, result)
    return types.void(kernels, index, path, inputs, constants, result, first), _call_lanes


def _call_lanes(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    first = context.cast(builder, args[6], sig.args[6], types.intp)
    pointers, row_lengths = [], []
    for value, kind in zip(args[2:6], sig.args[2:6], strict=True):
        array = context.make_array(kind)(context, builder, value)
        pointer = array.data
        if kind.ndim == 2:
            row_lengths.append(cgutils.unpack_tuple(builder, array.shape)[1])
            pointer = builder.gep(pointer, [builder.mul(first, row_lengths[-1])])
        pointers.append(pointer)
    return _call_address(context, builder, sig, args, pointers + row_lengths)


@intrinsic
def rows_product(
    typing_context: Any, values: Any, first: Any, matrix: Any, result: Any, to: Any
) -> Any:
    """See `loop_types.rows_product`."""
    del typing_context
    _require_plain(values, matrix, result)
    return types.void(values, first, matrix, result, to), _rows_product


def _rows_product(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    def part(index: int, row: Any = None) -> tuple[Any, Any, Any]:
        array = context.make_array(sig.args[index])(context, builder, args[index])
        rows, width = cgutils.unpack_tuple(builder, array.shape)
        if row is None:
            return array.data, rows, width
        row = context.cast(builder, args[row], sig.args[row], types.intp)
        return builder.gep(array.data, [builder.mul(row, width)]), rows, width

    (values, _, stride), (matrix, terms, columns) = part(0, 1), part(2)
    result, _, result_stride = part(3, 4)
    kind = ir.VectorType(DOUBLE, LANES)
    sums = [cgutils.alloca_once(builder, kind) for _ in range(LANES)]

    def at(pointer: Any, offset: Any) -> Any:
        return builder.bitcast(builder.gep(pointer, [offset]), kind.as_pointer())

    with cgutils.for_range_slice(builder, WORD(0), columns, WORD(LANES), WORD) as (column, _):
        for total in sums:
            builder.store(constant(kind, 0.0), total)
        with cgutils.for_range(builder, terms) as term:
            weights = at(matrix, builder.add(builder.mul(term.index, columns), column))
            weights = builder.load(weights, align=8)
            for row, total in enumerate(sums):
                place = builder.add(builder.mul(stride, WORD(row)), term.index)
                factor = spread(builder, builder.load(builder.gep(values, [place])), LANES)
                product = builder.fmul(weights, factor, flags=FLAGS)
                builder.store(builder.fadd(builder.load(total), product, flags=FLAGS), total)
        for row, total in enumerate(sums):
            into = at(result, builder.add(builder.mul(result_stride, WORD(row)), column))
            builder.store(builder.load(total), into, align=8)
    return context.get_dummy_value()


def _call_address(context: Any, builder: Any, sig: Any, args: Any, arguments: Sequence[Any]) -> Any:
    """Call the function at an index of a list of addresses, the first two arguments."""
    kernels = context.make_array(sig.args[0])(context, builder, args[0])
    index = context.cast(builder, args[1], sig.args[1], types.intp)
    address = builder.load(builder.gep(kernels.data, [index]))
    function = ir.FunctionType(ir.VoidType(), [argument.type for argument in arguments])
    builder.call(builder.inttoptr(address, function.as_pointer()), arguments, attrs=("nounwind",))
    return context.get_dummy_value()


def _require_plain(*arrays: Any) -> None:
    for kind in arrays:
        plain = isinstance(kind, types.Array) and kind.dtype == types.float64
        if not (plain and kind.layout == "C"):
            raise TypingError(f"a kernel needs C-contiguous arrays of floats, not {kind}")


# What only compiled loops can do: views of a buffer, calls of kernels; stand-ins in `loop_types`.
INTRINSICS = {
    "vector": vector,
    "matrix": matrix,
    "call_kernel": call_kernel,
    "call_lanes": call_lanes,
    "rows_product": rows_product,
}
