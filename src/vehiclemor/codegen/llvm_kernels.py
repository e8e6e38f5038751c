"""Machine code of straight-line kernels, written from their operations without type inference.

A kernel of a vehicle has thousands of scalar operations.  Inferring their types would take seconds,
though all are floats.  Here they become LLVM instructions directly.  Loops call kernels by address,
which they receive at run time: loops are compiled once for all models.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite import ir

from vehiclemor.codegen import instructions
from vehiclemor.codegen.elementary import ELEMENTARY
from vehiclemor.codegen.instructions import DOUBLE, LANE, POINTER, VECTOR
from vehiclemor.codegen.operations import (
    LANES,
    SEED,
    VECTOR_STATEMENTS,
    WIDTH,
    Kernel,
    Operation,
    is_entry,
)


def kernel_module(kernel: Kernel, lanes: int = 1) -> ir.Module:
    """LLVM module of a kernel: a C function of pointers to floats by the kernel's name.

    With several lanes it computes so many samples at once: the arguments in `Kernel.by_row` are
    matrices with a row for each, and further arguments are the distances of their rows in floats.
    Values that don't depend on the row are computed once.
    """
    module = ir.Module("kernels")
    strided = kernel.by_row if lanes > 1 else []
    kinds = [POINTER] * len(kernel.arguments) + [ir.IntType(64)] * len(strided)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), kernel.name)
    function.attributes.add("nounwind")
    if any(name.startswith(SEED) for name in kernel.arguments):
        # Keeps LLVM from a long search for statements to pack (SLP), which gains nothing here.
        function.attributes.add("noimplicitfloat")
    builder = ir.IRBuilder(function.append_basic_block())
    pointers = dict(zip(kernel.arguments, function.args, strict=False))
    strides = dict(zip(strided, function.args[len(pointers) :], strict=True))
    writer = _Writer(kernel, builder, pointers, strides, lanes)
    for number in kernel.named:
        writer.value(number)
    builder.ret_void()
    return module


class _Writer:
    """Writes the operations of a kernel, each when a named one first needs it."""

    def __init__(
        self,
        kernel: Kernel,
        builder: Any,
        # Of the arguments: addresses of their first floats, and distances of their rows in floats.
        pointers: Mapping[str, Any],
        strides: Mapping[str, Any],
        lanes: int,
    ) -> None:
        self._operations, self._builder = kernel.operations, builder
        self._pointers, self._strides, self._lanes = pointers, strides, lanes
        self._values: dict[int, Any] = {}
        # Entries without a name are loaded again for each use: registers are few.
        entries = {n for n, op in enumerate(kernel.operations) if op.kind == "entry"}
        self._fleeting = entries.difference(kernel.named)
        by_row = kernel.by_row
        self._single = [name for name in kernel.arguments if name not in by_row]
        # Only derivatives have values that are the same for all rows.
        self._mixed = any(name.startswith(SEED) for name in by_row)

    def value(self, number: int) -> Any:
        """Value of an operation: one, several or none, as its kind has results."""
        # Without recursion: operations of files may be deeper than Python allows.
        pending = [number]
        while pending:
            kind, arguments, _ = operation = self._operations[pending[-1]]
            missing = [n for n in arguments if n not in self._values] if kind != "sums" else []
            if missing:
                pending += reversed(missing)
            elif (last := pending.pop()) not in self._values:
                self._values[last] = self._written(operation)
                for entry in self._fleeting.intersection(arguments):
                    self._values.pop(entry, None)
        return self._values[number]

    def _alike(self, values: Sequence[Any]) -> list[Any]:
        """The values as vectors if one of them is a vector."""
        wide = next((v.type for v in values if isinstance(v.type, ir.VectorType)), None)
        if wide is None:
            return list(values)
        return [self._spread(value, wide.count) for value in values]

    def _spread(self, value: Any, width: int) -> Any:
        # A condition may stay one for all lanes.
        return instructions.spread(self._builder, value, width) if value.type == DOUBLE else value

    def _written(self, operation: Operation) -> Any:
        kind, arguments, detail = operation
        if kind == "sums":
            return self._sums(arguments, *detail)
        values = [self._values[number] for number in arguments]
        match kind:
            case "number":
                single = self._mixed or self._lanes == 1
                of = DOUBLE if single else ir.VectorType(DOUBLE, self._lanes)
                return instructions.constant(of, detail)
            case "entry":
                return self._load(*detail)
            case "store":
                return self._store(values[0], detail)
            case "batch":
                return self._batch(detail, values)
            case "part":
                return values[0][detail]
            case _ if kind in VECTOR_STATEMENTS:
                parts = [self._address(*d) if is_entry(d) else d for d in detail]
                return instructions.write(kind, self._builder, parts, values)
            case _ if kind in ELEMENTARY:
                results = instructions.elementary(self._builder, kind, *values)
                return results if kind == "sincos" else results[0]
        return instructions.arithmetic(self._builder, kind, self._alike(values))

    def _sums(self, arguments: Sequence[int], array: str, first: int, targets: int) -> list[Any]:
        # A generator: each factor is used as soon as it is computed, since registers are few.
        factors = (self.value(number) for number in arguments)
        address = self._address(array, first)
        if self._lanes > 1:
            factors = self._alike(list(factors))
            if factors[0].type != DOUBLE:
                return instructions.sums_of_lanes(self._builder, address, factors, targets)
        return instructions.weighted_sums(self._builder, address, factors, targets)

    def _load(self, name: str, index: int) -> Any:
        builder = self._builder
        number = builder.load(self._address(name, index))
        if self._lanes == 1 or name in self._single:
            return number if self._mixed else self._spread_to_lanes(number)
        kind = ir.VectorType(DOUBLE, self._lanes)
        vector = builder.insert_element(ir.Constant(kind, ir.Undefined), number, LANE(0))
        for lane in range(1, self._lanes):
            number = builder.load(self._address(name, index, lane))
            vector = builder.insert_element(vector, number, LANE(lane))
        return vector

    def _spread_to_lanes(self, value: Any) -> Any:
        return value if self._lanes == 1 else self._spread(value, self._lanes)

    def _store(self, value: Any, index: int) -> None:
        value = self._spread_to_lanes(value)
        for lane in range(self._lanes):
            single = self._builder.extract_element(value, LANE(lane)) if self._lanes > 1 else value
            self._builder.store(single, self._address("_result", index, lane))

    def _address(self, name: str, index: int, lane: int = 0) -> Any:
        offset = ir.Constant(ir.IntType(64), index)
        if lane:
            stride = ir.Constant(ir.IntType(64), lane)
            offset = self._builder.add(self._builder.mul(self._strides[name], stride), offset)
        return self._builder.gep(self._pointers[name], [offset])

    def _batch(self, name: str, arguments: Sequence[Any]) -> list[Any]:
        """Results of an elementary function for a batch of arguments, one function first."""
        builder, arguments = self._builder, self._alike(arguments)
        if arguments[0].type != DOUBLE:
            # The arguments are vectors of samples already.
            results = [instructions.elementary(builder, name, argument) for argument in arguments]
            return [value for values in zip(*results, strict=True) for value in values]
        lanes, parts = [LANE(lane) for lane in range(WIDTH)], []
        for first in range(0, LANES, WIDTH):
            vector = ir.Constant(VECTOR, ir.Undefined)
            for k, lane in enumerate(lanes):
                vector = builder.insert_element(vector, arguments[first + k], lane)
            parts.append(instructions.elementary(builder, name, vector))
        return [
            builder.extract_element(vector, lane)
            for vectors in zip(*parts, strict=True)
            for vector in vectors
            for lane in lanes
        ]
