"""Compiled integrators on problems with known solutions, and the order conditions of their methods.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (2nd ed., 1993),
section II.2; E. Hairer, G. Wanner, II (2nd ed., 1996), sections IV.7 and IV.15; J. Rang,
L. Angermann, BIT Numer. Math. 45 (2005) 761-787.
"""

import itertools
import math

import numpy as np
import pytest
from vehiclemor.simulation.rosenbrock_methods import RODAS4, ROS34PW2, Tableau

from tests.unit.standard_problems import (
    ANGLE,
    ANGULAR_SPEED,
    EXPLODING,
    TRACKED,
    driven,
    maneuver,
)
from vehiclemor.simulation import explicit_loops as pair
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.system import SOLVERS
from vehiclemor.simulation.trajectory import Trajectory

LOOSE = 1e6
DRIVEN = maneuver(driven, 8.0)


@pytest.fixture(scope="module")
def model(standard) -> DynamicModel:
    return standard()


def integrate(model, man, solver, tolerance, times, longest_step=None) -> Trajectory:
    space = whole_space(2 * len(model.coordinates))
    return model.integrate(man, model.start(), space, solver, tolerance, times, longest_step)


def driven_error(model, solver, times, tolerance, longest_step=None) -> float:
    """Largest error of pendulum and tracked value, which are cos t."""
    times = np.asarray(times)
    found = integrate(model, DRIVEN, solver, tolerance, times, longest_step)
    assert found.status == "ok", found.message
    states = found.states
    exact = np.cos(times)
    errors = [states[:, ANGLE] - exact, states[:, TRACKED] - exact]
    errors.append(states[:, ANGULAR_SPEED] + np.sin(times))
    return float(np.abs(errors).max())


# Orders


ORDERS = {"dopri5": 5, "rodas4": 4, "ros34pw2": 3, "etdrk4": 4}


@pytest.mark.parametrize("solver", SOLVERS)
def test_error_falls_with_the_order_of_the_method(model, solver):
    # The pendulum's Jacobian changes between -1 and 1 with its angle, so a frozen one is wrong.
    steps = 0.16 / 2.0 ** np.arange(4)
    errors = [driven_error(model, solver, [8.0], LOOSE, h) for h in steps]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.median(orders) == pytest.approx(ORDERS[solver], abs=0.35), (orders, errors)


@pytest.mark.parametrize("solver", SOLVERS)
def test_dense_output_is_as_accurate_as_the_steps_demand(model, solver):
    between = np.linspace(0.0, 8.0, 999)
    steps = 0.16 / 2.0 ** np.arange(4)
    errors = [driven_error(model, solver, between, LOOSE, h) for h in steps]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    # Interpolation is of order 4 in the explicit pair (5 on one step) and of order 3 elsewhere (4).
    assert np.median(orders) > ORDERS[solver] - 0.35, (orders, errors)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_sample_times_do_not_change_the_steps(model, solver):
    few = integrate(model, DRIVEN, solver, 1e-6, np.array([0.0, 8.0]))
    many = integrate(model, DRIVEN, solver, 1e-6, np.linspace(0.0, 8.0, 777))
    assert many.counts == few.counts
    np.testing.assert_array_equal(many.states[-1], few.states[-1])
    np.testing.assert_array_equal(many.states[0], model.start())


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_tighter_tolerance_gives_a_smaller_error(model, solver):
    errors = [driven_error(model, solver, [8.0], tol) for tol in (1e-3, 1e-5, 1e-7, 1e-9)]
    assert all(later < 0.1 * earlier for earlier, later in itertools.pairwise(errors))
    # The local errors add up, amplified a little; each is at most the tolerance.
    assert errors[-1] < 1e-7


def test_rosenbrock_steps_are_not_limited_by_stiffness(standard):
    stiff = standard(rate=1e6)
    end = np.array([8.0])
    soft = integrate(standard(), DRIVEN, "rodas4", 1e-5, end)
    found = integrate(stiff, DRIVEN, "rodas4", 1e-5, end)
    assert found.states[0, TRACKED] == pytest.approx(math.cos(8.0), abs=1e-6)
    assert found.counts["steps"] < 4 * soft.counts["steps"]


@pytest.mark.parametrize("solver", ["rodas4", "ros34pw2", "etdrk4"])
def test_a_stiff_transient_is_damped_at_once(standard, solver):
    # Decay by exp(-1e8): a method that is stable but not L-stable would carry the distance on.
    far = standard(rate=1e9, tracked=2.0, angle=0.0)
    still = maneuver(lambda t, *_: np.array([0.0, 1.0, 0.0]) + 0.0 * t[:, None], 8.0)
    found = integrate(far, still, solver, 1e-3, np.array([8.0]))
    assert found.status == "ok", found.message
    np.testing.assert_allclose(found.states[:, TRACKED], 1.0, atol=1e-6)
    assert found.counts["steps"] < 300


@pytest.mark.parametrize("solver", ["ros34pw2", "etdrk4"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_fast_linear_motion_is_right_between_the_steps_too(standard, solver, tolerance):
    # Towards 1 at 45 1/s, which the exponential method could do in one step.
    model = standard(rate=45.0, angle=0.0, tracked=0.0)
    still = maneuver(lambda t, *_: np.array([0.0, 1.0, 0.0]) + 0.0 * t[:, None], 8.0)
    times = np.linspace(0.0, 1.0, 101)
    found = integrate(model, still, solver, tolerance, times)
    exact = 1.0 - np.exp(-45.0 * times)
    assert np.abs(found.states[:, TRACKED] - exact).max() < 4.0 * tolerance


# Counts


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
@pytest.mark.parametrize("solver", SOLVERS)
def test_counts_follow_from_the_steps(model, solver, tolerance):
    corners = maneuver(driven, 8.0, (2.0, 5.0))
    counts = integrate(model, corners, solver, tolerance, corners.times).counts
    spans, states = 3, 4
    attempts = counts["steps"] + counts["rejected_steps"]
    if solver == "dopri5":
        expected = spans + 6 * attempts, 0, 0, 0
    elif solver == "rodas4":
        # One Jacobian by differences (and one more call for the time derivative) in each place.
        jacobians = counts["steps"]
        calls = spans + jacobians * (states + 1) + 5 * attempts + counts["steps"]
        expected = calls, jacobians, attempts, 6 * attempts
    elif solver == "etdrk4":
        # The end of a step is evaluated for the estimate of its error.
        expected = spans + 4 * attempts, 0, 0, 0
    else:
        expected = spans + 3 * attempts + counts["steps"], 0, 0, 4 * attempts
    names = ("rhs_calls", "jacobian_evaluations", "factorisations", "linear_solves")
    assert tuple(counts[name] for name in names) == expected


def test_the_calls_that_are_counted_are_the_calls_that_are_allowed(model, monkeypatch):
    monkeypatch.setattr("vehiclemor.simulation.system.MOST_CALLS", 100)
    found = integrate(model, DRIVEN, "dopri5", 1e-9, DRIVEN.times)
    assert found.status == "diverged"
    assert "evaluations of the right-hand side" in found.message
    assert 100 < found.counts["rhs_calls"] <= 106


# Break points


def pulse(start, length):
    """A target rate that is zero but for a smooth pulse of area `length`."""

    def signal(times, frequency, amplitude):
        del frequency, amplitude
        part = np.clip((times - start) / length, 0.0, 1.0)
        return np.column_stack([0 * part, 0 * part, 1.0 - np.cos(2 * np.pi * part)])

    return maneuver(signal, 100.0, (start, start + length))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("start", [0.0, 37.123])
def test_a_short_pulse_after_a_long_rest_is_not_stepped_over(standard, solver, start):
    resting = standard(rate=0.0, angle=0.0, tracked=0.0)
    found = integrate(resting, pulse(start, 0.25), solver, 0.1, np.array([start, 100.0]))
    assert found.status == "ok"
    assert abs(found.states[0, TRACKED]) < 1e-12
    assert found.states[1, TRACKED] == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_jump_between_two_break_points_is_integrated_exactly(standard, solver):
    def signal(times, frequency, amplitude):
        del frequency, amplitude
        rate = np.where(times < 3.0, 1.0, -2.0)
        return np.column_stack([0 * times, 0 * times, rate])

    # A step across the jump would be wrong by a part of the step.
    resting = standard(rate=0.0, angle=0.0, tracked=0.0)
    jump = maneuver(signal, 10.0, (3.0,))
    found = integrate(resting, jump, solver, 0.1, np.array([3.0, 10.0]))
    assert found.states[:, TRACKED] == pytest.approx([3.0, 3.0 - 14.0], abs=1e-12)


# Failure


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solution_that_blows_up_is_recorded_with_the_time(standard, solver):
    exploding = standard(growth=1.0, exploding=1.0, rate=0.0, angle=0.0, tracked=0.0)
    times = np.linspace(0.0, 8.0, 81)
    quiet = maneuver(lambda t, *_: np.zeros((len(t), 3)), 8.0)
    found = integrate(exploding, quiet, solver, 1e-6, times)
    assert found.status == "diverged"
    assert "at t = 1 s" in found.message or "at t = 0.99" in found.message, found.message
    before = times < 0.95
    exact = 1.0 / (1.0 - times[before])
    np.testing.assert_allclose(found.states[before, EXPLODING], exact, rtol=1e-3)
    assert np.isnan(found.states[times > 1.05]).all()


# Order conditions


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


def rosenbrock(tableau: Tableau):
    """alpha, Gamma, b and embedded b of the original form, from the transformed one."""
    gamma = np.linalg.inv(np.eye(len(tableau.m)) / tableau.gamma - tableau.c)
    embedded = tableau.m - tableau.e
    return tableau.a @ gamma, gamma, tableau.m @ gamma, embedded @ gamma


def stage_products(tableau: Tableau, order: int):
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
