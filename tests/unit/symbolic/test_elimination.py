"""Elimination with pivots chosen beforehand solves as a dense solver with pivoting does."""

from itertools import product

import numpy as np
import pytest
import sympy as sp

from tests.oracles.pivots import choose_pivots
from tests.unit.programs import function_of, pivot_shares, run
from vehiclemor.codegen.kernel_text import operation_counts, reference_source
from vehiclemor.multibody.double_wishbone.equations import PIVOTS
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.symbolic.elimination import (
    Pivots,
    eliminate,
)
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

p = sp.Symbol("p", real=True)


def sparse_matrix(seed: int, n: int) -> np.ndarray:
    """Random matrix with a nonzero in every row and column, far from singular, in random order."""
    rng = np.random.default_rng(seed)
    matrix = rng.uniform(-1.0, 1.0, (n, n)) * (rng.random((n, n)) < 0.3)
    np.fill_diagonal(matrix, rng.choice([-1.0, 1.0], n) * rng.uniform(2.0, 3.0, n))
    return matrix[rng.permutation(n)][:, rng.permutation(n)]


def solver(matrix: np.ndarray, pivots: Pivots) -> tuple[Program, dict[sp.Symbol, float]]:
    """Program `f` that solves for the symbols of the nonzeros, and the values of the symbols."""
    n = len(matrix)
    values: dict[sp.Symbol, float] = {}
    entries = [[sp.Integer(0)] * n for _ in range(n)]
    for i, j in product(range(n), range(n)):
        if matrix[i, j] != 0.0:
            entries[i][j] = sp.Symbol(f"a_{i}_{j}", real=True)
            values[entries[i][j]] = matrix[i, j]
    right_side = [sp.Symbol(f"b_{i}", real=True) for i in range(n)]
    tape = Tape()
    (unknowns,) = eliminate(tape, entries, [right_side], pivots)
    arguments = {"a": list(values), "b": right_side}
    # The last result gives the program a constant.
    program = assemble(tape, arguments, [p], {"f": ([*unknowns, p], (n + 1,))})
    return program, values


@pytest.mark.parametrize("seed", range(12))
def test_elimination_equals_a_dense_solve(seed: int) -> None:
    n = 3 + seed % 5
    matrix = sparse_matrix(seed, n)
    program, values = solver(matrix, choose_pivots(matrix))
    right_side = np.random.default_rng(100 + seed).standard_normal(n)
    values |= {sp.Symbol(f"b_{i}", real=True): right_side[i] for i in range(n)} | {p: 1.0}
    found = run(program, "f", values)[:n]
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right_side), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("seed", range(6))
def test_several_right_sides_are_solved_at_once(seed: int) -> None:
    n, sides = 4 + seed % 4, 1 + seed % 3
    matrix = sparse_matrix(seed, n)
    rng = np.random.default_rng(200 + seed)
    right_sides = rng.standard_normal((sides, n))
    # Structural zeros on the right as well.
    right_sides[0, 0] = 0.0
    pivots, tape = choose_pivots(matrix), Tape()
    entries = [[sp.Float(e) if e else sp.Integer(0) for e in row] for row in matrix]
    b = [[sp.Symbol(f"b_{k}_{i}", real=True) for i in range(n)] for k in range(sides)]
    b[0][0] = sp.Integer(0)
    together = eliminate(tape, entries, b, pivots)
    # What the right sides have in common is there once: one after the other adds nothing to it.
    length = len(tape.definitions)
    assert [eliminate(tape, entries, [side], pivots)[0] for side in b] == together
    assert len(tape.definitions) == length
    known = [symbol for side in b for symbol in side if symbol.is_Symbol]
    values = right_sides.flat[1:]
    found = np.array(function_of(tape, known, together)(*values))
    expected = np.linalg.solve(matrix, right_sides.T).T
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


def test_right_sides_do_not_change_their_arguments() -> None:
    a = [[sp.Symbol(f"a_{i}_{j}", real=True) for j in range(3)] for i in range(3)]
    b = [list(sp.symbols(f"b{k}_:3", real=True)) for k in range(2)]
    before = ([row.copy() for row in a], [side.copy() for side in b])
    eliminate(Tape(), a, b, ((0, 0), (1, 1), (2, 2)))
    assert (a, b) == before


def test_arrow_matrix_is_solved_without_fill() -> None:
    n = 8
    matrix = 4.0 * np.eye(n)
    matrix[0, :], matrix[:, 0] = 1.0, 1.0
    matrix[0, 0] = 10.0
    program, _ = solver(matrix, choose_pivots(matrix))
    counts = operation_counts(reference_source(program))["f"]
    assert counts["divide"] == n
    # For each row but the last: a factor, two updates, a known term, a quotient.
    assert counts["multiply"] == 5 * (n - 1) + 1
    assert counts["add"] == 3 * (n - 1)


@pytest.mark.parametrize("seed", range(6))
def test_pivots_are_a_permutation_above_the_threshold(seed: int) -> None:
    matrix = sparse_matrix(seed, 7)
    pivots = choose_pivots(matrix, threshold=0.5)
    assert sorted(r for r, _ in pivots) == sorted(c for _, c in pivots) == list(range(7))
    for share in pivot_shares(matrix, pivots):
        assert share >= 0.5


def test_a_small_pivot_is_passed_over() -> None:
    matrix = np.array([[1e-6, 1.0], [1.0, 1.0]])
    assert (0, 0) not in choose_pivots(matrix)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((2, 2)),
        np.array([[1.0, 0.0, 2.0], [3.0, 0.0, 4.0], [5.0, 0.0, 6.0]]),
        np.array([[1.0, 2.0], [2.0, 4.0]]),
        np.outer([0.1, 0.2, 0.3], [0.3, 0.7, 0.9]) + np.outer([1.0, -1.0, 0.5], [0.1, 0.2, -0.4]),
    ],
    ids=["zero", "zero column", "dependent rows", "rank 2 of 3 with rounding"],
)
def test_singular_matrix_has_no_pivots(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="singular"):
        choose_pivots(matrix)


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
