"""Tangents of straight-line kernels: the derivative of a kernel's text, as text again.

The tangent of F(x, u, constants) in the directions `_seed_x`, `_seed_u`, ... is a kernel that gives
dF/dx seed_x + dF/du seed_u + ... (forward mode: A. Griewank, A. Walther, Evaluating Derivatives,
SIAM 2008, chapter 3).  The derivatives of each statement are gathered in scalar coefficients; what
does not depend on a seeded argument has no tangent and leaves no statement.  In vector lanes the
lanes are directions: values and coefficients are computed once for all of them.

Where a function has a kink, such as |x| at 0, it is the derivative on the side of larger arguments;
the norm of a vector that is zero has the derivative zero.
"""

import ast
import re
from collections.abc import Sequence

from vehiclemor.codegen.kernel_statements import SEED, KernelText
from vehiclemor.codegen.tangent_expressions import NAME, Combination, Duals, negative, sum_of
from vehiclemor.codegen.vector_lanes import LANES, RESULTS


def tangent_name(name: str, arguments: Sequence[str]) -> str:
    """Name of the tangent of a kernel, such as `derivative_along_x_u`."""
    return "".join([f"{name}_along", *arguments])


def tangent_text(text: str, arguments: Sequence[str]) -> str:
    """Text of the tangent of a kernel.

    Parameters
    ----------
    text
        Of the kernel.
    arguments
        Names of the arguments that have seeds, such as `_x`.  The tangent takes the kernel's own
        arguments, then the seeds in this order, then the result, of the same shape as the kernel's.

    Raises
    ------
    ValueError
        If the text has what has no derivative.
    """
    kernel = KernelText(text)
    writer = _Writer(kernel, arguments)
    for statement in kernel.statements:
        writer.write(statement)
    given = [name for name in kernel.arguments if name not in ("_work", "_result")]
    seeds = [SEED + name for name in arguments]
    head = ", ".join([*given, *seeds, "_work", "_result"])
    body = "\n    ".join(_needed(writer.lines) or ["pass"])
    return f"def {tangent_name(kernel.name, arguments)}({head}):\n    {body}\n"


def _needed(lines: Sequence[tuple[Sequence[str], str]]) -> list[str]:
    """Lines that assign none of the named targets in vain, in order."""
    kept: list[str] = []
    read: set[str] = set()
    for targets, line in reversed(lines):
        if not targets or not read.isdisjoint(targets):
            kept.append(line)
            read.update(NAME.findall(line))
    return kept[::-1]


class _Writer(Duals):
    """Writes values, coefficients and tangents of a kernel's statements, line by line."""

    def __init__(self, kernel: KernelText, arguments: Sequence[str]) -> None:
        super().__init__(arguments)
        if unknown := set(arguments) - set(kernel.pointers[:-1]):
            raise ValueError(f"{kernel.name} has no argument {', '.join(sorted(unknown))}")

    def write(self, statement: ast.stmt) -> None:
        """Write what becomes of a statement."""
        match statement:
            case ast.Assign([ast.Name(target)], expression):
                value, tangent = self.dual(expression)
                self.assign([target], value)
                self._keep(target, tangent)
            case ast.Assign([ast.Subscript(ast.Name("_work")) as place], expression):
                value, tangent = self.dual(expression)
                self.lines.append(((), f"{ast.unparse(place)} = {value}"))
                self._keep(ast.unparse(place), tangent)
            case ast.Assign([ast.Subscript(ast.Name("_result")) as place], expression):
                _, tangent = self.dual(expression)
                self.lines.append(((), f"{ast.unparse(place)} = {sum_of(tangent)}"))
            case ast.Assign([ast.Tuple(elements)], ast.Call(ast.Name("sincos_one"), [argument])):
                value, tangent = self.dual(argument)
                sine, cosine = (ast.unparse(e) for e in elements)
                self.assign([sine, cosine], f"sincos_one({value})")
                self._keep(sine, self.scaled(tangent, cosine))
                self._keep(cosine, self.scaled(tangent, negative(sine)))
            case ast.Assign(
                [ast.Tuple(elements)],
                ast.Call(ast.Name("weighted_sums"), [array, first, ast.Tuple(terms)]),
            ):
                self._sums([ast.unparse(e) for e in elements], array, first, terms)
            case ast.Expr(
                ast.Call(ast.Name(name), [ast.Name("_work"), ast.Constant(int() as first)])
            ) if name.removesuffix("_batch") in RESULTS:
                self.lines.append(((), ast.unparse(statement)))
                self._batch(name.removesuffix("_batch"), first)
            case _:
                raise ValueError(f"{ast.unparse(statement)}: it has no tangent")

    def _batch(self, name: str, first: int) -> None:
        for lane in range(first, first + LANES):
            results = [f"_work[{lane + LANES * (k + 1)}]" for k in range(len(RESULTS[name]))]
            argument = f"_work[{lane}]"
            tangent = self.tangents.get(argument, {})
            if name == "sincos":
                sine, cosine = results
                self.tangents[sine] = self.scaled(tangent, cosine)
                self.tangents[cosine] = self.scaled(tangent, negative(sine))
            else:
                slope = self.slope(name, argument, results[0]) if tangent else ""
                self.tangents[results[0]] = self.scaled(tangent, slope)

    def _sums(
        self, targets: list[str], array: ast.expr, first: ast.expr, terms: Sequence[ast.expr]
    ) -> None:
        if ast.unparse(array) in self.seeded:
            raise ValueError("sums with weights have no tangent along the weights")
        duals = [self.dual(term) for term in terms]
        head = f"weighted_sums({ast.unparse(array)}, {ast.unparse(first)}"
        self.assign(targets, f"{head}, ({', '.join(value for value, _ in duals)},))")
        if any(tangent for _, tangent in duals):
            names = [f"_d_{target}" for target in targets]
            moved = ", ".join(sum_of(tangent) for _, tangent in duals)
            self.assign(names, f"{head}, ({moved},))")
            for target, name in zip(targets, names, strict=True):
                self.tangents[target] = {name: "1.0"}

    def _keep(self, target: str, tangent: Combination) -> None:
        """Remember a tangent; a sum becomes a name, what is one term stays one."""
        if len(tangent) > 1:
            name = f"_d_{re.sub(r'[^0-9A-Za-z_]', '', target)}"
            self.assign([name], sum_of(tangent))
            tangent = {name: "1.0"}
        self.tangents[target] = tangent
