"""Elimination with pivots chosen beforehand solves as a dense solver with pivoting does."""

import numpy as np
import pytest
import sympy as sp

from tests.unit.programs import function_of, pivot_shares
from vehiclemor.multibody.double_wishbone.equations import PIVOTS
from vehiclemor.symbolic.elimination import eliminate, eliminate_symmetric
from vehiclemor.symbolic.tape import Tape


def symbols_of(matrix: np.ndarray, name: str) -> list[list[sp.Expr]]:
    """A symbol for each entry that is not zero; those of a symmetric matrix are pairs."""
    symmetric = matrix.shape[0] == matrix.shape[1] and np.array_equal(matrix, matrix.T)

    def entry(i: int, j: int) -> sp.Expr:
        i, j = (max(i, j), min(i, j)) if symmetric else (i, j)
        return sp.Symbol(f"{name}_{i}_{j}", real=True) if matrix[i, j] else sp.Integer(0)

    return [[entry(i, j) for j in range(matrix.shape[1])] for i in range(len(matrix))]


def values(tape: Tape, known: list, given: list, results: list) -> np.ndarray:
    pairs = dict(zip(sp.flatten(known), np.concatenate([np.ravel(g) for g in given]), strict=True))
    pairs.pop(sp.Integer(0), None)
    return np.array(function_of(tape, list(pairs), results)(*pairs.values()))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("symmetric", [False, True])
def test_elimination_equals_a_dense_solve(seed, symmetric):
    rng, n, sides = np.random.default_rng(seed), 3 + seed % 6, 1 + seed % 3
    sparse = rng.uniform(-1.0, 1.0, (n, n)) * (rng.random((n, n)) < 0.3)
    # Pivots that stay away from zero, somewhere.
    np.fill_diagonal(sparse, rng.choice([-1.0, 1.0], n) * rng.uniform(2.0, 3.0, n))
    rows, columns, order = (rng.permutation(n).tolist() for _ in range(3))
    matrix = sparse[rows][:, columns]
    right = rng.standard_normal((sides, n))
    # Structural zeros on the right as well.
    right[0, 0] = 0.0
    tape = Tape()
    if symmetric:
        matrix = (sparse @ sparse.T)[rows][:, rows]
        a, b = symbols_of(matrix, "a"), symbols_of(right, "b")
        solved = [eliminate_symmetric(tape, a, side, order) for side in b]
        together = [[x[k] for k in range(len(a))] for x in solved]
    else:
        a, b = symbols_of(matrix, "a"), symbols_of(right, "b")
        pivots = tuple((rows.index(k), columns.index(k)) for k in order)
        together = eliminate(tape, a, b, pivots)
        # What right sides have in common is there once: one after the other adds nothing to it.
        length = len(tape.definitions)
        assert [eliminate(tape, a, [side], pivots)[0] for side in b] == together
        assert len(tape.definitions) == length
    found = values(tape, [a, b], [matrix, right], together)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right.T).T, rtol=1e-9, atol=1e-11)


def test_arrow_matrix_is_solved_without_fill():
    n, tape = 8, Tape()
    matrix = 4.0 * np.eye(n)
    matrix[0, :], matrix[:, 0] = 1.0, 2.0
    pivots = tuple((k, k) for k in (*range(1, n), 0))
    eliminate(tape, symbols_of(matrix, "a"), [sp.symbols(f"b:{n}")], pivots)
    # For each row but the last: an inverse, a factor, two updates, a known term and a quotient.
    assert len(tape.definitions) == 6 * (n - 1) + 2


def test_pivots_of_the_suspension_stay_away_from_zero_and_lose_no_digit(model):
    """Beside the solutions for random heights of +-0.2 m at five racks."""
    rng, shares = np.random.default_rng(7), []
    for rack in (-0.05, -0.02, 0.0, 0.02, 0.05):
        inputs = np.column_stack([np.sort(rng.uniform(-0.2, 0.2, 200)), np.full(200, rack)])
        path = model.solve_path(np.arange(200.0), inputs).coordinates
        for q, u in zip(path + rng.normal(0.0, 0.01, path.shape), inputs, strict=True):
            jacobian = model.jacobian(q, u)
            dense = np.linalg.solve(jacobian, model.residual(q, u))
            error = np.abs(model.evaluated("newton_step", q, u) - dense).max()
            assert error <= 1e-12 * np.abs(dense).max()
            shares.append(pivot_shares(jacobian, PIVOTS))
    assert np.min(shares) > 0.1
