"""Derivatives of the expressions of straight-line kernels, as text."""

import ast
import re
from collections.abc import Mapping, Sequence

from vehiclemor.codegen.kernel_statements import SEED, places

# Function -> text of its derivative at the argument x, where it has the value v.
DERIVATIVES = {
    # Finite at zero: there a norm, whose square has the slope zero, has it too.  A choice would
    # become a branch, and branches break up what is one long block.
    "math.sqrt": "0.5 / (v + 1e-300)",
    "math.sin": "math.cos(x)",
    "math.cos": "-math.sin(x)",
    "math.tan": "1.0 + v * v",
    "math.asin": "1.0 / math.sqrt(1.0 - x * x)",
    "math.acos": "-1.0 / math.sqrt(1.0 - x * x)",
    "math.atan": "1.0 / (1.0 + x * x)",
    "atan": "1.0 / (1.0 + x * x)",
    "math.exp": "v",
    "math.log": "1.0 / x",
    "math.sinh": "math.cosh(x)",
    "math.cosh": "math.sinh(x)",
    "math.tanh": "1.0 - v * v",
    **dict.fromkeys(("abs", "np.abs", "math.fabs"), "1.0 if x >= 0.0 else -1.0"),
}
STEPS = ("np.floor",)
# Words of a text.
NAME = re.compile(r"\b[A-Za-z_]\w*\b")
# A name, an entry of an array or a number, with a sign or none.
SHORT = re.compile(r"-?(\w|\.|\[\d+\]|e-)+")

# Tangents that a value's own is a sum of, each with the (short) text of its coefficient.
Combination = Mapping[str, str]


class Duals:
    """Values and tangents of expressions; what both need is named on a line of its own.

    Parameters
    ----------
    seeded
        Arguments that have seeds.

    Attributes
    ----------
    seeded
        As given.
    lines
        Names that a line assigns, none if it is needed anyway, and the line.
    tangents
        Name, or entry of the scratch space -> its tangent, if it has one.
    """

    def __init__(self, seeded: Sequence[str]) -> None:
        self.lines: list[tuple[Sequence[str], str]] = []
        self.tangents: dict[str, Combination] = {}
        self.seeded = tuple(seeded)
        self._assigned: set[str] = set()

    def assign(self, targets: Sequence[str], value: str) -> None:
        """Write a line that is needed if a later one reads one of its targets."""
        if not self._assigned.isdisjoint(targets):
            raise ValueError(f"{', '.join(targets)}: assigned twice")
        self._assigned.update(targets)
        # A tuple of one keeps its comma.
        several = ", ".join(targets) if "weighted_sums" not in value else f"({', '.join(targets)},)"
        self.lines.append((targets, f"{several} = {value}"))

    def named(self, value: str) -> str:
        """A short name of a value: itself if it is one."""
        if SHORT.fullmatch(value):
            return value
        name = f"_c{len(self.lines)}"
        self.assign([name], value)
        return name

    def _product(self, a: str, b: str) -> str:
        """Text of a coefficient times another."""
        sign = "-" if a.startswith("-") != b.startswith("-") else ""
        a, b = a.removeprefix("-"), b.removeprefix("-")
        if "1.0" in (a, b):
            return sign + (b if a == "1.0" else a)
        return sign + self.named(f"{a} * {b}")

    def scaled(self, tangent: Combination, factor: str) -> Combination:
        """A tangent times a factor."""
        return {name: self._product(own, factor) for name, own in tangent.items()}

    def _added(self, a: Combination, b: Combination) -> Combination:
        total = dict(a)
        for name, own in b.items():
            if name not in total:
                total[name] = own
            elif total[name] == negative(own):
                del total[name]
            else:
                total[name] = self.named(f"{total[name]} + {own}")
        return total

    def slope(self, function: str, x: str, v: str) -> str:
        """Derivative of an elementary function at x, where it has the value v."""
        names = {"x": x, "v": v}
        return self.named(NAME.sub(lambda n: names.get(n[0], n[0]), DERIVATIVES[function]))

    def dual(self, node: ast.expr) -> tuple[str, Combination]:
        """Text of an expression's value, and its tangent."""
        match node:
            case ast.Constant():
                return ast.unparse(node), {}
            case ast.Name(name):
                return name, self.tangents.get(name, {})
            case ast.Subscript(array):
                text, owner = ast.unparse(node), ast.unparse(array)
                if owner in self.seeded:
                    places(node)
                    return text, {f"{SEED}{text}": "1.0"}
                return text, self.tangents.get(text, {})
            case ast.UnaryOp(ast.USub(), operand):
                value, tangent = self.dual(operand)
                # What is composed stands in parentheses.
                return negative(value), self.scaled(tangent, "-1.0")
            case ast.BinOp(left, operator, right):
                return self._binary(operator, self.dual(left), self.dual(right))
            case ast.IfExp(test, body, orelse):
                return self._chosen(ast.unparse(test), self.dual(body), self.dual(orelse))
            case ast.Call(function, arguments, []):
                return self._call(ast.unparse(function), [self.dual(a) for a in arguments])
        raise ValueError(f"{ast.unparse(node)}: it has no tangent")

    def _binary(
        self, operator: ast.operator, left: tuple[str, Combination], right: tuple[str, Combination]
    ) -> tuple[str, Combination]:
        (a, of_a), (b, of_b) = left, right
        match operator:
            case ast.Add():
                return f"({a} + {b})", self._added(of_a, of_b)
            case ast.Sub():
                return f"({a} - {b})", self._added(of_a, self.scaled(of_b, "-1.0"))
            case ast.Mult():
                a, b = self.named(a) if of_b else a, self.named(b) if of_a else b
                return f"({a} * {b})", self._added(self.scaled(of_a, b), self.scaled(of_b, a))
            case ast.Div():
                if not (of_a or of_b):
                    return f"({a} / {b})", {}
                b = self.named(b)
                inverse = self.named(f"1.0 / {b}")
                value = self.named(f"{a} / {b}") if of_b else f"({a} / {b})"
                along_b = self.scaled(of_b, negative(self._product(value, inverse))) if of_b else {}
                return value, self._added(self.scaled(of_a, inverse), along_b)
            case ast.Pow():
                if of_b:
                    raise ValueError("a varying exponent has no tangent: write exp(b log(a))")
                a = self.named(a)
                slope = self.named(f"{b} * ({a}) ** ({b} - 1.0)") if of_a else ""
                return f"(({a}) ** ({b}))", self.scaled(of_a, slope)
        raise ValueError(f"{type(operator).__name__} has no tangent")

    def _chosen(
        self, test: str, body: tuple[str, Combination], orelse: tuple[str, Combination]
    ) -> tuple[str, Combination]:
        (a, of_a), (b, of_b) = body, orelse
        tangent = {
            name: self.named(f"{of_a.get(name, '0.0')} if {test} else {of_b.get(name, '0.0')}")
            for name in {**of_a, **of_b}
        }
        return f"({a} if {test} else {b})", tangent

    def _call(
        self, function: str, arguments: Sequence[tuple[str, Combination]]
    ) -> tuple[str, Combination]:
        value = f"{function}({', '.join(a for a, _ in arguments)})"
        if not any(tangent for _, tangent in arguments) or function in STEPS:
            return value, {}
        names = [self.named(a) for a, _ in arguments]
        value = self.named(f"{function}({', '.join(names)})")
        if function == "math.atan2":
            (y, x), (of_y, of_x) = names, (tangent for _, tangent in arguments)
            inverse = self.named(f"1.0 / ({x} * {x} + {y} * {y})")
            along_y = self.scaled(of_y, self._product(x, inverse))
            along_x = self.scaled(of_x, negative(self._product(y, inverse)))
            return value, self._added(along_y, along_x)
        if function not in DERIVATIVES or len(arguments) != 1:
            raise ValueError(f"{function} has no tangent")
        ((_, tangent),) = arguments
        return value, self.scaled(tangent, self.slope(function, names[0], value))


def negative(coefficient: str) -> str:
    """A short text with the other sign."""
    return coefficient.removeprefix("-") if coefficient.startswith("-") else f"-{coefficient}"


def sum_of(tangent: Combination) -> str:
    """Text of a combination, 0.0 where it is empty."""
    terms = [
        f"{own.removesuffix('1.0')}{name}" if own in ("1.0", "-1.0") else f"{own} * {name}"
        for name, own in tangent.items()
    ]
    return " + ".join(terms).replace("+ -", "- ") or "0.0"
