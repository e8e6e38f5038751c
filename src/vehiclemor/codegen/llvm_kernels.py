"""Machine code of straight-line kernels, written from their operations without type inference.

A kernel of a vehicle has thousands of scalar operations.  The compiler spends seconds on the types
of these, though all are floats, and once more in every loop that calls the kernel.  Here they
become LLVM instructions directly, and the machine code has one place.  Loops call it by its
address, which they get at run time: they are compiled once for all models.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from llvmlite import ir

from vehiclemor.codegen import llvm_vectors
from vehiclemor.codegen.elementary import ELEMENTARY
from vehiclemor.codegen.llvm_arithmetic import (
    DOUBLE,
    LANE,
    VECTOR,
    arithmetic,
    constant,
    elementary,
)
from vehiclemor.codegen.operations import SEED, VECTOR_STATEMENTS, Kernel, Operation, is_entry
from vehiclemor.codegen.vector_lanes import LANES, WIDTH

POINTER = DOUBLE.as_pointer()


def kernel_module(kernels: Sequence[Kernel], lanes: int = 1) -> ir.Module:
    """LLVM module of kernels, each a C function of pointers to floats by the kernel's name.

    Of several lanes, samples that it computes at once, arguments are rows of matrices as
    `Kernel.by_row` says, and further arguments say how many floats from one row to the next, in
    order.  What does not depend on the row is computed once.
    """
    module = ir.Module("kernels")
    for kernel in kernels:
        strided = kernel.by_row if lanes > 1 else []
        kinds = [POINTER] * len(kernel.arguments) + [ir.IntType(64)] * len(strided)
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), kernel.name)
        function.attributes.add("nounwind")
        builder = ir.IRBuilder(function.append_basic_block())
        given = dict(zip(kernel.arguments, function.args, strict=False))
        strides = dict(zip(strided, function.args[len(given) :], strict=True))
        emit(kernel, builder, {name: Rows(given[name], strides.get(name)) for name in given}, lanes)
        builder.ret_void()
    return module


class Rows(NamedTuple):
    """Where a kernel finds an argument: its first float, and the floats from row to row."""

    first: Any
    stride: Any = None


def emit(kernel: Kernel, builder: Any, rows: Mapping[str, Rows], lanes: int = 1) -> None:
    """Write a kernel where the builder stands; rows tell where its arguments are."""
    writer = _Writer(kernel, builder, rows, lanes)
    for number in kernel.named:
        writer.value(number)


class _Writer:
    """Writes the operations of a kernel, each when it is first needed."""

    def __init__(self, kernel: Kernel, builder: Any, rows: Mapping[str, Rows], lanes: int) -> None:
        self._operations, self._builder = kernel.operations, builder
        self._rows, self._lanes = rows, lanes
        self._values: dict[int, Any] = {}
        # Entries without a name are read anew wherever they are needed: registers are few.
        entries = {n for n, op in enumerate(kernel.operations) if op.kind == "entry"}
        self._fleeting = entries.difference(kernel.named)
        by_row = kernel.by_row
        self._single = [name for name in kernel.arguments if name not in by_row]
        # In other kernels than derivatives every value is one of the row's.
        self._mixed = any(name.startswith(SEED) for name in by_row)

    def value(self, number: int) -> Any:
        """The value of an operation; of several results, or none, what there is."""
        # A stack of its own: operations of files may be deeper than Python's recursion goes.
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
        """Values, floats among vectors in all lanes."""
        wide = next((v.type for v in values if isinstance(v.type, ir.VectorType)), None)
        if wide is None:
            return list(values)
        return [self._spread(value, wide.count) for value in values]

    def _spread(self, value: Any, width: int) -> Any:
        # The choice between vectors may be one for all lanes.
        return llvm_vectors.spread(self._builder, value, width) if value.type == DOUBLE else value

    def _written(self, operation: Operation) -> Any:
        kind, arguments, detail = operation
        if kind == "sums":
            return self._sums(arguments, *detail)
        values = [self._values[number] for number in arguments]
        match kind:
            case "number":
                count = 1 if self._mixed else self._lanes
                return constant(DOUBLE if count == 1 else ir.VectorType(DOUBLE, count), detail)
            case "entry":
                return self._load(*detail)
            case "store":
                return self._store(values[0], detail)
            case "batch":
                return self._batch(detail, values)
            case "part":
                return values[0][detail]
            case _ if kind in VECTOR_STATEMENTS:
                places = [self._address(*d) if is_entry(d) else d for d in detail]
                return llvm_vectors.write(kind, self._builder, places, values)
            case _ if kind in ELEMENTARY:
                results = elementary(self._builder, kind, *values)
                return results if kind == "sincos" else results[0]
        return arithmetic(self._builder, kind, self._alike(values))

    def _sums(self, arguments: Sequence[int], array: str, first: int, targets: int) -> list[Any]:
        # One by one, each used at once: registers are few.
        factors = (self.value(number) for number in arguments)
        address = self._address(array, first)
        if self._lanes > 1:
            factors = self._alike(list(factors))
            if factors[0].type != DOUBLE:
                return llvm_vectors.sums_of_lanes(self._builder, address, factors, targets)
        return llvm_vectors.weighted_sums(self._builder, address, factors, targets)

    def _load(self, name: str, place: int) -> Any:
        builder = self._builder
        number = builder.load(self._address(name, place))
        if self._lanes == 1 or name in self._single:
            return number if self._mixed else self._spread_to_lanes(number)
        kind = ir.VectorType(DOUBLE, self._lanes)
        vector = builder.insert_element(ir.Constant(kind, ir.Undefined), number, LANE(0))
        for lane in range(1, self._lanes):
            number = builder.load(self._address(name, place, lane))
            vector = builder.insert_element(vector, number, LANE(lane))
        return vector

    def _spread_to_lanes(self, value: Any) -> Any:
        return value if self._lanes == 1 else self._spread(value, self._lanes)

    def _store(self, value: Any, place: int) -> None:
        value = self._spread_to_lanes(value)
        for lane in range(self._lanes):
            single = value
            if self._lanes > 1:
                single = self._builder.extract_element(value, LANE(lane))
            self._builder.store(single, self._address("_result", place, lane))

    def _address(self, name: str, place: int, lane: int = 0) -> Any:
        offset = ir.Constant(ir.IntType(64), place)
        if lane:
            stride = ir.Constant(ir.IntType(64), lane)
            offset = self._builder.add(self._builder.mul(self._rows[name].stride, stride), offset)
        return self._builder.gep(self._rows[name].first, [offset])

    def _batch(self, name: str, arguments: Sequence[Any]) -> list[Any]:
        """Results of an elementary function for a batch of arguments, one function first."""
        builder, arguments = self._builder, self._alike(arguments)
        if arguments[0].type != DOUBLE:
            # Vectors already, of samples.
            found = [elementary(builder, name, argument) for argument in arguments]
            return [value for values in zip(*found, strict=True) for value in values]
        places = [ir.Constant(ir.IntType(32), place) for place in range(WIDTH)]
        parts = []
        for first in range(0, LANES, WIDTH):
            vector = ir.Constant(VECTOR, ir.Undefined)
            for lane, place in enumerate(places):
                vector = builder.insert_element(vector, arguments[first + lane], place)
            parts.append(elementary(builder, name, vector))
        return [
            builder.extract_element(vector, place)
            for vectors in zip(*parts, strict=True)
            for vector in vectors
            for place in places
        ]
