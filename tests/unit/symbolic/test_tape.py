"""The tape names results once, and its derivatives are those of what the names stand for."""

import numpy as np
import pytest
import sympy as sp

from tests.unit.programs import inlined, precise, random_program
from vehiclemor.symbolic.tape import Tape, dependencies

x, y, z = sp.symbols("x y z", real=True)


def test_equal_expressions_share_one_name() -> None:
    tape = Tape()
    name = tape.let(x * y + sp.sin(z))
    assert tape.let(sp.sin(z) + y * x) is name
    assert tape.let(-(x * y) - sp.sin(z)) == -name
    assert list(tape.definitions) == [name]


def test_numbers_symbols_and_negated_symbols_get_no_name() -> None:
    tape = Tape()
    assert [tape.let(e) for e in (0, 2.5, x, -x)] == [0, 2.5, x, -x]
    assert not tape.definitions


def test_every_name_is_defined_by_earlier_ones() -> None:
    tape, results = random_program(3, (x, y, z))
    tape.jacobian(results, (x, y, z))
    known = {x, y, z}
    for symbol, expression in tape.definitions.items():
        assert expression.free_symbols <= known
        assert symbol not in known
        known.add(symbol)


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_equal_those_of_sympy(seed: int) -> None:
    variables = (x, y, z)
    tape, results = random_program(seed, variables)
    direct = [inlined(result, tape) for result in results]
    jacobian = tape.jacobian(results, variables)
    entries = [inlined(entry, tape) for row in jacobian for entry in row]
    at = dict(zip(variables, np.random.default_rng(seed).uniform(-1.5, 1.5, 3), strict=True))
    found = precise(entries, at).reshape(3, 3)
    exact = precise([e.diff(v) for e in direct for v in variables], at).reshape(3, 3)
    np.testing.assert_allclose(found, exact, rtol=1e-14, atol=1e-15)


def test_derivative_expressions_do_not_grow_along_a_chain() -> None:
    tape, link = Tape(), x
    for _ in range(40):
        link = tape.let(sp.sin(tape.let(link * y)))
    tape.jacobian([link], (x, y))
    assert max(e.count_ops() for e in tape.definitions.values()) < 10


def test_dependencies_are_complete_and_ordered() -> None:
    tape = Tape()
    a, unused = tape.let(x + y), tape.let(x * z)
    b = tape.let(sp.cos(a))
    c = tape.let(b * a)
    assert dependencies([c], tape.definitions) == [a, b, c]
    assert unused not in dependencies([c + b], tape.definitions)
