"""Machine code of straight-line kernels, written from their text without type inference.

A kernel of a vehicle has thousands of scalar operations.  The compiler spends seconds on the types
of these, though all are floats, and once more in every loop that calls the kernel.  Here its text
becomes LLVM instructions directly, and its machine code has one place.  Loops call it by its
address, which they get at run time: they are compiled once for all models.  Batches of elementary
functions become vector instructions, from the text of the same scalar functions.
"""

import ast
import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

from llvmlite import ir

from vehiclemor.codegen import arctangent, exponential, sincos, vector_statements, weighted_sums
from vehiclemor.codegen.vector_lanes import LANES, RESULTS, WIDTH

# A product and a sum may become one operation, as in the loops that are compiled with them.
FLAGS = ("contract",)
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, WIDTH)
# A float plus this has no digits after the point.
SHIFT = 1.5 * 2.0**52
POINTER = DOUBLE.as_pointer()
LANE = ir.IntType(32)
SOURCES: dict[str, ModuleType] = {
    "sincos": sincos,
    "atan": arctangent,
    "exp": exponential,
}
BATCHES = {f"{name}_batch": name for name in RESULTS}
LLVM_FUNCTIONS = {
    "math.sqrt": "llvm.sqrt",
    "math.log": "llvm.log",
    "math.sin": "llvm.sin",
    "math.cos": "llvm.cos",
    "math.fabs": "llvm.fabs",
    "abs": "llvm.fabs",
    "np.abs": "llvm.fabs",
    "np.floor": "llvm.floor",
}
# Functions of the C library, with as many arguments as Python's.
LIBRARY = ("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")
COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}

Key = str | tuple[str, int]


class _Expressions:
    """Writes the instructions of expressions of floats, or of vectors of floats."""

    def __init__(self, builder: Any) -> None:
        self._builder = builder

    def value(self, node: ast.expr, names: Callable[[ast.expr], Any], kind: ir.Type) -> Any:
        """Value of an expression; `names` gives those of its names and array entries."""
        match node:
            case ast.Constant(value=float() as number):
                return _constant(kind, number)
            case ast.Name() | ast.Subscript():
                return names(node)
            case ast.BinOp(left, operator, right):
                left = self.value(left, names, kind)
                right = self.value(right, names, kind)
                return self._binary(node, operator, left, right)
            case ast.UnaryOp(ast.USub(), ast.Constant(value=float() as number)):
                return _constant(kind, -number)
            case ast.UnaryOp(ast.USub(), operand):
                return self._builder.fneg(self.value(operand, names, kind), flags=FLAGS)
            case ast.IfExp(test, body, orelse):
                return self._builder.select(
                    self.value(test, names, kind),
                    self.value(body, names, kind),
                    self.value(orelse, names, kind),
                )
            case ast.Compare(left, [operator], [right]) if type(operator) in COMPARISONS:
                # An inequality holds where one side is not a number; other comparisons don't.
                unordered = isinstance(operator, ast.NotEq)
                compare = self._builder.fcmp_unordered if unordered else self._builder.fcmp_ordered
                return compare(
                    COMPARISONS[type(operator)],
                    self.value(left, names, kind),
                    self.value(right, names, kind),
                )
            case ast.Call(function, arguments, []):
                return self._call(
                    node, ast.unparse(function), [self.value(a, names, kind) for a in arguments]
                )
        raise ValueError(f"{ast.unparse(node)}: {type(node).__name__} is not straight-line")

    def elementary(self, name: str, argument: Any) -> tuple[Any, ...]:
        """Results of `sincos` or `atan` of a float or a vector, from the text of the function."""
        constants, function = _elementary(name)
        values: dict[str, Any] = {function.args.args[0].arg: argument}

        def read(node: ast.expr) -> Any:
            if isinstance(node, ast.Name) and node.id in values:
                return values[node.id]
            if isinstance(node, ast.Name) and node.id in constants:
                return _constant(argument.type, constants[node.id])
            raise ValueError(f"{ast.unparse(node)}: unknown in {name}")

        for statement in function.body:
            match statement:
                case ast.Assign([ast.Name(target)], expression):
                    values[target] = self.value(expression, read, argument.type)
                case ast.Return(ast.Tuple(elements)):
                    return tuple(self.value(e, read, argument.type) for e in elements)
                case ast.Return(ast.expr() as expression):
                    return (self.value(expression, read, argument.type),)
                case _:
                    raise ValueError(f"{ast.unparse(statement)}: not straight-line")
        raise ValueError(f"{name} returns nothing")

    def _binary(self, node: ast.expr, operator: ast.operator, left: Any, right: Any) -> Any:
        match operator:
            case ast.Add():
                return self._builder.fadd(left, right, flags=FLAGS)
            case ast.Sub():
                return self._builder.fsub(left, right, flags=FLAGS)
            case ast.Mult():
                return self._builder.fmul(left, right, flags=FLAGS)
            case ast.Div():
                return self._builder.fdiv(left, right, flags=FLAGS)
            case ast.Pow():
                power = _function(self._builder, "llvm.pow", left.type, left.type)
                return self._builder.call(power, [left, right])
        raise ValueError(f"{ast.unparse(node)}: {type(operator).__name__} is not straight-line")

    def _call(self, node: ast.expr, name: str, arguments: list[Any]) -> Any:
        if name in LLVM_FUNCTIONS and len(arguments) == 1:
            kind = arguments[0].type
            return self._builder.call(
                _function(self._builder, LLVM_FUNCTIONS[name], kind), arguments
            )
        if name in {"atan", "math.exp"} and len(arguments) == 1:
            return self.elementary(name.removeprefix("math."), arguments[0])[0]
        if name == "power_of_two" and len(arguments) == 1:
            return self._power_of_two(arguments[0])
        if name.removeprefix("math.") in LIBRARY and name.startswith("math."):
            return self._library(name.removeprefix("math."), arguments)
        raise ValueError(f"{ast.unparse(node)}: {name} is not straight-line")

    def _library(self, name: str, arguments: list[Any]) -> Any:
        builder, kind = self._builder, arguments[0].type
        function = _declared(builder, name, DOUBLE, [DOUBLE] * len(arguments))
        if kind == DOUBLE:
            return builder.call(function, arguments)
        results = ir.Constant(kind, ir.Undefined)
        for lane in range(kind.count):
            single = [builder.extract_element(a, LANE(lane)) for a in arguments]
            single = builder.call(function, single)
            results = builder.insert_element(results, single, LANE(lane))
        return results

    def _power_of_two(self, number: Any) -> Any:
        # The last bits of the sum are the whole number, also a negative one.
        builder, whole = self._builder, ir.IntType(64)
        if number.type != DOUBLE:
            whole = ir.VectorType(whole, number.type.count)
        bits = builder.bitcast(builder.fadd(number, _constant(number.type, SHIFT)), whole)
        biased = builder.add(bits, _whole(whole, 1023))
        return builder.bitcast(builder.shl(biased, _whole(whole, 52)), number.type)


def _function(builder: Any, name: str, *kinds: Any) -> Any:
    """An LLVM function of floats or vectors, by its name without the suffix of its type."""
    suffix = "f64" if kinds[0] == DOUBLE else f"v{kinds[0].count}f64"
    return _declared(builder, f"{name}.{suffix}", kinds[0], kinds)


def _declared(builder: Any, name: str, returned: ir.Type, kinds: Sequence[ir.Type]) -> Any:
    """An outside function, declared once in a module."""
    known = builder.module.globals
    if name not in known:
        return ir.Function(builder.module, ir.FunctionType(returned, kinds), name)
    return known[name]


def _constant(kind: Any, number: float) -> ir.Constant:
    return ir.Constant(kind, number if kind == DOUBLE else [number] * kind.count)


def _whole(kind: Any, number: int) -> ir.Constant:
    return ir.Constant(kind, number if kind == ir.IntType(64) else [number] * kind.count)


@cache
def _elementary(name: str) -> tuple[dict[str, float], ast.FunctionDef]:
    """Constants of an elementary function's module, and the function without its docstring."""
    module = SOURCES[name]
    tree = ast.parse(inspect.getsource(module))
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == name)
    function.body = function.body[1:]
    return {k: v for k, v in vars(module).items() if isinstance(v, float)}, function


class KernelText:
    """Text of a kernel as statements that know what they need and what they define.

    Attributes
    ----------
    name, arguments
        Of the kernel; scratch space is an argument of the text, not of the machine code.
    sizes
        Argument -> smallest number of floats.
    dimensions
        Of the result.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        tree = ast.parse(text).body
        if len(tree) != 1 or not isinstance(tree[0], ast.FunctionDef):
            raise ValueError("a kernel is one function")
        self.name = tree[0].name
        self.arguments = [a.arg for a in tree[0].args.args]
        self.statements = [n for n in tree[0].body if not isinstance(n, ast.Pass)]
        places = [
            _places(target)
            for node in self.statements
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Subscript) and ast.unparse(target.value) == "_result"
        ]
        self.dimensions = max((len(place) for place in places), default=1)
        # Every place of a result is written, so the largest tells its shape.
        self.columns = 1 + max((place[-1] for place in places), default=0)
        self.sizes = dict.fromkeys(self.arguments, 0)
        for node in ast.walk(tree[0]):
            if isinstance(node, ast.Subscript) and (name := ast.unparse(node.value)) in self.sizes:
                place = _places(node)
                flat = place[0] if len(place) == 1 else place[0] * self.columns + place[1]
                self.sizes[name] = max(self.sizes[name], flat + 1)
            match node:
                case ast.Assign(
                    [ast.Tuple(targets)], ast.Call(ast.Name("weighted_sums"), [array, *_]) as call
                ):
                    read = weighted_sums.reach(call, len(targets))
                    self.sizes[ast.unparse(array)] = max(self.sizes[ast.unparse(array)], read)

    @property
    def pointers(self) -> list[str]:
        """Arguments that the machine code takes: scratch space is not needed."""
        return [name for name in self.arguments if name != "_work"]


def _places(node: ast.Subscript) -> tuple[int, ...]:
    elements = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    places = [e.value for e in elements if isinstance(e, ast.Constant) and isinstance(e.value, int)]
    if len(places) != len(elements) or len(places) > 2:
        raise ValueError(f"{ast.unparse(node)}: an index is not constant")
    return tuple(places)


def kernel_module(kernels: Sequence[KernelText], lanes: int = 1) -> ir.Module:
    """LLVM module of kernels, each a C function of pointers to floats by the kernel's name.

    Parameters
    ----------
    lanes
        Of how many samples a kernel computes the results at once.  If several, its arguments but
        the constants are rows of matrices, and further arguments say how many floats from one row
        to the next, in order.
    """
    module = ir.Module("kernels")
    for kernel in kernels:
        strided = [name for name in kernel.pointers if name != "_constants"] if lanes > 1 else []
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
    expressions = _Expressions(builder)
    values: dict[Key, Any] = {}
    kind = DOUBLE if lanes == 1 else ir.VectorType(DOUBLE, lanes)

    def address(name: str, place: int, lane: int = 0) -> Any:
        offset = ir.Constant(ir.IntType(64), place)
        if lane:
            moved = builder.mul(rows[name].stride, ir.Constant(ir.IntType(64), lane))
            offset = builder.add(moved, offset)
        return builder.gep(rows[name].first, [offset])

    def load(name: str, place: int) -> Any:
        number = builder.load(address(name, place))
        if lanes == 1:
            return number
        if name == "_constants":
            return weighted_sums.spread(builder, number, lanes)
        vector = builder.insert_element(ir.Constant(kind, ir.Undefined), number, LANE(0))
        for lane in range(1, lanes):
            number = builder.load(address(name, place, lane))
            vector = builder.insert_element(vector, number, LANE(lane))
        return vector

    def store(value: Any, place: int) -> None:
        for lane in range(lanes):
            single = value if lanes == 1 else builder.extract_element(value, LANE(lane))
            builder.store(single, address("_result", place, lane))

    def pointer(node: ast.expr) -> Any:
        assert isinstance(node, ast.Subscript)
        return address(ast.unparse(node.value), _places(node)[0])

    def value(node: ast.expr) -> Any:
        return expressions.value(node, read, kind)

    def read(node: ast.expr) -> Any:
        # Loads come where they are needed first: registers are few.
        match node:
            case ast.Name(name) if name in values:
                return values[name]
            case ast.Subscript(ast.Name(array)) if array in kernel.arguments:
                places = _places(node)
                if array == "_work" and ("_work", places[0]) in values:
                    return values["_work", places[0]]
                if array != "_work" and len(places) == 1:
                    return load(array, places[0])
        raise ValueError(f"{ast.unparse(node)}: unknown, or of the wrong shape")

    for statement in kernel.statements:
        match statement:
            case ast.Assign([ast.Name(target)], expression):
                values[target] = value(expression)
            case ast.Assign([ast.Subscript(ast.Name("_work")) as target], expression):
                values["_work", _places(target)[0]] = value(expression)
            case ast.Assign([ast.Subscript(ast.Name("_result")) as target], expression):
                place = _places(target)
                if len(place) != kernel.dimensions:
                    raise ValueError(f"{ast.unparse(target)}: other results have another shape")
                flat = place[0] if len(place) == 1 else place[0] * kernel.columns + place[1]
                store(value(expression), flat)
            case ast.Assign(
                [ast.Tuple(elements)], ast.Call(ast.Name("sincos_one"), [argument], [])
            ) if len(elements) == 2:
                results = expressions.elementary("sincos", value(argument))
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
                factors = (value(term) for term in terms)
                sums = weighted_sums.weighted_sums if lanes == 1 else weighted_sums.sums_of_lanes
                results = sums(builder, address(array, first), factors, len(elements))
                values |= zip((ast.unparse(e) for e in elements), results, strict=True)
            case ast.Expr(
                ast.Call(ast.Name(name), [ast.Name("_work"), ast.Constant(int() as first)], [])
            ) if name in BATCHES:
                given = [values["_work", first + lane] for lane in range(LANES)]
                results = _batch(builder, expressions, BATCHES[name], given)
                values |= {
                    ("_work", first + LANES + place): result for place, result in enumerate(results)
                }
            case ast.Expr(ast.Call(ast.Name(name)) as call) if name in vector_statements.NAMES:
                vector_statements.write(call, builder, pointer, value)
            case _:
                raise ValueError(
                    f"{ast.unparse(statement)}: {type(statement).__name__} is not straight-line"
                )


def _batch(builder: Any, expressions: _Expressions, name: str, lanes: Sequence[Any]) -> list[Any]:
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
