"""Texts of files, decided on their syntax tree before anything of them becomes machine code.

Assignments of arithmetic pass, to names, to scratch space and to results, and nothing else.  What
they read is defined before, or an entry of an argument.
"""

import ast
from collections.abc import Collection, Sequence

from vehiclemor.codegen.kernel_statements import SEED
from vehiclemor.codegen.llvm_expressions import COMPARISONS, LIBRARY, LLVM_FUNCTIONS
from vehiclemor.codegen.vector_lanes import LANES, RESULTS, padded

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
BATCHES = {f"{name}_batch": len(results) for name, results in RESULTS.items()}
ARGUMENTS = ("_x", "_u", "_constants", "_result")
# Kernel -> its arguments, but for scratch space.
KERNELS = {"constants": ("_parameters", "_result")} | dict.fromkeys(
    ("derivative", "outputs", "second_order", "speeds", "full_state"), ARGUMENTS
)


def check_kernel(text: str) -> None:
    """Raise `ValueError` unless a text is one of the kernels, of nothing but arithmetic."""
    match _parsed(text):
        case [
            ast.FunctionDef(name, ast.arguments([], given, None, [], [], None, []), body, [], None)
        ]:
            arguments = [a.arg for a in given if a.annotation is None and a.arg != "_work"]
        case _:
            raise ValueError(f"{text[:40]!r} is no kernel")
    if arguments != [*KERNELS.get(name, "?")] or len(given) > len(arguments) + 1:
        raise ValueError(f"kernel {name} with these arguments is none that a file may have")
    checked = _Checked(arguments[:-1])
    for statement in body:
        checked.statement(statement)


def check_line(name: str, text: str, known: Collection[str]) -> tuple[int, int]:
    """Size of an expression of known names and `p[i]`, and how many of p there must be.

    Parameters
    ----------
    name
        That it is given.

    Raises
    ------
    ValueError
        If it is anything else.
    """
    # It becomes part of longer lines.
    if not text.isprintable() or "#" in text:
        raise _refused(text)
    match _parsed(f"{name} = {text}"):
        case [ast.Assign([ast.Name(target)], expression)] if target == name:
            checked = _Checked(["p"], known)
            checked.value(expression)
            checked.define(name)
            return checked.size, checked.entries
    raise _refused(name)


def _parsed(text: str) -> list[ast.stmt]:
    # In other letters a name may be another one than it looks.
    if len(text) > MOST_CHARACTERS or not text.isascii():
        raise ValueError(f"{text[:40]!r} is too long, or in letters that no kernel has")
    try:
        return ast.parse(text).body
    except (MemoryError, RecursionError, SyntaxError):
        raise _refused(text) from None


class _Checked:
    """What is known after some statements, and how large they are.

    Parameters
    ----------
    arrays
        Whose entries may be read.
    names
        That are known.

    Attributes
    ----------
    size
        Number of nodes; one that becomes many instructions counts as many.
    entries
        How many of the arrays' are read at most.
    """

    def __init__(self, arrays: Sequence[str], names: Collection[str] = ()) -> None:
        self._arrays, self._known = arrays, set[str | int](names)
        self.size = self.entries = self._dimensions = 0

    def statement(self, node: ast.stmt) -> None:
        """Check a statement; what it defines is known from then on."""
        match node:
            case ast.Pass():
                return
            case ast.Assign([ast.Name(target)], expression):
                self.value(expression)
                self.define(target)
            case ast.Assign([ast.Subscript(ast.Name("_result")) as target], expression):
                self.value(expression)
                self._write(target)
            case ast.Assign([ast.Subscript(ast.Name("_work"), place)], expression):
                self.value(expression)
                self._known.add(_whole(place))
            case ast.Assign(
                [ast.Tuple([ast.Name(sine), ast.Name(cosine)])],
                ast.Call(ast.Name("sincos_one"), [argument], []),
            ):
                self.value(argument)
                self._grow(CALL)
                self.define(sine, cosine)
            case ast.Assign(
                [ast.Tuple([_, *_] as targets)],
                ast.Call(
                    ast.Name("weighted_sums"),
                    [ast.Name(array), first, ast.Tuple([_, *_] as terms)],
                    [],
                ),
            ) if array in self._arrays and _whole(first) >= 0:
                self._grow(padded(len(targets)) * len(terms))
                for term in terms:
                    self.value(term)
                self.define(*(getattr(target, "id", "") for target in targets))
            case ast.Expr(ast.Call(ast.Name(name), [ast.Name("_work"), first], [])) if (
                name in BATCHES
            ):
                place = _whole(first)
                if not self._known.issuperset(range(place, place + LANES)):
                    raise _refused(node)
                self._grow(LANES * CALL)
                self._known.update(range(place + LANES, place + LANES * (1 + BATCHES[name])))
            case _:
                raise _refused(node)

    def value(self, node: ast.expr, depth: int = 0) -> None:
        """Check an expression."""
        self._grow(1)
        inner: Sequence[ast.expr] = ()
        match node:
            case ast.Constant(float()):
                pass
            case ast.Name(name) if name in self._known:
                pass
            case ast.Subscript(ast.Name("_work"), place) if _whole(place) in self._known:
                pass
            case ast.Subscript(ast.Name(array), place) if array in self._arrays:
                self.entries = max(self.entries, _whole(place) + 1)
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
                self._grow(CALL)
            case _:
                raise _refused(node)
        if depth > DEEPEST:
            raise _refused(node)
        for part in inner:
            self.value(part, depth + 1)

    def define(self, *names: str) -> None:
        """Names are known from now on."""
        for name in names:
            # Of arrays there is one each.
            if not name or name in self._arrays or name.startswith(("_work", "_result", SEED)):
                raise _refused(name)
            self._known.add(name)

    def _write(self, target: ast.Subscript) -> None:
        inner = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
        places = [_whole(place) for place in inner]
        if len(places) not in ([self._dimensions] if self._dimensions else (1, 2)):
            raise _refused(target)
        self._dimensions = len(places)

    def _grow(self, size: int) -> None:
        self.size += size
        if self.size > MOST_SIZE:
            raise ValueError("a kernel is larger than any of this package could be")


def _whole(node: ast.expr) -> int:
    """A whole number, which is not a truth value."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return node.value
    raise _refused(node)


def _refused(what: ast.AST | str) -> ValueError:
    """A short error: a deep tree would take long to print."""
    text = what if isinstance(what, str) else f"line {getattr(what, 'lineno', 1)}"
    kind = "" if isinstance(what, str) else f" has {type(what).__name__}, which"
    return ValueError(f"{text[:40]!r}{kind} is no arithmetic of what is known")
