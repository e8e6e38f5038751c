"""Elementary functions are evaluated in batches, each when its arguments are known."""

import numpy as np
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.codegen.schedule import Batch, schedule
from vehiclemor.symbolic.program import Function


def real(names: str) -> tuple[sp.Symbol, ...]:
    return sp.symbols(names, real=True)


def random_function(seed: int) -> Function:
    """Straight-line function with many sines and arctangents of named results."""
    rng = np.random.default_rng(seed)
    known = list(real("x0 x1 x2"))
    assignments = []
    for number in range(40):
        a, b = (known[int(k)] for k in rng.integers(len(known), size=2))
        choices = [a * b, a + b, sp.sin(a) + b, sp.atan(a) * b, sp.cos(a) * sp.atan(b), a - 2]
        symbol = sp.Symbol(f"_v{number}", real=True)
        assignments.append((symbol, choices[int(rng.integers(len(choices)))]))
        known.append(symbol)
    results = (sp.sin(known[-1]), sp.atan(known[-2]), known[-3], known[-4])
    return Function(tuple(assignments), results, (4,))


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_every_argument_is_known_before_it_is_used(seed):
    function = random_function(seed)
    known, answered, kept = set(real("x0 x1 x2")), set(), []
    kinds = {sp.sin: "sincos", sp.cos: "sincos", sp.atan: "atan"}

    def used(expression):
        assert expression.free_symbols <= known
        for call in expression.atoms(sp.sin, sp.cos, sp.atan):
            assert (kinds[call.func], call.args[0]) in answered

    for step in schedule(function):
        if isinstance(step, Batch):
            assert set(step.arguments) <= known
            assert len(set(step.arguments)) == len(step.arguments)
            assert not {(step.name, argument) for argument in step.arguments} & answered
            answered |= {(step.name, argument) for argument in step.arguments}
        else:
            used(step[1])
            known.add(step[0])
            kept.append(step)
    assert sorted(kept, key=str) == sorted(function.assignments, key=str)
    for result in function.results:
        used(result)


def test_independent_calls_share_one_batch():
    x = real("x0 x1 x2 x3")
    named = [sp.Symbol(f"_v{k}", real=True) for k in range(4)]
    assignments = [(named[k], sp.atan(x[k]) + 1) for k in range(4)]
    batches = [
        step
        for step in schedule(Function(tuple(assignments), tuple(named), (4,)))
        if isinstance(step, Batch)
    ]
    assert batches == [Batch("atan", tuple(x))]


def test_the_same_quantity_of_all_wheels_stands_side_by_side():
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
