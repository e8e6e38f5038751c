"""What tells how far a state goes in what a reduced model knows, as an output."""

import ast
from collections.abc import Sequence
from functools import reduce

from vehiclemor.exporting.straight_line import call, negative

ZERO = ast.Constant(0.0)


def trust(used: Sequence[ast.expr]) -> ast.expr:
    """The largest magnitude."""
    return reduce(lambda a, b: call("fmax", a, b), (call("fabs", value) for value in used))


def trust_tangent(used: Sequence[ast.expr], moved: Sequence[ast.expr]) -> ast.expr:
    """Derivative of the largest magnitude, of values that change so."""
    found = None
    for value, change in zip(used, moved, strict=True):
        falls = ast.Compare(value, [ast.Lt()], [ZERO])
        own = call("select", falls, negative(change), change)
        largest = ast.Compare(call("fabs", value), [ast.GtE()], [trust(used)])
        found = own if found is None else call("select", largest, own, found)
    assert found is not None
    return found
