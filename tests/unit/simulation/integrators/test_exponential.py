"""Exponential methods: matrix functions, modes, and systems with defective Jacobians.

N. Higham, Functions of Matrices (SIAM 2008), chapter 10; S. Krogstad, J. Comput. Phys. 203 (2005).
"""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from tests.unit.python_system import python_system
from tests.unit.standard_problems import maneuver
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.integrators.etdrk4 import (
    exponential_tables,
    phi_functions,
)
from vehiclemor.simulation.integrators.exponential_modes import modal_tables, modes
from vehiclemor.simulation.integrators.step_kernels import partners, signs
from vehiclemor.simulation.system import Solver

SOLVER = "exponential_adams"
QUIET = maneuver(lambda t, *_: np.zeros((len(t), 3)), 4.0)


def exact_functions(matrix: np.ndarray, highest: int) -> list[np.ndarray]:
    """phi_0 to the highest as blocks of one matrix exponential (Higham, theorem 10.15)."""
    n = len(matrix)
    large = np.zeros(((highest + 1) * n, (highest + 1) * n))
    large[:n, :n] = matrix
    large[: highest * n, n:] += np.eye(highest * n)
    return np.split(expm(large)[:n], highest + 1, axis=1)


@pytest.mark.parametrize("norm", [0.0, 1e-3, 1.0, 30.0, 500.0])
def test_phi_functions_agree_with_one_exponential(norm):
    # Stable, with a defective pair, as those of stabilised constraints.
    z = -np.diag([0.0, 0.1, 0.5, 1.0, 1.0]) + np.diag([0.3, 0.2, 0.0, 1.0], 1)
    for seed in range(20):
        q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(5, 5)))
        matrix = norm * (q @ z @ q.T)
        pairs = zip(phi_functions(matrix), exact_functions(matrix, 3), strict=True)
        for found, expected in pairs:
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


def test_the_tables_hold_what_a_step_needs():
    rates, h = np.array([[-3.0, 2.0], [-2.0, -3.0]]), 0.25
    (table,) = exponential_tables(rates, [h])
    _, half1, half2, _ = exact_functions(0.5 * h * rates, 3)
    _, phi1, phi2, phi3 = exact_functions(h * rates, 3)
    expected = [rates, half1 / 2, half2, phi1, 2 * phi2, 2 * phi2 - 4 * phi3, 4 * phi3 - phi2]
    np.testing.assert_allclose(table, [matrix.T for matrix in expected], rtol=1e-12, atol=1e-14)


def jordan(value: float, size: int) -> np.ndarray:
    # Couplings as large as the eigenvalue: much smaller ones are left out by intent.
    return value * np.eye(size) + max(1.0, abs(value)) * np.diag(np.ones(size - 1), 1)


OSCILLATOR = np.array([[-1.0, 7.0], [-7.0, -1.0]])
SPECTRA = {
    "single and double": block_diag(OSCILLATOR, [[-30.0]], [[-4.0]], [[-4.0]]),
    "the same oscillator twice": block_diag(OSCILLATOR, OSCILLATOR, [[-2.0]]),
    "three defective pairs": block_diag(*[jordan(-50.0, 2)] * 3, OSCILLATOR, [[-500.0]]),
    "a defective and a plain one": block_diag(jordan(-5.0, 2), [[-5.0]], [[-5.0]], [[2.0]]),
    "zero, defective": block_diag(jordan(0.0, 3), OSCILLATOR, [[-3.0]]),
    "nothing": np.zeros((2, 2)),
}


def similar(matrix: np.ndarray, seed: int) -> np.ndarray:
    """The matrix in other, not orthogonal, coordinates."""
    random = np.random.default_rng(seed)
    one, two = (np.linalg.qr(random.normal(size=matrix.shape))[0] for _ in range(2))
    scaled = one @ np.diag(np.linspace(1.0, 3.0, len(matrix))) @ two
    return scaled @ matrix @ np.linalg.inv(scaled)


def assembled(found, diagonal, forth, back) -> np.ndarray:
    """A function of the modes as a matrix (n, n)."""
    r, pairs = len(found.rates), len(found.forth)
    one, two = np.arange(r - 2 * pairs, r - pairs), np.arange(r - pairs, r)
    block = np.diag(diagonal)
    block[one, two], block[two, one] = forth, back
    return found.columns @ block @ found.rows


@pytest.mark.parametrize("name", SPECTRA)
@pytest.mark.parametrize("seed", range(20))
def test_modes_restore_what_is_not_nilpotent(name, seed):
    matrix = similar(SPECTRA[name], seed)
    found = modes(matrix)
    np.testing.assert_allclose(
        found.rows @ found.columns, np.eye(len(found.rates)), rtol=0, atol=1e-9
    )
    # Of a matrix of zeros and a chain of them nothing is kept.
    expected = matrix
    if "zero" in name:
        expected = similar(block_diag(np.zeros((3, 3)), SPECTRA[name][3:, 3:]), seed)
    restored = assembled(found, found.rates, found.forth, found.back)
    np.testing.assert_allclose(restored, expected, rtol=0, atol=1e-5 * np.abs(matrix).max() + 1e-9)


def test_a_longer_jordan_chain_is_left_out_but_for_its_eigenvalue():
    found = modes(similar(jordan(-5.0, 3), 1))
    restored = assembled(found, found.rates, found.forth, found.back)
    np.testing.assert_allclose(restored, -5.0 * np.eye(3), atol=1e-3)


@pytest.mark.parametrize("h", [1e-3, 0.1, 8.0])
@pytest.mark.parametrize("name", ["three defective pairs", "the same oscillator twice"])
def test_tables_are_the_phi_functions(name, h):
    matrix, highest = similar(SPECTRA[name], 3), 6
    found = modes(matrix)
    (table,) = modal_tables(found, np.array([h]), highest)
    exact = exact_functions(h * matrix, highest)
    r, pairs = len(found.rates), len(found.forth)
    for k in range(1, highest + 1):
        parts = table[k - 1, :r], table[k - 1, r : r + pairs], table[k - 1, r + pairs :]
        np.testing.assert_allclose(assembled(found, *parts), exact[k], rtol=0, atol=1e-6)


def test_partners_are_told_by_names_and_an_asymmetric_system_has_no_signs():
    names = ["y", "z_FL", "z_FR", "z_RR_dot", "z_RL_dot", "lone_FL"]
    assert partners(names).tolist() == [0, 2, 1, 4, 3, 5]
    assert signs(np.array([[-1.0, 2.0], [3.0, -4.0]]), np.array([1, 0])) is None


def run(system, start, tolerance, times, longest=None):
    found = system.run(
        QUIET, np.array(start), whole_space(len(start)), Solver(SOLVER, tolerance, times, longest)
    )
    assert not found.failure
    return found


@pytest.mark.parametrize("rate", [1.0, 50.0, 1000.0])
def test_stabilised_constraint_with_a_defective_jacobian(rate):
    # e'' + 2 a e' + a^2 e = 0 beside a pendulum, whose Jacobian at rest is not that in motion.
    def slopes(x, u):
        del u
        decay = -2.0 * rate * x[1] - rate**2 * x[0]
        return [x[1], decay, x[3], -math.sin(x[2]) + x[0]]

    system = python_system(slopes, [0.0, 0.0, 0.0, 0.0], 3)
    times = np.linspace(0.0, 4.0, 41)
    found = run(system, [0.1, 0.0, 1.0, 0.0], 1e-9, times)
    exact = 0.1 * (1.0 + rate * times) * np.exp(-rate * times)
    np.testing.assert_allclose(found.path[:, 0], exact, atol=2e-8)
    # Linear motion costs steps until it has decayed, but sets no limit to them later.
    assert found.counts[1] < 350


def test_a_system_without_a_jacobian_is_left_to_the_adams_formulas():
    # y' = -y^3 at y = 0; the exact solution is 1 / sqrt(1 + 2 t).
    system = python_system(lambda x, _: [-(x[0] ** 3), 0.0], [0.0, 0.0], 3)
    assert not np.abs(system.frozen_jacobian).max() > 1e-9
    times = np.linspace(0.0, 4.0, 9)
    found = run(system, [1.0, 0.0], 1e-10, times)
    np.testing.assert_allclose(found.path[:, 0], 1.0 / np.sqrt(1.0 + 2.0 * times), atol=1e-9)
