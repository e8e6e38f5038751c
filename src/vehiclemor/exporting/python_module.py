"""A system as a Python module for another library: the same functions, in its words."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from copy import deepcopy

from vehiclemor.exporting.straight_line import StraightLine
from vehiclemor.exporting.system import SIGNATURES, TOOL, ExportedSystem


def python_module(
    system: ExportedSystem, imported: str, words: Mapping[str, str], listed: str
) -> str:
    """Text of the module.

    Parameters
    ----------
    imported
        Its statement that imports the library.
    words
        Function of a straight line -> the library's.
    listed
        What of the library makes a result of a list of its entries.
    """
    names = {
        "STATES": system.states,
        "INPUTS": system.inputs,
        "OUTPUTS": system.outputs,
        "PARAMETERS": system.parameters,
    }
    starts = {name: state.tolist() for name, state in system.starts.items()}
    lines = [
        f'"""{system.name}: {system.summary}.\n\nWritten by {TOOL}.\n"""',
        f"\n{imported}\n",
        *(f"{name} = {tuple(q.name for q in quantities)!r}" for name, quantities in names.items()),
        f"VALUES = {system.values.tolist()!r}",
        f"STARTS = {starts!r}",
    ]
    functions = [_function(name, system.functions[name], words, listed) for name in SIGNATURES]
    return "\n\n\n".join(["\n".join(lines), *functions]) + "\n"


def _function(name: str, function: StraightLine, words: Mapping[str, str], listed: str) -> str:
    *given, _ = SIGNATURES[name]
    rename = _Words(words)
    lines = [
        f"    {local} = {rename.text(expression)}"
        for local, expression in function.assignments.items()
    ]
    results = [f"        {rename.text(expression)}," for expression in function.results]
    body = [*lines, f"    return {listed}([", *results, "    ])"]
    return "\n".join([f"def {name}({', '.join(given)}):", *body])


class _Words(ast.NodeTransformer):
    """Replaces the functions of expressions."""

    def __init__(self, words: Mapping[str, str]) -> None:
        self._words = words

    def text(self, expression: ast.expr) -> str:
        return ast.unparse(self.visit(deepcopy(expression)))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        node = ast.Call(node.func, [self.visit(a) for a in node.args], [])
        node.func = ast.Name(self._words[ast.unparse(node.func)])
        return node
