"""Text of a straight-line kernel, taken apart into its statements."""

import ast

from vehiclemor.codegen import weighted_sums

# Before the name of an argument: the argument's direction, see `tangent`.
SEED = "_seed"


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
        written = [
            places(target)
            for node in self.statements
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Subscript) and ast.unparse(target.value) == "_result"
        ]
        self.dimensions = max((len(place) for place in written), default=1)
        # Every place of a result is written, so the largest tells its shape.
        self.columns = 1 + max((place[-1] for place in written), default=0)
        self.sizes = dict.fromkeys(self.arguments, 0)
        for node in ast.walk(tree[0]):
            if isinstance(node, ast.Subscript) and (name := ast.unparse(node.value)) in self.sizes:
                self.sizes[name] = max(self.sizes[name], self.flat(places(node)) + 1)
            match node:
                case ast.Assign(
                    [ast.Tuple(targets)], ast.Call(ast.Name("weighted_sums"), [array, *_]) as call
                ):
                    read = weighted_sums.reach(call, len(targets))
                    self.sizes[ast.unparse(array)] = max(self.sizes[ast.unparse(array)], read)

    def flat(self, place: tuple[int, ...]) -> int:
        """Place of an entry in memory, counted in floats."""
        return place[0] if len(place) == 1 else place[0] * self.columns + place[1]

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


def places(node: ast.Subscript) -> tuple[int, ...]:
    """Constant indices of an array's entry."""
    elements = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    found = [e.value for e in elements if isinstance(e, ast.Constant) and isinstance(e.value, int)]
    if len(found) != len(elements) or len(found) > 2:
        raise ValueError(f"{ast.unparse(node)}: an index is not constant")
    return tuple(found)
