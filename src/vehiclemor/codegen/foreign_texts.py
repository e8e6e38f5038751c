"""Expressions in files, decided on their syntax tree before they become machine code.

Arithmetic of what is known passes, and nothing else.
"""

import ast
from collections.abc import Collection

from vehiclemor.codegen.llvm_expressions import COMPARISONS, LIBRARY, LLVM_FUNCTIONS

# The largest kernel of this package has 131,000 characters, nodes to a depth of 34 and a size of
# 22,000, and compiles in 9 s.  A file may have four times as much.
MOST_CHARACTERS, DEEPEST, MOST_SIZE = 500_000, 140, 90_000
# What an elementary function counts, in nodes: a chain of them is what takes longest to compile.
CALL = 160
# Function -> number of arguments.
FUNCTIONS = dict.fromkeys((*LLVM_FUNCTIONS, "atan", "math.exp"), 1) | {
    f"math.{name}": 1 + (name == "atan2") for name in LIBRARY
}
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)


def check_line(name: str, text: str, known: Collection[str]) -> tuple[int, int]:
    """Size of an expression of known names and `p[i]`, and how many of p there must be.

    Parameters
    ----------
    name
        That it is given.

    Returns
    -------
    tuple of int
        Size in nodes, of which one that becomes many instructions counts as many; length of p.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    # It becomes part of longer lines; in other letters a name may be another one than it looks.
    if not (text.isascii() and text.isprintable()) or "#" in text:
        raise _refused(text)
    try:
        statements = ast.parse(f"{name} = {text}").body
    except (MemoryError, RecursionError, SyntaxError):
        raise _refused(text) from None
    match statements:
        case [ast.Assign([ast.Name(target)], expression)] if target == name:
            # Arrays of kernels begin with an underscore; there is one of each.
            if name != "p" and not name.startswith("_"):
                return _checked(expression, known)
    raise _refused(name)


def _checked(node: ast.expr, known: Collection[str], depth: int = 0) -> tuple[int, int]:
    """Size of an expression, and how many of p it reads."""
    size, entries, inner = 1, 0, ()
    match node:
        case ast.Constant(float()):
            pass
        case ast.Name(name) if name in known:
            pass
        case ast.Subscript(ast.Name("p"), ast.Constant(place)) if type(place) is int:
            entries = place + 1
        case ast.BinOp(left, operator, right) if isinstance(operator, OPERATORS):
            inner = left, right
        case ast.UnaryOp(ast.USub(), operand):
            inner = (operand,)
        case ast.IfExp(ast.Compare(left, [operator], [right]), body, orelse) if (
            type(operator) in COMPARISONS
        ):
            inner = left, right, body, orelse
        case ast.Call(ast.Name() | ast.Attribute(ast.Name()) as function, inner, []) if (
            FUNCTIONS.get(ast.unparse(function)) == len(inner)
        ):
            size += CALL
        case _:
            raise _refused(type(node).__name__)
    if depth > DEEPEST:
        raise _refused(type(node).__name__)
    for part in inner:
        further, needed = _checked(part, known, depth + 1)
        size, entries = size + further, max(entries, needed)
    return size, entries


def _refused(what: str) -> ValueError:
    return ValueError(f"{what[:40]!r} is no arithmetic of what is known")
