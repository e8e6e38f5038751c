"""Matrix functions of the exponential method.

N. Higham, Functions of Matrices (SIAM 2008), chapter 10; S. Krogstad, J. Comput. Phys. 203 (2005).
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from vehiclemor.simulation.integrators.exponential_functions import (
    exponential_tables,
    phi_functions,
)


def augmented(matrix: np.ndarray) -> list[np.ndarray]:
    """phi_0 to phi_3 as blocks of one matrix exponential (Higham, theorem 10.15)."""
    n = len(matrix)
    large = np.zeros((4 * n, 4 * n))
    large[:n, :n] = matrix
    for k in range(3):
        large[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    blocks = expm(large)[:n]
    return [blocks[:, k * n : (k + 1) * n] for k in range(4)]


@pytest.mark.parametrize("norm", [0.0, 1e-3, 1.0, 30.0, 500.0])
@given(seed=st.integers(0, 10**6))
def test_phi_functions_agree_with_one_exponential(norm, seed):
    random = np.random.default_rng(seed)
    # Stable, with a defective pair, as those of stabilised constraints.
    z = -np.diag([0.0, 0.1, 0.5, 1.0, 1.0]) + np.diag([0.3, 0.2, 0.0, 1.0], 1)
    q, _ = np.linalg.qr(random.normal(size=(5, 5)))
    z = norm * (q @ z @ q.T)
    for found, expected in zip(phi_functions(z), augmented(z), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


def test_the_tables_hold_what_a_step_needs():
    rates, h = np.array([[-3.0, 2.0], [-2.0, -3.0]]), 0.25
    (table,) = exponential_tables(rates, [h])
    _, half1, half2, _ = augmented(0.5 * h * rates)
    _, phi1, phi2, phi3 = augmented(h * rates)
    expected = [rates, half1 / 2, half2, phi1, 2 * phi2, 2 * phi2 - 4 * phi3, 4 * phi3 - phi2]
    np.testing.assert_allclose(table, [matrix.T for matrix in expected], rtol=1e-12, atol=1e-14)
