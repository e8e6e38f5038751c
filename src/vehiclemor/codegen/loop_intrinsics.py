"""What only compiled loops can do: views of a buffer, calls of kernels, kernels in place."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from vehiclemor.codegen.llvm_kernels import Rows, emit
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.codegen.weighted_sums import DOUBLE, FLAGS, spread

WORD = ir.IntType(64)


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
        size, strides = WORD(8), []
        for length in reversed(shape):
            strides.insert(0, size)
            size = builder.mul(size, length)
        array = context.make_array(kind)(context, builder)
        populate_array(
            array,
            data=builder.gep(buffer.data, [first]),
            shape=shape,
            strides=strides,
            itemsize=WORD(8),
            meminfo=None,
        )
        return array._getvalue()

    return generate


@intrinsic
def call_kernel(
    typing_context: Any, kernels: Any, place: Any, x: Any, u: Any, constants: Any, result: Any
) -> Any:
    """See `loop_types.call_kernel`; the arrays must be as long as the kernel wants them."""
    del typing_context
    _require_plain(x, u, constants, result)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = context.cast(builder, args[1], sig.args[1], types.intp)
        address = builder.load(builder.gep(_data(context, builder, sig, args, 0), [place]))
        pointers = [_data(context, builder, sig, args, k) for k in range(2, 6)]
        # Steps execute others themselves; a kernel that takes no such argument doesn't see it.
        pointers.append(builder.bitcast(_data(context, builder, sig, args, 0), DOUBLE.as_pointer()))
        kind = ir.FunctionType(ir.VoidType(), [DOUBLE.as_pointer()] * len(pointers))
        function = builder.inttoptr(address, kind.as_pointer())
        builder.call(function, pointers, attrs=("nounwind",))
        return context.get_dummy_value()

    return types.void(kernels, place, x, u, constants, result), generate


@intrinsic
def call_lanes(
    typing_context: Any,
    kernels: Any,
    place: Any,
    path: Any,
    inputs: Any,
    constants: Any,
    result: Any,
    first: Any,
) -> Any:
    """See `loop_types.call_lanes`; the matrices must have as many rows and columns."""
    del typing_context
    _require_plain(path, inputs, constants, result)
    arguments = kernels, place, path, inputs, constants, result, first
    return types.void(*arguments), _call_of_rows


def _call_of_rows(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Call a kernel: matrices from a row on, the last argument, with the length of their rows."""
    last = len(args) - 1
    place, first = (context.cast(builder, args[k], sig.args[k], types.intp) for k in (1, last))
    address = builder.load(builder.gep(_data(context, builder, sig, args, 0), [place]))
    pointers, strides = [], []
    for k in range(2, last):
        array = context.make_array(sig.args[k])(context, builder, args[k])
        pointers.append(array.data)
        if sig.args[k].ndim == 2:
            strides.append(cgutils.unpack_tuple(builder, array.shape)[1])
            pointers[-1] = builder.gep(array.data, [builder.mul(first, strides[-1])])
    kinds = [DOUBLE.as_pointer()] * len(pointers) + [WORD] * len(strides)
    function = builder.inttoptr(address, ir.FunctionType(ir.VoidType(), kinds).as_pointer())
    builder.call(function, pointers + strides, attrs=("nounwind",))
    return context.get_dummy_value()


@intrinsic
def mixed_rows(typing_context: Any, rows: Any, weights: Any, result: Any) -> Any:
    """See `loop_types.mixed_rows`; in vectors as long as a cache line."""
    del typing_context
    _require_plain(rows, result)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.VectorType(DOUBLE, LANES)
        result = context.make_array(sig.args[2])(context, builder, args[2])
        (width,) = cgutils.unpack_tuple(builder, result.shape)
        weights = [spread(builder, w, LANES) for w in cgutils.unpack_tuple(builder, args[1])]
        steps = WORD(0), width, WORD(LANES)
        with cgutils.for_range_slice(builder, *steps) as (column, _):
            place, terms = column, []
            for weight in weights:
                pointer = builder.gep(_data(context, builder, sig, args, 0), [place])
                row = builder.load(builder.bitcast(pointer, kind.as_pointer()), align=8)
                terms.append(builder.fmul(weight, row, flags=FLAGS))
                place = builder.add(place, width)
            while len(terms) > 1:
                first, second, *terms = terms
                terms.append(builder.fadd(first, second, flags=FLAGS))
            pointer = builder.bitcast(builder.gep(result.data, [column]), kind.as_pointer())
            builder.store(terms[0], pointer, align=8)
        return context.get_dummy_value()

    return types.void(rows, weights, result), generate


def inlined_kernel(kernel: Kernel) -> Any:
    """A kernel whose instructions are written where a loop calls it, given its arrays."""

    @intrinsic
    def execute(typing_context: Any, *arrays: Any) -> Any:
        del typing_context
        _require_plain(*arrays)
        if len(arrays) != len(kernel.arguments):
            raise TypingError(f"{kernel.name} takes {', '.join(kernel.arguments)}")

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kinds = sig.args[0]
            given = cgutils.unpack_tuple(builder, args[0], len(kinds))
            rows = [
                Rows(context.make_array(kind)(context, builder, value).data)
                for kind, value in zip(kinds, given, strict=True)
            ]
            emit(kernel, builder, dict(zip(kernel.arguments, rows, strict=True)))
            return context.get_dummy_value()

        void: Any = types.void
        return void(types.StarArgTuple.from_types(arrays)), generate

    return execute


def _require_plain(*arrays: Any) -> None:
    for kind in arrays:
        plain = isinstance(kind, types.Array) and kind.dtype == types.float64
        if not (plain and kind.layout == "C"):
            raise TypingError(f"a kernel needs C-contiguous arrays of floats, not {kind}")


def _data(context: Any, builder: Any, sig: Any, args: Any, place: int) -> Any:
    return context.make_array(sig.args[place])(context, builder, args[place]).data
