"""Elementary functions are evaluated in batches, each when its arguments are known."""

import numpy as np
import pytest
import sympy as sp

from vehiclemor.codegen.lowering import Batch, schedule
from vehiclemor.symbolic.program import Function


def symbols(name: str, count: int) -> list[sp.Symbol]:
    return [sp.Symbol(f"{name}{k}", real=True) for k in range(count)]


@pytest.mark.parametrize("seed", range(25))
def test_every_argument_is_known_before_it_is_used(seed):
    rng, given = np.random.default_rng(seed), symbols("x", 3)
    defined, assignments = list(given), []
    for symbol in symbols("_v", 40):
        a, b = (defined[int(k)] for k in rng.integers(len(defined), size=2))
        choices = [a * b, a + b, sp.sin(a) + b, sp.atan(a) * b, sp.cos(a) * sp.atan(b), a - 2]
        assignments.append((symbol, choices[int(rng.integers(len(choices)))]))
        defined.append(symbol)
    results = (sp.sin(defined[-1]), sp.atan(defined[-2]), *defined[-4:-2])
    known, answered, kept = set(given), set(), []
    kinds = {sp.sin: "sincos", sp.cos: "sincos", sp.atan: "atan"}

    def used(expression):
        assert expression.free_symbols <= known
        for call in expression.atoms(*kinds):
            assert (kinds[call.func], call.args[0]) in answered

    for step in schedule(Function(tuple(assignments), results, (4,))):
        if isinstance(step, Batch):
            batch = {(step.name, argument) for argument in step.arguments}
            assert set(step.arguments) <= known
            assert len(batch) == len(step.arguments)
            assert not batch & answered
            answered |= batch
        else:
            used(step[1])
            known.add(step[0])
            kept.append(step)
    assert sorted(kept, key=str) == sorted(assignments, key=str)
    for result in results:
        used(result)


def test_the_same_quantity_of_all_wheels_stands_side_by_side_in_one_batch():
    a, b, slips, angles, assignments = *sp.symbols("a b"), [], [], []
    for wheel in range(4):
        x, slip, angle = (sp.Symbol(f"{name}{wheel}") for name in ("x", "slip", "angle"))
        # What common subexpressions leave behind: signs and orders of operands differ.
        assignments += [(slip, a - x if wheel % 2 else a + x), (angle, b / (x * x + 1))]
        slips, angles = [*slips, slip], [*angles, angle]
    results = tuple(sp.atan(s) * sp.atan(t) for s, t in zip(slips, angles, strict=True))
    steps = schedule(Function(tuple(assignments), results, (4,)))
    (batch,) = [step for step in steps if isinstance(step, Batch)]
    assert {batch.arguments[:4], batch.arguments[4:]} == {tuple(slips), tuple(angles)}
