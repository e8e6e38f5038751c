"""The one time loop: what every declared integrator must do on problems with known solutions.

A further integrator is tested by being declared in the catalogue.
"""

import itertools
import math

import numpy as np
import pytest

from tests.unit.python_system import python_system
from tests.unit.standard_problems import ANGLE, ANGULAR_SPEED, EXPLODING, TRACKED, driven, maneuver
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS, frozen
from vehiclemor.simulation.system import Solver
from vehiclemor.simulation.trajectory import Trajectory

LOOSE = 1e6
FROZEN = [name for name in INTEGRATORS if frozen(name)]
# With a Jacobian, frozen or fresh.
STIFF = [name for name, own in INTEGRATORS.items() if own.tables or own.squares]
DRIVEN = maneuver(driven, 8.0)


@pytest.fixture(scope="module")
def model(standard) -> DynamicModel:
    return standard()


STILL = maneuver(lambda t, *_: np.array([0.0, 1.0, 0.0]) + 0.0 * t[:, None], 8.0)


def integrate(model, man, solver, tolerance, times, longest_step=None) -> Trajectory:
    space = whole_space(2 * len(model.coordinates))
    return model.integrate(
        man, model.start(), space, Solver(solver, tolerance, times, longest_step)
    )


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


@pytest.mark.parametrize("solver", INTEGRATORS)
@pytest.mark.parametrize("times", [[8.0], np.linspace(0.0, 8.0, 999)], ids=["end", "between"])
def test_error_falls_with_the_order_of_the_method(model, solver, times):
    # The pendulum's Jacobian changes between -1 and 1 with its angle, so a frozen one is wrong.
    errors = [driven_error(model, solver, times, LOOSE, 0.16 / 2.0**k) for k in range(4)]
    order = np.median(np.log2(np.divide(errors[:-1], errors[1:])))
    own = INTEGRATORS[solver]
    if len(times) == 1:
        assert order == pytest.approx(own.order, abs=0.35), errors
    else:
        # The cubic between the ends of a step is of order 4 on one step.
        assert order > (min(own.order, 4) if own.cubic else own.order) - 0.35, errors


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_the_sample_times_do_not_change_the_steps(model, solver):
    few = integrate(model, DRIVEN, solver, 1e-6, np.array([0.0, 8.0]))
    many = integrate(model, DRIVEN, solver, 1e-6, np.linspace(0.0, 8.0, 777))
    assert many.counts == few.counts
    np.testing.assert_array_equal(many.states[-1], few.states[-1])
    np.testing.assert_array_equal(many.states[0], model.start())


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_tighter_tolerance_gives_a_smaller_error(model, solver):
    errors = [driven_error(model, solver, [8.0], tol) for tol in (1e-3, 1e-5, 1e-7, 1e-9)]
    assert all(later < 0.1 * earlier for earlier, later in itertools.pairwise(errors))
    # The local errors add up, amplified a little; each is at most the tolerance.
    assert errors[-1] < 1e-7


@pytest.mark.parametrize("solver", STIFF)
def test_a_stiff_transient_is_damped_at_once(standard, solver):
    # Decay by exp(-1e8): a method that is stable but not L-stable would carry the distance on.
    far = standard(rate=1e9, tracked=2.0, angle=0.0)
    found = integrate(far, STILL, solver, 1e-3, np.array([8.0]))
    assert found.status == "ok", found.message
    np.testing.assert_allclose(found.states[:, TRACKED], 1.0, atol=1e-6)
    assert found.counts["steps"] < 300


@pytest.mark.parametrize("solver", FROZEN)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_fast_linear_motion_is_right_between_the_steps_too(standard, solver, tolerance):
    # Towards 1 at 45 1/s, which the exponential method could do in one step.
    model = standard(rate=45.0, angle=0.0, tracked=0.0)
    times = np.linspace(0.0, 1.0, 101)
    found = integrate(model, STILL, solver, tolerance, times)
    exact = 1.0 - np.exp(-45.0 * times)
    assert np.abs(found.states[:, TRACKED] - exact).max() < 4.0 * tolerance


# Counts


# Solver -> calls, Jacobians, factorisations and solves of a span, an attempt and a step of a system
# of four states.  Rosenbrock's takes one Jacobian by differences, and one more call for the time
# derivative, in each place; the exponential ones evaluate the end of a step for its error.
COUNTS = {
    "dopri5": [(1, 6, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)],
    "rodas4": [(1, 5, 6), (0, 0, 1), (0, 1, 0), (0, 6, 0)],
    "etdrk4": [(1, 4, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)],
}


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
@pytest.mark.parametrize("solver", COUNTS)
def test_counts_follow_from_the_steps(model, solver, tolerance):
    corners = maneuver(driven, 8.0, (2.0, 5.0))
    counts = integrate(model, corners, solver, tolerance, corners.times).counts
    attempts = counts["steps"] + counts["rejected_steps"]
    names = ("rhs_calls", "jacobian_evaluations", "factorisations", "linear_solves")
    expected = np.dot(COUNTS[solver], [3, attempts, counts["steps"]])
    assert [counts[name] for name in names] == expected.tolist()


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_the_calls_that_are_counted_are_those_that_are_made(solver):
    made = []

    def pendulum(x, u):
        made.append(1)
        return [x[1], u[0] - math.sin(x[0])]

    system = python_system(pendulum, [0.0, 0.0], 3)
    corners = maneuver(driven, 8.0, (2.0, 5.0))
    how = whole_space(2), Solver(solver, 1e-4)
    system.workspace(corners, *how)
    made.clear()
    run = system.run(corners, np.array([1.0, 0.0]), *how)
    np.testing.assert_allclose(run.path[:, 0], np.cos(run.output.samples), atol=5e-3)
    assert len(made) == run.output.counts[0] > 50


def test_calls_are_limited_in_each_second_however_long_the_run(monkeypatch):
    monkeypatch.setattr(catalogue, "MOST_CALLS", 500)
    catalogue.control_of.cache_clear()
    calls_until_stiff = []

    def pendulum(x, u):
        if not u[1]:
            calls_until_stiff.append(1)
        return [x[1], u[0] - math.sin(x[0]) - 1e9 * u[1] * x[1]]

    def stiff_at_the_end(times, *_):
        return np.column_stack([1.0 - np.cos(times), times >= 60.0])

    late = Maneuver("late", "", stiff_at_the_end, ("a", "b"), 61.0, 62, lambda _: (60.0,))
    system = python_system(pendulum, [0.0, 0.0], 2)
    how = whole_space(2), Solver("dopri5", 1e-7)
    run = system.run(late, np.array([1.0, 0.0]), *how)
    catalogue.control_of.cache_clear()
    assert run.failure.endswith("at t = 60 s")
    assert len(calls_until_stiff) > 2000 > 3 * (run.output.counts[0] - len(calls_until_stiff))


# Windows


def windows(edges, mean, rows) -> ControlPeriods:
    """A subspace (mean, basis by rows) for each window, projected at right angles."""
    bases = np.zeros((len(rows), 4, 4))
    for k, basis in enumerate(rows):
        bases[k, : len(basis)] = basis
    ranks = np.array([len(basis) for basis in rows])
    return ControlPeriods("state", np.array(edges), np.array(mean), bases, bases, ranks)


REDUCED = [name for name in INTEGRATORS if not frozen(name)]


@pytest.mark.parametrize("solver", REDUCED)
def test_a_window_projects_the_state_that_enters_it(model, solver):
    # In the second window the tracked value is held at 0.3; in the third it is free again.
    everything = np.eye(4)
    held = np.delete(everything, TRACKED, axis=0)
    mean = np.zeros((3, 4))
    mean[1, TRACKED] = 0.3
    space = windows([0.0, 2.0, 4.0, 8.0], mean, [everything, held, everything])
    times = np.array([1.9, 2.5, 3.9, 4.5, 8.0])
    states = model.integrate(DRIVEN, model.start(), space, Solver(solver, 1e-9, times)).states
    # From 4 on the distance to cos t decays by exp(-(t - 4)).
    left = (0.3 - math.cos(4.0)) * np.exp(-(times[3:] - 4.0)) + np.cos(times[3:])
    expected = [math.cos(1.9), 0.3, 0.3, *left]
    np.testing.assert_allclose(states[:, TRACKED], expected, atol=1e-7)
    np.testing.assert_allclose(states[:, ANGLE], np.cos(times), atol=1e-7)


@pytest.mark.parametrize("solver", FROZEN)
def test_a_frozen_jacobian_is_refused_in_a_reduced_system(model, solver):
    space = windows([0.0, 8.0], np.zeros((1, 4)), [np.eye(4)])
    with pytest.raises(InputError, match="not for a reduced model"):
        model.integrate(DRIVEN, model.start(), space, Solver(solver, 1e-4))


# Break points


def rate_alone(signal, *corners) -> Maneuver:
    """A target rate, of nothing else."""
    return maneuver(lambda t, *_: np.column_stack([0 * t, 0 * t, signal(t)]), 100.0, tuple(corners))


@pytest.mark.parametrize("solver", INTEGRATORS)
@pytest.mark.parametrize("start", [0.0, 37.123])
def test_a_short_pulse_after_a_long_rest_is_not_stepped_over(standard, solver, start):
    def pulse(times):
        return 1.0 - np.cos(2 * np.pi * np.clip((times - start) / 0.25, 0.0, 1.0))

    resting = standard(rate=0.0, angle=0.0, tracked=0.0)
    times = np.array([start, 100.0])
    found = integrate(resting, rate_alone(pulse, start, start + 0.25), solver, 0.1, times)
    assert found.status == "ok"
    assert abs(found.states[0, TRACKED]) < 1e-12
    assert found.states[1, TRACKED] == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_jump_between_two_break_points_is_integrated_exactly(standard, solver):
    # A step across the jump would be wrong by a part of the step.
    resting = standard(rate=0.0, angle=0.0, tracked=0.0)
    jump = rate_alone(lambda t: np.where(t < 3.0, 1.0, -2.0), 3.0)
    found = integrate(resting, jump, solver, 0.1, np.array([3.0, 10.0]))
    assert found.states[:, TRACKED] == pytest.approx([3.0, 3.0 - 14.0], abs=1e-12)


# Failure


@pytest.mark.parametrize("solver", INTEGRATORS)
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
