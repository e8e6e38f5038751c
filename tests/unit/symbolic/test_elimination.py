"""Elimination with pivots chosen beforehand solves as a dense solver with pivoting does."""

import numpy as np
import pytest
import sympy as sp

from tests.oracles.pivots import choose_pivots
from tests.unit.programs import function_of, pivot_shares
from vehiclemor.multibody.double_wishbone.equations import PIVOTS
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.symbolic.elimination import (
    eliminate,
)
from vehiclemor.symbolic.tape import Tape


def sparse_matrix(seed: int, n: int) -> np.ndarray:
    """Random matrix with a nonzero in every row and column, far from singular, in random order."""
    rng = np.random.default_rng(seed)
    matrix = rng.uniform(-1.0, 1.0, (n, n)) * (rng.random((n, n)) < 0.3)
    np.fill_diagonal(matrix, rng.choice([-1.0, 1.0], n) * rng.uniform(2.0, 3.0, n))
    return matrix[rng.permutation(n)][:, rng.permutation(n)]


@pytest.mark.parametrize("seed", range(12))
def test_elimination_equals_a_dense_solve(seed: int) -> None:
    n, sides = 3 + seed % 5, 1 + seed % 3
    matrix = sparse_matrix(seed, n)
    right_sides = np.random.default_rng(200 + seed).standard_normal((sides, n))
    # Structural zeros on the right as well.
    right_sides[0, 0] = 0.0
    pivots, tape = choose_pivots(matrix), Tape()
    entries = [
        [sp.Symbol(f"a_{i}_{j}", real=True) if matrix[i, j] else sp.Integer(0) for j in range(n)]
        for i in range(n)
    ]
    b = [[sp.Symbol(f"b_{k}_{i}", real=True) for i in range(n)] for k in range(sides)]
    b[0][0] = sp.Integer(0)
    together = eliminate(tape, entries, b, pivots)
    # What the right sides have in common is there once: one after the other adds nothing to it.
    length = len(tape.definitions)
    assert [eliminate(tape, entries, [side], pivots)[0] for side in b] == together
    assert len(tape.definitions) == length
    known = [e for row in (*entries, *b) for e in row if e.is_Symbol]
    values = [*matrix[matrix != 0.0], *right_sides.flat[1:]]
    found = np.array(function_of(tape, known, together)(*values))
    expected = np.linalg.solve(matrix, right_sides.T).T
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


def test_arrow_matrix_is_solved_without_fill() -> None:
    n = 8
    matrix = 4.0 * np.eye(n)
    matrix[0, :], matrix[:, 0] = 1.0, 1.0
    matrix[0, 0] = 10.0
    names = [[sp.Symbol(f"a_{i}_{j}") if matrix[i, j] else 0 for j in range(n)] for i in range(n)]
    tape = Tape()
    eliminate(tape, names, [sp.symbols(f"b:{n}")], choose_pivots(matrix))
    # For each row but the last: an inverse, a factor, two updates, a known term and a quotient.
    assert len(tape.definitions) == 6 * (n - 1) + 2


@pytest.fixture(scope="module")
def states(model: AlgebraicModel) -> list[tuple[np.ndarray, np.ndarray]]:
    """1000 positions beside the solutions for random heights of +-0.2 m at five racks."""
    rng = np.random.default_rng(7)
    found = []
    for rack in (-0.05, -0.02, 0.0, 0.02, 0.05):
        heights = np.sort(rng.uniform(-0.2, 0.2, 200))
        inputs = np.column_stack([heights, np.full(200, rack)])
        path = model.solve_path(np.arange(200.0), inputs).coordinates
        found += [(q + rng.normal(0.0, 0.01, 8), u) for q, u in zip(path, inputs, strict=True)]
    return found


def test_pivots_of_the_model_follow_the_rule(
    model: AlgebraicModel, states: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    pattern = np.any([model.jacobian(*state) != 0.0 for state in states[::50]], axis=0)
    design = model.jacobian(model.design, np.zeros(2))
    # Entries that vanish at the design position alone count as nonzeros, but are no pivots.
    design[pattern & (np.abs(design) < 1e-12)] = 1e-9
    assert choose_pivots(design) == PIVOTS


def test_newton_step_equals_a_dense_solve(
    model: AlgebraicModel, states: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    assert len(states) == 1000
    for q, u in states:
        dense = np.linalg.solve(model.jacobian(q, u), model.residual(q, u))
        error = np.abs(model.newton_step(q, u) - dense).max()
        assert error <= 1e-12 * np.abs(dense).max()


def test_pivots_of_the_model_stay_away_from_zero(
    model: AlgebraicModel, states: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    shares = [pivot_shares(model.jacobian(q, u), PIVOTS) for q, u in states]
    assert np.min(shares) > 0.1
