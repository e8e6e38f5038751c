"""Expressions in files, read as operations before they become part of a kernel.

Arithmetic of what is known passes, and nothing else.
"""

import ast
from collections.abc import Collection
from keyword import iskeyword

from vehiclemor.codegen.operations import COMPARISONS, FUNCTIONS, Reader

# The largest kernel of this package has 131,000 characters and 22,000 operations, and compiles in
# 9 s.  A file may have four times as much.
MOST_CHARACTERS, MOST_SIZE = 500_000, 90_000
# What an elementary function counts, in operations: chains of them take longest to compile.
CALL = 160


def check_line(name: str, text: str, known: Collection[str]) -> tuple[int, int]:
    """Size of an expression of known names and `p[i]`, and how many of p there must be.

    Parameters
    ----------
    name
        That it is given.

    Returns
    -------
    tuple of int
        Number of operations, of which one that becomes many instructions counts as many; length of
        p.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    # It becomes part of longer lines; in other letters a name may be another one than it looks.
    if not (text.isascii() and text.isprintable()) or "#" in text:
        raise ValueError(f"{text[:40]!r} is no line of arithmetic")
    # Arrays of kernels begin with an underscore; there is one of each.
    own = name.isascii() and name.isidentifier() and not iskeyword(name)
    if not own or name.startswith("_") or name == "p":
        raise ValueError(f"{name[:40]!r} is no name")
    try:
        expression = ast.parse(text, mode="eval").body
    except (MemoryError, RecursionError, SyntaxError):
        raise ValueError(f"{text[:40]!r} is no arithmetic") from None
    reader = Reader(("p",), dict.fromkeys(known, 0.0))
    reader.value(expression)
    tests = {op.arguments[0] for op in reader.operations if op.kind == "select"}
    compared = {n for n, op in enumerate(reader.operations) if op.kind in COMPARISONS.values()}
    if tests != compared:
        raise ValueError(f"{text[:40]!r} takes a comparison for a number, or a number for one")
    kinds = [operation.kind for operation in reader.operations[len(known) :]]
    return len(kinds) + CALL * sum(kind in FUNCTIONS.values() for kind in kinds), reader.sizes["p"]
