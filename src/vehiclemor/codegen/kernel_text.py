"""Python source of straight-line kernels, with exact operation counts.

Every function has the signature `name(<arguments>, constants, work, result)`: it reads scalars from
its argument arrays, uses `work` as scratch space and fills `result`.  `constants(parameters, work,
result)` makes the array that the other functions read.
"""

import ast
from collections.abc import Iterator

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from vehiclemor.codegen.schedule import Batch, schedule
from vehiclemor.codegen.vector_lanes import LANES, RESULTS, SMALLEST_BATCH
from vehiclemor.symbolic.program import Function, Program

# Results of functions that are evaluated in batches are variables with these prefixes.
BATCHED_PREFIXES = tuple(f"{prefix}_" for prefixes in RESULTS.values() for prefix in prefixes)
OPERATIONS = ("add", "multiply", "divide", "negate", "sqrt", "trigonometric", "power")


class _Printer(PythonCodePrinter):
    """Prints small integer powers as products, and batched functions as variables if asked."""

    def __init__(self, batched: bool) -> None:
        super().__init__({"fully_qualified_modules": True})
        self._batched = batched

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        base, exponent = expr.args
        if exponent == sp.Rational(1, 2):
            return f"math.sqrt({self._print(base)})"
        if exponent == sp.Rational(-1, 2):
            return f"1.0/math.sqrt({self._print(base)})"
        if isinstance(exponent, sp.Integer) and 0 < abs(int(exponent)) <= 4:
            factor = self.parenthesize(base, 1000, strict=True)
            # In parentheses: the product may become the divisor of a quotient.
            product = f"({'*'.join([factor] * abs(int(exponent)))})"
            return product if exponent.is_positive else f"(1.0/{product})"
        return super()._print_Pow(expr, rational=rational)

    def _print_sin(self, expr: sp.Expr) -> str:
        inner = self._print(expr.args[0])
        return f"_sin_{inner}" if self._batched else f"math.sin({inner})"

    def _print_cos(self, expr: sp.Expr) -> str:
        inner = self._print(expr.args[0])
        return f"_cos_{inner}" if self._batched else f"math.cos({inner})"

    def _print_atan(self, expr: sp.Expr) -> str:
        inner = self._print(expr.args[0])
        return f"_atan_{inner}" if self._batched else f"math.atan({inner})"

    def _print_Integer(self, expr: sp.Integer) -> str:
        return f"{int(expr)}.0"

    def _print_Rational(self, expr: sp.Rational) -> str:
        return repr(float(expr))

    def _print_Pi(self, expr: sp.Expr) -> str:
        return repr(float(expr))

    def _print_Exp1(self, expr: sp.Expr) -> str:
        return repr(float(expr))

    def _print_Half(self, expr: sp.Rational) -> str:
        del expr
        return "0.5"


def reference_source(program: Program) -> str:
    """Plain Python source with the `math` module's functions: to read, count and check."""
    return _source(program, batched=False)


def kernel_source(program: Program) -> str:
    """Source for the compiler: elementary functions in batches, sine and cosine together.

    What it calls, `sincos_one`, `atan` and batches of them, becomes instructions in `llvm_kernels`.
    """
    return _source(program, batched=True)


def _block(batch: Batch) -> int:
    return LANES * (1 + len(RESULTS[batch.name]))


def _blocks(batch: Batch) -> int:
    return -(-len(batch.arguments) // LANES)


def _source(program: Program, batched: bool) -> str:
    hoisted = _function_source(
        "constants", {"parameters": program.parameters}, (), program.constants, batched
    )
    parts = [hoisted]
    for name, function in program.functions.items():
        parts.append(
            _function_source(name, program.arguments, program.constant_symbols, function, batched)
        )
    return "\n\n\n".join(parts) + "\n"


def _function_source(
    name: str,
    arguments: dict[str, tuple[sp.Symbol, ...]],
    constants: tuple[sp.Symbol, ...],
    function: Function,
    batched: bool,
) -> str:
    printer = _Printer(batched)
    expressions = [e for _, e in function.assignments] + list(function.results)
    used = set().union(*(e.free_symbols for e in expressions))
    signature = [*arguments, *(["constants"] if name != "constants" else []), "work", "result"]
    # With an underscore: a model's own names never begin with one, and may be `q` or `work`.
    lines = [f"def {name}({', '.join(f'_{argument}' for argument in signature)}):"]
    for argument, symbols in [*arguments.items(), ("constants", constants)]:
        lines += [
            f"    {symbol} = _{argument}[{index}]"
            for index, symbol in enumerate(symbols)
            if symbol in used
        ]
    first = 0
    for step in schedule(function) if batched else function.assignments:
        if isinstance(step, Batch):
            lines += _evaluation(step, first)
            if len(step.arguments) >= SMALLEST_BATCH:
                first += _block(step) * _blocks(step)
        else:
            lines.append(f"    {step[0]} = {printer.doprint(step[1])}")
    for index, expression in enumerate(function.results):
        place = _subscript(index, function.shape)
        lines.append(f"    _result[{place}] = {printer.doprint(expression)}")
    return "\n".join(lines if len(lines) > 1 else [*lines, "    pass"])


def _evaluation(batch: Batch, first: int) -> list[str]:
    """Lines that evaluate a batch with its scratch space from place `first` on.

    Arguments and results lie in one array at constant distances, so that the compiler knows that
    they don't overlap and makes vector code.
    """
    prefixes = RESULTS[batch.name]
    if len(batch.arguments) < SMALLEST_BATCH:
        one = "sincos_one" if batch.name == "sincos" else batch.name
        return [
            f"    {', '.join(f'{prefix}_{a}' for prefix in prefixes)} = {one}({a})"
            for a in batch.arguments
        ]
    given, taken, block = [], [], _block(batch)
    for index in range(LANES * _blocks(batch)):
        place = first + block * (index // LANES) + index % LANES
        argument = batch.arguments[index] if index < len(batch.arguments) else "0.0"
        given.append(f"    _work[{place}] = {argument}")
        if index < len(batch.arguments):
            taken += [
                f"    {prefix}_{argument} = _work[{place + LANES * (part + 1)}]"
                for part, prefix in enumerate(prefixes)
            ]
    evaluated = [
        f"    {batch.name}_batch(_work, {first + block * number})"
        for number in range(_blocks(batch))
    ]
    return given + evaluated + taken


def tangent_source(program: Program) -> str:
    """Source of two kernels by which a Jacobian is multiplied with vectors.

    `tangent_parts(q, u, constants, work, result)` gives the entries of the Jacobian that are no
    structural constants, then the residual; `tangent(parts, column, result)` the product.
    """
    function = program.functions["residual_jacobian"]
    rows, columns = function.shape
    entries: list[sp.Expr] = []
    lines = ["def tangent(_parts, _column, _result):"]
    for i in range(rows):
        terms = []
        for j in range(columns - 1):
            entry = function.results[i * columns + j]
            if entry in (1, -1):
                terms.append(f"{'' if entry == 1 else '-'}_column[{j}]")
            elif entry != 0:
                terms.append(f"_parts[{len(entries)}]*_column[{j}]")
                entries.append(entry)
        lines.append(f"    _result[{i}] = {' + '.join(terms) or '0.0'}")
    residual = [function.results[(i + 1) * columns - 1] for i in range(rows)]
    results = (*entries, *residual)
    parts = Function(function.assignments, results, (len(results),))
    text = _function_source(
        "tangent_parts", program.arguments, program.constant_symbols, parts, True
    )
    return f"{text}\n\n\n" + "\n".join(lines) + "\n"


def _subscript(index: int, shape: tuple[int, ...]) -> str:
    if len(shape) == 1:
        return str(index)
    return f"{index // shape[1]}, {index % shape[1]}"


def operation_counts(source: str) -> dict[str, dict[str, int]]:
    """Count the arithmetic operations that each function of a source executes.

    Returns
    -------
    dict
        Function name -> counts of `add` (and subtract), `multiply`, `divide`, `negate`, `sqrt`,
        `trigonometric` (one for each sine, cosine or inverse), `power`, and their sum `total`.
        Loads and stores are not counted.  The text is straight-line, so the counts are exact.
    """
    operators = {ast.Add: "add", ast.Sub: "add", ast.Mult: "multiply", ast.Div: "divide"}
    counts: dict[str, dict[str, int]] = {}
    for definition in ast.parse(source).body:
        if not isinstance(definition, ast.FunctionDef):
            continue
        count: dict[str, int] = dict.fromkeys(OPERATIONS, 0)
        for node in _arithmetic(definition):
            if isinstance(node, ast.BinOp):
                count[operators.get(type(node.op), "power")] += 1
            elif isinstance(node, ast.UnaryOp) and not isinstance(node.operand, ast.Constant):
                count["negate"] += 1
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                count["sqrt" if node.func.attr == "sqrt" else "trigonometric"] += 1
            elif isinstance(node, ast.Name) and node.id.startswith(BATCHED_PREFIXES):
                count["trigonometric"] += 1
        counts[definition.name] = count | {"total": sum(count.values())}
    return counts


def _arithmetic(definition: ast.FunctionDef) -> Iterator[ast.AST]:
    """Nodes of what is computed; of a batched function each use counts, not its evaluation."""
    for statement in definition.body:
        if isinstance(statement, ast.Assign):
            yield from ast.walk(statement.value)
