"""Machine code of straight-line kernels, written from their text without type inference.

A kernel of a vehicle has thousands of scalar operations.  The compiler spends seconds on the types
of these, though all are floats, and once more in every loop that calls the kernel.  Here its text
becomes LLVM instructions directly, and its machine code has one place.  Loops call it by its
address, which they get at run time: they are compiled once for all models.  Batches of elementary
functions become vector instructions, from the text of the same scalar functions.
"""

import ast
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from llvmlite import ir

from vehiclemor.codegen import vector_statements, weighted_sums
from vehiclemor.codegen.kernel_statements import SEED, KernelText, places
from vehiclemor.codegen.llvm_expressions import LANE, Expressions
from vehiclemor.codegen.vector_lanes import LANES, RESULTS, WIDTH
from vehiclemor.codegen.weighted_sums import DOUBLE, VECTOR

POINTER = DOUBLE.as_pointer()
BATCHES = {f"{name}_batch": name for name in RESULTS}

Key = str | tuple[str, int]


def kernel_module(kernels: Sequence[KernelText], lanes: int = 1) -> ir.Module:
    """LLVM module of kernels, each a C function of pointers to floats by the kernel's name.

    Parameters
    ----------
    lanes
        Of how many samples a kernel computes the results at once.  If several, its arguments but
        the constants are rows of matrices, and further arguments say how many floats from one row
        to the next, in order.  Of a tangent it is how many directions: only seeds and results are
        rows, and what does not depend on the direction is computed once.
    """
    module = ir.Module("kernels")
    for kernel in kernels:
        strided = kernel.laned if lanes > 1 else []
        kinds = [POINTER] * len(kernel.pointers) + [ir.IntType(64)] * len(strided)
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), kernel.name)
        function.attributes.add("nounwind")
        builder = ir.IRBuilder(function.append_basic_block())
        given = dict(zip(kernel.pointers, function.args, strict=False))
        strides = dict(zip(strided, function.args[len(given) :], strict=True))
        emit(kernel, builder, {name: Rows(given[name], strides.get(name)) for name in given}, lanes)
        builder.ret_void()
    return module


class Rows(NamedTuple):
    """Where a kernel finds an argument: its first float, and the floats from lane to lane."""

    first: Any
    stride: Any = None


def emit(kernel: KernelText, builder: Any, rows: Mapping[str, Rows], lanes: int = 1) -> None:
    """Write the instructions of a kernel where the builder stands.

    Parameters
    ----------
    rows
        Argument -> where it is; the scratch space is nowhere.
    lanes
        Samples at once, see `kernel_module`.

    Raises
    ------
    ValueError
        If the text has anything but straight-line arithmetic.
    """
    writer = _Writer(kernel, builder, rows, lanes)
    for statement in kernel.statements:
        writer.write(statement)


class _Writer:
    """Writes a kernel's statements; knows the values of its names and scratch space."""

    def __init__(
        self, kernel: KernelText, builder: Any, rows: Mapping[str, Rows], lanes: int
    ) -> None:
        self._kernel, self._builder, self._rows, self._lanes = kernel, builder, rows, lanes
        self._expressions = Expressions(builder)
        self._values: dict[Key, Any] = {}
        self._kind = DOUBLE if lanes == 1 else ir.VectorType(DOUBLE, lanes)
        laned = kernel.laned
        self._single = [name for name in kernel.arguments if name not in laned]
        # In other kernels than tangents every value has lanes.
        self._mixed = lanes > 1 and any(name.startswith(SEED) for name in laned)

    def write(self, statement: ast.stmt) -> None:
        values, value = self._values, self._value
        match statement:
            case ast.Assign([ast.Name(target)], expression):
                values[target] = value(expression)
            case ast.Assign([ast.Subscript(ast.Name("_work")) as target], expression):
                values["_work", places(target)[0]] = value(expression)
            case ast.Assign([ast.Subscript(ast.Name("_result")) as target], expression):
                place = places(target)
                if len(place) != self._kernel.dimensions:
                    raise ValueError(f"{ast.unparse(target)}: other results have another shape")
                self._store(value(expression), self._kernel.flat(place))
            case ast.Assign(
                [ast.Tuple(elements)], ast.Call(ast.Name("sincos_one"), [argument], [])
            ) if len(elements) == 2:
                results = self._expressions.elementary("sincos", value(argument))
                values |= zip((ast.unparse(e) for e in elements), results, strict=True)
            case ast.Assign(
                [ast.Tuple(elements)],
                ast.Call(
                    ast.Name("weighted_sums"),
                    [ast.Name(array), ast.Constant(int() as first), ast.Tuple(terms)],
                    [],
                ),
            ):
                # One by one, each used at once: registers are few.
                kind = self._kind_of(ast.Tuple(terms))
                factors = (value(term, kind) for term in terms)
                single = kind == DOUBLE
                sums = weighted_sums.weighted_sums if single else weighted_sums.sums_of_lanes
                results = sums(self._builder, self._address(array, first), factors, len(elements))
                values |= zip((ast.unparse(e) for e in elements), results, strict=True)
            case ast.Expr(
                ast.Call(ast.Name(name), [ast.Name("_work"), ast.Constant(int() as first)], [])
            ) if name in BATCHES:
                given = [values["_work", first + lane] for lane in range(LANES)]
                results = _batch(self._builder, self._expressions, BATCHES[name], given)
                values |= {
                    ("_work", first + LANES + place): result for place, result in enumerate(results)
                }
            case ast.Expr(ast.Call(ast.Name(name)) as call) if name in vector_statements.NAMES:
                vector_statements.write(call, self._builder, self._pointer, value)
            case _:
                raise ValueError(
                    f"{ast.unparse(statement)}: {type(statement).__name__} is not straight-line"
                )

    def _value(self, node: ast.expr, kind: ir.Type | None = None) -> Any:
        kind = kind or self._kind_of(node)
        return self._expressions.value(
            node, lambda part: self._spread(self._read(part), kind), kind
        )

    def _kind_of(self, node: ast.expr) -> ir.Type:
        """Whether an expression is a float or has lanes."""
        if not self._mixed:
            return self._kind
        names = [part.id for part in ast.walk(node) if isinstance(part, ast.Name)]
        return next((self._kind for name in names if self._has_lanes(name)), DOUBLE)

    def _has_lanes(self, name: str) -> bool:
        return name.startswith(SEED) or (name in self._values and self._values[name].type != DOUBLE)

    def _spread(self, value: Any, kind: Any) -> Any:
        if value.type == kind:
            return value
        return weighted_sums.spread(self._builder, value, kind.count)

    def _read(self, node: ast.expr) -> Any:
        # Loads come where they are needed first: registers are few.
        match node:
            case ast.Name(name) if name in self._values:
                return self._values[name]
            case ast.Subscript(ast.Name(array)) if array in self._kernel.arguments:
                place = places(node)
                if array == "_work" and ("_work", place[0]) in self._values:
                    return self._values["_work", place[0]]
                if array != "_work" and len(place) == 1:
                    return self._load(array, place[0])
        raise ValueError(f"{ast.unparse(node)}: unknown, or of the wrong shape")

    def _load(self, name: str, place: int) -> Any:
        builder = self._builder
        number = builder.load(self._address(name, place))
        if self._lanes == 1 or name in self._single:
            return number if self._mixed else self._spread(number, self._kind)
        vector = builder.insert_element(ir.Constant(self._kind, ir.Undefined), number, LANE(0))
        for lane in range(1, self._lanes):
            number = builder.load(self._address(name, place, lane))
            vector = builder.insert_element(vector, number, LANE(lane))
        return vector

    def _store(self, value: Any, place: int) -> None:
        value = self._spread(value, self._kind)
        for lane in range(self._lanes):
            single = value
            if self._lanes > 1:
                single = self._builder.extract_element(value, LANE(lane))
            self._builder.store(single, self._address("_result", place, lane))

    def _pointer(self, node: ast.expr) -> Any:
        assert isinstance(node, ast.Subscript)
        return self._address(ast.unparse(node.value), places(node)[0])

    def _address(self, name: str, place: int, lane: int = 0) -> Any:
        offset = ir.Constant(ir.IntType(64), place)
        if lane:
            stride = ir.Constant(ir.IntType(64), lane)
            offset = self._builder.add(self._builder.mul(self._rows[name].stride, stride), offset)
        return self._builder.gep(self._rows[name].first, [offset])


def _batch(builder: Any, expressions: Expressions, name: str, lanes: Sequence[Any]) -> list[Any]:
    """Results of an elementary function for a batch of arguments, lane by lane."""
    if lanes[0].type != DOUBLE:
        # Vectors already, of samples.
        found = [expressions.elementary(name, lane) for lane in lanes]
        return [results[k] for k in range(len(RESULTS[name])) for results in found]
    places = [ir.Constant(ir.IntType(32), place) for place in range(WIDTH)]
    parts = []
    for first in range(0, LANES, WIDTH):
        vector = ir.Constant(VECTOR, ir.Undefined)
        for lane, place in enumerate(places):
            vector = builder.insert_element(vector, lanes[first + lane], place)
        parts.append(expressions.elementary(name, vector))
    return [
        builder.extract_element(part[result], place)
        for result in range(len(RESULTS[name]))
        for part in parts
        for place in places
    ]
