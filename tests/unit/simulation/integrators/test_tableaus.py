"""Order conditions of the integrators' coefficients.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (2nd ed., 1993),
section II.2; E. Hairer, G. Wanner, II (2nd ed., 1996), sections IV.7 and IV.15; J. Rang,
L. Angermann, BIT Numer. Math. 45 (2005) 761-787.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from vehiclemor.simulation.integrators import dopri5 as pair
from vehiclemor.simulation.integrators import ros34pw2, tableaus


def unpacked() -> tuple[SimpleNamespace, SimpleNamespace]:
    """Coefficients of RODAS and ROS34PW2 by the names of the literature."""
    rows, gamma = tableaus.rodas4(), ros34pw2.GAMMA
    first = SimpleNamespace(
        a=rows[:6], c=rows[6:12], alpha=rows[12], d=rows[13], m=rows[14], e=rows[15], gamma=0.25
    )
    rows = tableaus.ros34pw2()
    second = SimpleNamespace(
        a=rows[:4], c=rows[4:8] / gamma, alpha=rows[8], m=rows[9], e=rows[10], gamma=gamma
    )
    return first, second


RODAS4, ROS34PW2 = unpacked()


def trees(order):
    """Rooted trees of an order, as tuples of subtrees."""
    if order == 1:
        return [()]
    found = set()
    for smaller in trees(order - 1):
        found |= set(with_leaf(smaller))
    return sorted(found)


def with_leaf(tree):
    """Trees with one more leaf."""
    yield tuple(sorted((*tree, ())))
    for k, branch in enumerate(tree):
        for grown in with_leaf(branch):
            yield tuple(sorted((*tree[:k], grown, *tree[k + 1 :])))


def size(tree):
    return 1 + sum(size(branch) for branch in tree)


def density(tree):
    return size(tree) * math.prod(density(branch) for branch in tree)


def weights(tree, a):
    """Elementary weights of a tree at the stages (s,) of a Runge-Kutta matrix."""
    product = np.ones(len(a))
    for branch in tree:
        product = product * (a @ weights(branch, a))
    return product


def dormand_prince():
    """Matrix, weights, error weights and weights of the dense output's last term."""
    a = np.zeros((7, 7))
    for i in range(2, 7):
        for j in range(1, i):
            a[i - 1, j - 1] = getattr(pair, f"A{i}{j}")
    b = np.array([pair.B1, 0.0, pair.B3, pair.B4, pair.B5, pair.B6, 0.0])
    a[6] = b
    error = np.array([pair.E1, 0.0, pair.E3, pair.E4, pair.E5, pair.E6, pair.E7])
    dense = np.array([pair.D1, 0.0, pair.D3, pair.D4, pair.D5, pair.D6, pair.D7])
    return a, b, error, dense


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_the_explicit_pair_has_orders_5_and_4_and_dense_output_of_order_4(order):
    a, b, error, dense = dormand_prince()
    assert len(trees(order)) == [1, 1, 2, 4, 9][order - 1]
    unit = np.eye(7)
    for tree in trees(order):
        stage = weights(tree, a)
        assert b @ stage == pytest.approx(1 / density(tree), abs=1e-15)
        if order == 5:
            continue
        assert (b - error) @ stage == pytest.approx(1 / density(tree), abs=1e-15)
        for z in (0.1, 0.37, 0.8):
            bend, back = unit[0] - b, 2 * b - unit[0] - unit[6]
            at = z * (b + (1 - z) * (bend + z * (back + (1 - z) * dense)))
            assert at @ stage == pytest.approx(z**order / density(tree), abs=1e-14)
    if order == 5:
        stages = [weights(tree, a) for tree in trees(5)]
        assert max(abs(error @ stage) for stage in stages) > 1e-4


def rosenbrock(tableau: SimpleNamespace):
    """alpha, Gamma, b and embedded b of the original form, from the transformed one."""
    gamma = np.linalg.inv(np.eye(len(tableau.m)) / tableau.gamma - tableau.c)
    embedded = tableau.m - tableau.e
    return tableau.a @ gamma, gamma, tableau.m @ gamma, embedded @ gamma


def stage_products(tableau: SimpleNamespace, order: int):
    """Stage vectors that b must weight to zero, or to 1 / density, by the Rosenbrock conditions."""
    alpha, gamma, _, _ = rosenbrock(tableau)
    beta, one = alpha + gamma, np.ones(len(tableau.m))
    at, image = alpha @ one, beta @ one
    conditions = {
        1: [(one, 1)],
        2: [(image, 1 / 2)],
        3: [(at**2, 1 / 3), (beta @ image, 1 / 6)],
        4: [
            (at**3, 1 / 4),
            (at * (alpha @ image), 1 / 8),
            (beta @ at**2, 1 / 12),
            (beta @ beta @ image, 1 / 24),
        ],
    }
    return [condition for k in range(1, order + 1) for condition in conditions[k]]


def test_rodas4_satisfies_the_conditions_of_orders_4_and_3():
    _, gamma, b, embedded = rosenbrock(RODAS4)
    for stage, value in stage_products(RODAS4, 4):
        assert b @ stage == pytest.approx(value, abs=1e-13)
    for stage, value in stage_products(RODAS4, 3):
        assert embedded @ stage == pytest.approx(value, abs=1e-13)
    assert max(abs(embedded @ s - value) for s, value in stage_products(RODAS4, 4)) > 1e-3
    # Times of the stages and weights of the time derivative belong to the same matrices.
    alpha = rosenbrock(RODAS4)[0]
    np.testing.assert_allclose(alpha.sum(axis=1), RODAS4.alpha, atol=1e-13)
    np.testing.assert_allclose(gamma.sum(axis=1), RODAS4.d, atol=1e-13)


@pytest.mark.parametrize("tableau", [RODAS4, ROS34PW2], ids=["rodas4", "ros34pw2"])
def test_rosenbrock_methods_are_l_stable(tableau):
    alpha, gamma, b, _ = rosenbrock(tableau)
    beta, one = alpha + gamma, np.ones(len(b))
    assert 1.0 - b @ np.linalg.solve(beta, one) == pytest.approx(0.0, abs=1e-12)
    imaginary = 1j * np.logspace(-2, 5, 400)
    growth = [1 + z * b @ np.linalg.solve(np.eye(len(b)) - z * beta, one) for z in imaginary]
    assert np.abs(growth).max() <= 1.0 + 1e-12


def test_ros34pw2_has_order_3_and_2_with_any_matrix_in_place_of_the_jacobian():
    alpha, gamma, b, embedded = rosenbrock(ROS34PW2)
    one = np.ones(4)
    at, turned = alpha @ one, gamma @ one
    second = [(one, 1.0), (at, 1 / 2), (turned, 0.0)]
    third = [
        (at**2, 1 / 3),
        (alpha @ at, 1 / 6),
        (alpha @ turned, 0.0),
        (gamma @ at, 0.0),
        (gamma @ turned, 0.0),
    ]
    for stage, value in [*second, *third]:
        assert b @ stage == pytest.approx(value, abs=1e-14)
    for stage, value in second:
        assert embedded @ stage == pytest.approx(value, abs=1e-14)
    assert max(abs(embedded @ stage - value) for stage, value in third) > 1e-3
    np.testing.assert_allclose(at, ROS34PW2.alpha, atol=1e-15)
