"""Kernels as lists of operations: what compilers, printers and derivatives read.

A kernel is written as a Python function of one statement after the other.  Nothing of its text is
run: it is read here, once, and what is not one of the operations below is refused.

    a = b * _x[0] - 2.0                   arithmetic of names, entries of arguments and numbers
    a = b if c < d else e                 also with <=, >, >=, ==, !=
    a = math.sqrt(b)                      see `FUNCTIONS`
    sine, cosine = sincos_one(a)
    _work[3] = a                          arguments of a batch, then
    sincos_batch(_work, 0)                `LANES` of them at once; results stand behind them
    (a, b,) = weighted_sums(_c, 7, (...)) see `weighted_sums`
    combine(_result[0], 3, a, _x[0])      see `vector_statements`
    _result[0] = a                        or _result[0, 1]
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

from vehiclemor.codegen.vector_lanes import LANES, RESULTS, padded

# Before the name of an argument: the argument's direction, see `tangent`.
SEED = "_seed"
ARITHMETIC = {
    ast.Add: "add",
    ast.Sub: "subtract",
    ast.Mult: "multiply",
    ast.Div: "divide",
    ast.Pow: "power",
}
SIGNS = {"add": "+", "subtract": "-", "multiply": "*", "divide": "/", "power": "**"}
COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
# As texts write it -> kind of operation.
FUNCTIONS = {
    f"math.{name}": name
    for name in (
        *("sqrt", "log", "exp", "sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
        *("sinh", "cosh", "tanh"),
    )
} | {
    "atan": "atan",
    "power_of_two": "power_of_two",
    "np.floor": "floor",
    **dict.fromkeys(("abs", "np.abs", "math.fabs"), "abs"),
}
BATCHES = {f"{name}_batch": name for name in RESULTS}
VECTOR_STATEMENTS = ("combine", "magnitudes", "product", "execute")
# Expressions within one another; the largest of this package is 34 deep.
DEEPEST = 140


class Operation(NamedTuple):
    """One operation of a kernel.

    Attributes
    ----------
    kind
        `number`, `entry` (of an argument), one of `SIGNS` or `FUNCTIONS`, `negate`, `select`, a
        comparison; `sincos`, `batch` and `sums`, of whose results each is a `part`; `store`, or one
        of `VECTOR_STATEMENTS`.
    arguments
        Numbers of the operations whose values it takes.
    detail
        Value of a number; array and place of an entry; number of a part; name of a batch; array,
        first place and number of sums; place of a store; of a vector statement its arguments, those
        that are pointers as (array, place).
    """

    kind: str
    arguments: tuple[int, ...] = ()
    detail: Any = None


class Listing:
    """Operations that are written one after the other."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []

    def new(self, kind: str, *arguments: int, detail: Any = None) -> int:
        """Write an operation; its number."""
        self.operations.append(Operation(kind, arguments, detail))
        return len(self.operations) - 1


class Kernel:
    """A kernel's text as operations.

    Attributes
    ----------
    name, arguments
        Of the kernel; scratch space is an argument of the text, not of the machine code.
    operations
        In order.
    anchors
        Numbers of those that statements name, store or execute, in order; others are parts of their
        expressions.
    sizes
        Argument -> smallest number of floats.
    dimensions, columns
        Of the result, and the length of its rows.
    """

    def __init__(self, text: str) -> None:
        tree = ast.parse(text).body
        if len(tree) != 1 or not isinstance(tree[0], ast.FunctionDef):
            raise ValueError("a kernel is one function")
        self.text, self.name = text, tree[0].name
        self.arguments = [argument.arg for argument in tree[0].args.args]
        reader = Reader(self.arguments)
        for statement in tree[0].body:
            reader.read(statement)
        self.operations, self.anchors, self.sizes = reader.operations, reader.anchors, reader.sizes
        stores = {n: op.detail for n, op in enumerate(self.operations) if op.kind == "store"}
        self.dimensions = max(map(len, stores.values()), default=1)
        # Every place of a result is written, so the largest tells its shape.
        self.columns = 1 + max((place[-1] for place in stores.values()), default=0)
        for number, place in stores.items():
            if len(place) != self.dimensions:
                raise ValueError("results have more than one shape")
            flat = place[0] if len(place) == 1 else place[0] * self.columns + place[1]
            self.operations[number] = self.operations[number]._replace(detail=flat)
            self.sizes["_result"] = max(self.sizes["_result"], flat + 1)

    def of(self, results: Sequence[int]) -> Kernel:
        """The kernel of some results alone, which become a vector in this order."""
        stored = {op.detail: n for n, op in enumerate(self.operations) if op.kind == "store"}
        wanted = {stored[result]: place for place, result in enumerate(results)}
        numbers = {old: new for new, old in enumerate(needed(self.operations, wanted))}
        found = copy(self)
        found.operations = [
            Operation(kind, tuple(numbers[n] for n in arguments), wanted.get(old, detail))
            for old in numbers
            for kind, arguments, detail in [self.operations[old]]
        ]
        found.anchors = [numbers[n] for n in self.anchors if n in numbers]
        found.dimensions, found.columns = 1, len(results)
        found.sizes = self.sizes | {"_result": len(results)}
        return found

    @property
    def laned(self) -> list[str]:
        """Arguments that differ from lane to lane: seeds if there are some, else all but constants.

        In the lanes of a tangent are directions, in those of other kernels samples.
        """
        seeds = [name for name in self.arguments if name.startswith(SEED)]
        return [*seeds, "_result"] if seeds else [n for n in self.pointers if n != "_constants"]

    @property
    def pointers(self) -> list[str]:
        """Arguments that the machine code takes: scratch space is not needed."""
        return [name for name in self.arguments if name != "_work"]


class Reader(Listing):
    """Reads statements one after the other.

    Parameters
    ----------
    arrays
        Names of arguments.
    known
        Name -> number of an operation, or a value that has none yet.
    """

    def __init__(self, arrays: Collection[str], known: Mapping[str, float] | None = None) -> None:
        super().__init__()
        self.anchors: list[int] = []
        self.sizes = dict.fromkeys(arrays, 0)
        self._names = {name: self.new("number", detail=v) for name, v in (known or {}).items()}
        self._work: dict[int, int] = {}

    def _anchored(self, number: int) -> int:
        self.anchors.append(number)
        return number

    def name(self, name: str, number: int) -> None:
        """Give an operation a name."""
        self._names[name] = self._anchored(number)

    def read(self, statement: ast.stmt) -> None:
        """Read a statement; `ValueError` if it is none of a kernel's."""
        match statement:
            case ast.Pass():
                pass
            case ast.Assign([ast.Name(target)], expression):
                self.name(target, self.value(expression))
            case ast.Assign([ast.Subscript(ast.Name("_work")) as target], expression):
                self._work[places(target)[0]] = self._anchored(self.value(expression))
            case ast.Assign([ast.Subscript(ast.Name("_result")) as target], expression):
                value = self.value(expression)
                self._anchored(self.new("store", value, detail=places(target)))
            case ast.Assign(
                [ast.Tuple(targets)], ast.Call(ast.Name("sincos_one"), [argument], [])
            ) if len(targets) == 2:
                found = self._anchored(self.new("sincos", self.value(argument)))
                self._parts(found, targets)
            case ast.Assign(
                [ast.Tuple(targets)],
                ast.Call(
                    ast.Name("weighted_sums"),
                    [ast.Name(array), ast.Constant(int() as first), ast.Tuple(terms)],
                    [],
                ),
            ):
                factors = [self.value(term) for term in terms]
                reach = first + padded(len(targets)) * len(terms)
                self.sizes[array] = max(self.sizes[array], reach)
                detail = array, first, len(targets)
                self._parts(self._anchored(self.new("sums", *factors, detail=detail)), targets)
            case ast.Expr(
                ast.Call(ast.Name(name), [ast.Name("_work"), ast.Constant(int() as first)], [])
            ) if name in BATCHES:
                self._batch(BATCHES[name], first)
            case ast.Expr(ast.Call(ast.Name(name), arguments, [])) if name in VECTOR_STATEMENTS:
                self._vectors(name, arguments)
            case _:
                raise ValueError(f"{ast.unparse(statement)[:80]}: not straight-line")

    def _parts(self, number: int, targets: Sequence[ast.expr]) -> None:
        for place, target in enumerate(targets):
            self.name(ast.unparse(target), self.new("part", number, detail=place))

    def _batch(self, name: str, first: int) -> None:
        lanes = range(first, first + LANES)
        if not all(place in self._work for place in lanes):
            raise ValueError(f"{name}_batch(_work, {first}): not straight-line")
        given = [self._work[place] for place in lanes]
        found = self._anchored(self.new("batch", *given, detail=name))
        for place in range(LANES * len(RESULTS[name])):
            part = self._anchored(self.new("part", found, detail=place))
            self._work[first + LANES + place] = part

    def _vectors(self, name: str, arguments: Sequence[ast.expr]) -> None:
        """A statement on whole vectors: factors are values, all else is known."""
        values, detail = [], []
        for place, argument in enumerate(arguments):
            if name == "combine" and place > 1 and place % 2 == 0:
                values.append(self.value(argument))
            elif isinstance(argument, ast.Subscript):
                detail.append(self._entry(argument))
            else:
                detail.append(ast.literal_eval(argument))
        self._anchored(self.new(name, *values, detail=tuple(detail)))

    def _entry(self, node: ast.Subscript) -> tuple[str, int]:
        """Array and place of an entry."""
        array, place = ast.unparse(node.value), places(node)
        if array not in self.sizes or len(place) != 1:
            raise ValueError(f"{ast.unparse(node)}: unknown, or of the wrong shape")
        self.sizes[array] = max(self.sizes[array], place[0] + 1)
        return array, place[0]

    def value(self, node: ast.expr, depth: int = 0) -> int:
        """Number of the operation that gives an expression's value."""
        if depth > DEEPEST:
            raise ValueError(f"expressions are more than {DEEPEST} within one another")

        def inner(*parts: ast.expr) -> list[int]:
            return [self.value(part, depth + 1) for part in parts]

        match node:
            case ast.Constant(value=float() as number):
                return self.new("number", detail=number)
            case ast.UnaryOp(ast.USub(), ast.Constant(value=float() as number)):
                return self.new("number", detail=-number)
            case ast.Name(name) if name in self._names:
                return self._names[name]
            case ast.Subscript(ast.Name("_work")) if (place := places(node)[0]) in self._work:
                return self._work[place]
            case ast.Subscript(ast.Name()):
                if ast.unparse(node.value) != "_work":
                    return self.new("entry", detail=self._entry(node))
            case ast.BinOp(left, operator, right) if type(operator) in ARITHMETIC:
                return self.new(ARITHMETIC[type(operator)], *inner(left, right))
            case ast.UnaryOp(ast.USub(), operand):
                return self.new("negate", *inner(operand))
            case ast.IfExp(ast.Compare() | ast.Name() as test, then, other):
                return self.new("select", *inner(test, then, other))
            case ast.Compare(left, [operator], [right]) if type(operator) in COMPARISONS:
                return self.new(COMPARISONS[type(operator)], *inner(left, right))
            case ast.Call(ast.Name() | ast.Attribute(ast.Name()) as function, arguments, []):
                kind = FUNCTIONS.get(ast.unparse(function), "")
                if kind and len(arguments) == 1 + (kind == "atan2"):
                    return self.new(kind, *inner(*arguments))
        raise ValueError(f"{ast.unparse(node)[:80]}: unknown, or not straight-line")


def places(node: ast.Subscript) -> tuple[int, ...]:
    """Constant indices of an array's entry."""
    elements = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    found = [e.value for e in elements if isinstance(e, ast.Constant) and type(e.value) is int]
    if len(found) != len(elements) or len(found) > 2:
        raise ValueError(f"{ast.unparse(node)}: an index is not constant")
    return tuple(found)


def uses(operations: Sequence[Operation]) -> list[int]:
    """How often each operation's value is taken."""
    found = [0] * len(operations)
    for operation in operations:
        for number in operation.arguments:
            found[number] += 1
    return found


def needed(operations: Sequence[Operation], roots: Collection[int]) -> list[int]:
    """Numbers of the operations that others depend on, these included, in order."""
    kept = set(roots)
    for number in range(len(operations) - 1, -1, -1):
        if number in kept:
            kept.update(operations[number].arguments)
    return sorted(kept)


# Expressions that are written are less deep; of a longer one the inside gets a name.
SHALLOW = 12
# Kind -> how kernels write it; see `Printer`.
FORMS = {
    **{kind: f"{text}({{}})" for text, kind in FUNCTIONS.items()},
    "abs": "abs({})",
    "atan": "atan({})",
    "atan2": "math.atan2({}, {})",
    **{kind: f"({{}} {sign} {{}})" for kind, sign in SIGNS.items()},
    **{sign: f"({{}} {sign} {{}})" for sign in COMPARISONS.values()},
    "negate": "(-{})",
    "select": "({1} if {0} else {2})",
}


class Printer:
    """Writes operations as expressions; one that is used more than once gets a name.

    Parameters
    ----------
    forms
        Kind of operation -> a form for the texts of its arguments.
    declared
        Form of the line that gives a name to a text.

    Attributes
    ----------
    texts
        Operation -> its text, a name or an expression.
    lines
        What has been written.
    """

    def __init__(
        self, operations: Sequence[Operation], forms: Mapping[str, str], declared: str
    ) -> None:
        self.operations, self._uses = operations, uses(operations)
        self._forms, self._declared = forms, declared
        self._depths: dict[int, int] = {}
        self.texts: dict[int, str] = {}
        self.lines: list[str] = []

    def write(self, number: int) -> None:
        """Write an operation with one result; its arguments are written."""
        kind, numbers, detail = self.operations[number]
        if kind == "number":
            text, depth = repr(detail) if detail >= 0.0 else f"({detail!r})", 0
        elif kind == "entry":
            text, depth = f"{detail[0]}[{detail[1]}]", 0
        else:
            text = self._forms[kind].format(*(self.texts[n] for n in numbers), detail)
            depth = 1 + max(self._depths.get(n, 0) for n in numbers)
        if depth and (self._uses[number] > 1 or depth > SHALLOW):
            self.lines.append(self._declared.format(f"v{number}", text))
            text, depth = f"v{number}", 0
        self.texts[number], self._depths[number] = text, depth


def kernel_text(
    name: str, arguments: Sequence[str], operations: Sequence[Operation], columns: int = 0
) -> str:
    """Text of a kernel of all stores; with columns its result is a matrix."""
    printer, work, firsts = Printer(operations, FORMS, "{} = {}"), 0, {}
    lines, texts = printer.lines, printer.texts
    stores = [n for n, operation in enumerate(operations) if operation.kind == "store"]
    for number in needed(operations, stores):
        kind, numbers, detail = operations[number]
        match kind:
            case "store":
                place = f"{detail // columns}, {detail % columns}" if columns else detail
                lines.append(f"_result[{place}] = {texts[numbers[0]]}")
            case "sincos":
                lines.append(f"v{number}_0, v{number}_1 = sincos_one({texts[numbers[0]]})")
            case "sums":
                array, first, targets = detail
                names = ", ".join(f"v{number}_{k}" for k in range(targets))
                factors = ", ".join(texts[n] for n in numbers)
                lines.append(f"({names},) = weighted_sums({array}, {first}, ({factors},))")
            case "batch":
                firsts[number] = work
                lines += [f"_work[{work + k}] = {texts[n]}" for k, n in enumerate(numbers)]
                lines.append(f"{detail}_batch(_work, {work})")
                work += LANES * (1 + len(RESULTS[detail]))
            case "part" if numbers[0] in firsts:
                texts[number] = f"_work[{firsts[numbers[0]] + LANES + detail}]"
            case "part":
                texts[number] = f"v{numbers[0]}_{detail}"
            case _:
                printer.write(number)
    body = "\n    ".join(lines or ["pass"])
    return f"def {name}({', '.join(arguments)}):\n    {body}\n"
