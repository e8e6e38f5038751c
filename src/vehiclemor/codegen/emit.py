"""Python source of straight-line kernels, with exact operation counts.

Every function has the signature `name(<arguments>, constants, work, result)`: it reads scalars from
its argument arrays, uses `work` as scratch space and fills `result`.  `constants(parameters, work,
result)` makes the array that the other functions read.
"""

import ast

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from vehiclemor.symbolic.program import Function, Program

OPERATIONS = ("add", "multiply", "divide", "negate", "sqrt", "trigonometric", "power")
# Sines and cosines of the arguments are evaluated this many at a time, so that the compiler makes
# one vector loop of them.
LANES = 8


class _Printer(PythonCodePrinter):
    """Prints small integer powers as products, and sines and cosines as variables if asked."""

    def __init__(self, pairs: bool) -> None:
        super().__init__({"fully_qualified_modules": True})
        self._pairs = pairs

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
        return f"sin_{inner}" if self._pairs else f"math.sin({inner})"

    def _print_cos(self, expr: sp.Expr) -> str:
        inner = self._print(expr.args[0])
        return f"cos_{inner}" if self._pairs else f"math.cos({inner})"

    def _print_Integer(self, expr: sp.Integer) -> str:
        return f"{int(expr)}.0"

    def _print_Rational(self, expr: sp.Rational) -> str:
        return repr(float(expr))

    def _print_Half(self, expr: sp.Rational) -> str:
        del expr
        return "0.5"


def reference_source(program: Program) -> str:
    """Plain Python source with the `math` module's sines and cosines: to read, count and check."""
    return _source(program, pairs=False)


def kernel_source(program: Program) -> str:
    """Source for the compiler: sine and cosine of an angle are evaluated together.

    It calls `sincos(angle)` and `sincos_batch(work, first)`, which the linker provides.
    """
    return _source(program, pairs=True)


def work_size(program: Program) -> int:
    """Number of floats of scratch space that the functions of the program need."""
    widest = max(len(_leaf_angles(function, program)) for function in program.functions.values())
    return 3 * _padded(widest)


def _source(program: Program, pairs: bool) -> str:
    hoisted = _function_source(
        "constants", {"parameters": program.parameters}, (), program.constants, [], pairs
    )
    parts = [hoisted]
    for name, function in program.functions.items():
        angles = _leaf_angles(function, program) if pairs else []
        parts.append(
            _function_source(
                name, program.arguments, program.constant_symbols, function, angles, pairs
            )
        )
    return "\n\n\n".join(parts) + "\n"


def _function_source(
    name: str,
    arguments: dict[str, tuple[sp.Symbol, ...]],
    constants: tuple[sp.Symbol, ...],
    function: Function,
    angles: list[sp.Symbol],
    pairs: bool,
) -> str:
    printer = _Printer(pairs)
    expressions = _expressions(function)
    used = set().union(*(e.free_symbols for e in expressions))
    signature = [*arguments, *(["constants"] if name != "constants" else []), "work", "result"]
    lines = [f"def {name}({', '.join(signature)}):"]
    for argument, symbols in [*arguments.items(), ("constants", constants)]:
        lines += [
            f"    {symbol} = {argument}[{index}]"
            for index, symbol in enumerate(symbols)
            if symbol in used
        ]
    lines += _batch(angles)
    known = set(angles)
    for symbol, expression in function.assignments:
        if pairs:
            lines += _scalar_pairs([expression], known)
        lines.append(f"    {symbol} = {printer.doprint(expression)}")
    if pairs:
        lines += _scalar_pairs(function.results, known)
    for index, expression in enumerate(function.results):
        place = _subscript(index, function.shape)
        lines.append(f"    result[{place}] = {printer.doprint(expression)}")
    return "\n".join(lines if len(lines) > 1 else [*lines, "    pass"])


def tangent_source(program: Program) -> str:
    """Source of `residual_tangent(q, u, constants, work, basis, r, result)`.

    Made from `residual_jacobian`: result[:, :r] is the Jacobian times basis[:, :r] and result[:, n]
    the residual.  Structural zeros of the Jacobian cost nothing.
    """
    function = program.functions["residual_jacobian"]
    rows, columns = function.shape
    angles = _leaf_angles(function, program)
    text = _function_source(
        "residual_tangent", program.arguments, program.constant_symbols, function, angles, True
    )
    lines = text.splitlines()
    lines[0] = lines[0].replace("result):", "basis, r, result):")
    body = lines[: len(lines) - rows * columns]
    printer = _Printer(pairs=True)
    products: list[str] = []
    for i in range(rows):
        terms = []
        for j in range(columns - 1):
            entry = function.results[i * columns + j]
            if entry == 0:
                continue
            if entry in (1, -1):
                terms.append(f"{'' if entry == 1 else '-'}basis[{j}, k]")
                continue
            body.append(f"    j_{i}_{j} = {printer.doprint(entry)}")
            terms.append(f"j_{i}_{j}*basis[{j}, k]")
        products.append(f"        result[{i}, k] = {' + '.join(terms) or '0.0'}")
        residual = printer.doprint(function.results[i * columns + columns - 1])
        body.append(f"    result[{i}, {columns - 1}] = {residual}")
    return "\n".join([*body, "    for k in range(r):", *products]) + "\n"


def _expressions(function: Function) -> list[sp.Expr]:
    return [e for _, e in function.assignments] + list(function.results)


def _trigonometric(expressions: list[sp.Expr] | tuple[sp.Expr, ...]) -> list[sp.Symbol]:
    """Arguments of all sines and cosines, each once, in order of appearance."""
    found: dict[sp.Symbol, None] = {}
    for expression in expressions:
        for call in sorted(expression.atoms(sp.sin, sp.cos), key=str):
            angle = call.args[0]
            if not isinstance(angle, sp.Symbol):
                raise ValueError(f"{call}: name the angle on the tape first")
            found[angle] = None
    return list(found)


def _leaf_angles(function: Function, program: Program) -> list[sp.Symbol]:
    """Angles that are arguments of the function, so that they are known from the start."""
    leaves = {symbol for symbols in program.arguments.values() for symbol in symbols}
    return [angle for angle in _trigonometric(_expressions(function)) if angle in leaves]


def _batch(angles: list[sp.Symbol]) -> list[str]:
    """Blocks of 8 angles, their 8 sines and their 8 cosines in the scratch space.

    The three lie in one array at constant distances, so that the compiler knows that they don't
    overlap and makes vector code.
    """
    lines, names = [], []
    for index in range(_padded(len(angles))):
        first, lane = 3 * LANES * (index // LANES), index % LANES
        angle = angles[index] if index < len(angles) else "0.0"
        lines.append(f"    work[{first + lane}] = {angle}")
        if index < len(angles):
            names.append(f"    sin_{angle} = work[{first + lane + LANES}]")
            names.append(f"    cos_{angle} = work[{first + lane + 2 * LANES}]")
    blocks = range(_padded(len(angles)) // LANES) if angles else ()
    calls = [f"    sincos_batch(work, {3 * LANES * block})" for block in blocks]
    return lines + calls + names if angles else []


def _padded(count: int) -> int:
    return LANES * max(1, -(-count // LANES))


def _scalar_pairs(
    expressions: list[sp.Expr] | tuple[sp.Expr, ...], known: set[sp.Symbol]
) -> list[str]:
    lines = []
    for angle in _trigonometric(expressions):
        if angle not in known:
            known.add(angle)
            lines.append(f"    sin_{angle}, cos_{angle} = sincos({angle})")
    return lines


def _subscript(index: int, shape: tuple[int, ...]) -> str:
    if len(shape) == 1:
        return str(index)
    return f"{index // shape[1]}, {index % shape[1]}"


def operation_counts(source: str) -> dict[str, dict[str, int]]:
    """Count the arithmetic operations that each function of a reference source executes.

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
        for node in ast.walk(definition):
            if isinstance(node, ast.BinOp):
                count[operators.get(type(node.op), "power")] += 1
            elif isinstance(node, ast.UnaryOp) and not isinstance(node.operand, ast.Constant):
                count["negate"] += 1
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                count["sqrt" if node.func.attr == "sqrt" else "trigonometric"] += 1
        counts[definition.name] = count | {"total": sum(count.values())}
    return counts
