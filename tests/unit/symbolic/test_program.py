"""Tapes name results once; programs keep their values, and evaluate parameter terms once."""

import numpy as np
import pytest
import sympy as sp

from tests.unit.programs import inlined, precise, random_program, run
from vehiclemor.codegen.lowering import kernels_of
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

x, y, p, r = sp.symbols("x y p r", real=True)


# Tapes


def test_equal_expressions_share_one_name():
    tape = Tape()
    name = tape.let(x * y + sp.sin(p))
    assert tape.let(sp.sin(p) + y * x) is name
    assert tape.let(-(x * y) - sp.sin(p)) == -name
    assert list(tape.definitions) == [name]


def test_numbers_symbols_and_negated_symbols_get_no_name():
    tape = Tape()
    assert [tape.let(e) for e in (0, 2.5, x, -x)] == [0, 2.5, x, -x]
    assert not tape.definitions


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_equal_those_of_sympy(seed):
    variables = (x, y, p)
    tape, results = random_program(seed, variables)
    direct = [inlined(result, tape) for result in results]
    jacobian = tape.jacobian(results, variables)
    entries = [inlined(entry, tape) for row in jacobian for entry in row]
    at = dict(zip(variables, np.random.default_rng(seed).uniform(-1.5, 1.5, 3), strict=True))
    found = precise(entries, at).reshape(3, 3)
    exact = precise([e.diff(v) for e in direct for v in variables], at).reshape(3, 3)
    np.testing.assert_allclose(found, exact, rtol=1e-14, atol=1e-15)


def test_derivative_expressions_do_not_grow_along_a_chain():
    tape, link = Tape(), x
    for _ in range(40):
        link = tape.let(sp.sin(tape.let(link * y)))
    tape.jacobian([link], (x, y))
    assert max(e.count_ops() for e in tape.definitions.values()) < 10


# Programs


def assembled(expression: sp.Expr) -> Program:
    return assemble(Tape(), {"q": [x, y]}, [p, r], {"f": ([expression], (1,))})


@pytest.mark.parametrize("seed", range(8))
def test_program_keeps_the_value_of_every_function(seed: int):
    tape, results = random_program(seed, (x, y, p, r), length=20)
    jacobian = [e for row in tape.jacobian(results, (x, y)) for e in row]
    program = assemble(
        tape, {"q": [x], "u": [y]}, [p, r], {"f": (results, (3,)), "g": (jacobian, (3, 2))}
    )
    at = dict(zip((x, y, p, r), np.random.default_rng(seed).uniform(-1.2, 1.2, 4), strict=True))
    for name, expressions in (("f", results), ("g", jacobian)):
        direct = precise([inlined(e, tape) for e in expressions], at)
        np.testing.assert_allclose(run(program, name, at).ravel(), direct, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    ("expression", "left"),
    [
        (sp.sin(p) * sp.cos(r) * x + sp.sqrt(p) * r + 1, {"multiply": 1, "add": 1}),
        ((p * r + 2) * x * y, {"multiply": 2}),
        (x + p + r, {"add": 1}),
        (x / (p * p + r), {"multiply": 1}),
        (sp.log(p + r) ** 2, {}),
        (2 * x + p, {"multiply": 1, "add": 1}),
    ],
)
def test_parameter_terms_are_hoisted(expression: sp.Expr, left: dict[str, int]):
    program = assembled(expression)
    counts = kernels_of(program)["f"].counts
    assert {kind: n for kind, n in counts.items() if n and kind != "total"} == left
    at = {x: 0.7, y: -1.3, p: 0.4, r: 1.9}
    assert run(program, "f", at)[0] == pytest.approx(precise([expression], at)[0], rel=1e-14)


def test_each_function_holds_what_it_needs_and_no_more():
    tape = Tape()
    shared, alone = tape.let(x * y), tape.let(sp.sin(x))
    tape.let(sp.exp(x))
    program = assemble(
        tape,
        {"q": [x, y]},
        [p],
        {"f": ([shared + p], (1,)), "g": ([shared * alone], (1,))},
    )
    for function in program.functions.values():
        known, needed = {x, y, *program.constant_symbols}, set()
        for symbol, expression in function.assignments:
            assert expression.free_symbols <= known
            known.add(symbol)
        for expression in [e for _, e in function.assignments] + list(function.results):
            needed |= expression.free_symbols
        assert {symbol for symbol, _ in function.assignments} <= needed
        assert not any(e.has(sp.exp) for _, e in function.assignments)


def test_common_subexpressions_are_evaluated_once():
    tape = Tape()
    first, second = tape.let((x * y + 1) * x), tape.let((x * y + 1) * y)
    program = assemble(tape, {"q": [x, y]}, [p], {"f": ([first, second, p], (3,))})
    counts = kernels_of(program)["f"].counts
    assert (counts["multiply"], counts["add"]) == (3, 1)


def test_plain_numbers_are_results_too_without_any_hoisted_constant():
    program = assemble(Tape(), {"q": [x, y]}, [p], {"f": ([0, 1.5, x * y], (3,))})
    assert run(program, "f", {x: 2.0, y: 3.0, p: 1.0}).tolist() == [0.0, 1.5, 6.0]


@pytest.mark.parametrize(
    ("result", "size", "named"),
    [(1, 2, "1"), (sp.nan, 1, "nan"), (sp.zoo, 1, "zoo"), (sp.I, 1, "I"), (y, 1, "y")],
)
def test_results_that_are_none_are_named(result: object, size: int, named: str):
    with pytest.raises(ValueError, match=rf"\b{named}\b"):
        assemble(Tape(), {"x": [x]}, [], {"f": ([result], (size,))})
