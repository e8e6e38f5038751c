"""The high-fidelity vehicle in 14 independent coordinates against its equations in 26."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vehiclemor.multibody.high_fidelity.quantities import PLACES
from vehiclemor.reduction.high_fidelity.frozen_constants import exact_vehicle, frozen_kernels
from vehiclemor.reduction.high_fidelity.independent_kernels import independent_kernels
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.steering_maneuvers import rack_lane_change

INDEPENDENT = np.concatenate([np.array(PLACES), 26 + np.array(PLACES)])
DERIVATIVE, FULL = 28, 52
STRAIGHT = np.zeros(3)


def caller(made, constants) -> Callable[[str, np.ndarray, np.ndarray, int], np.ndarray]:
    def call(function, x, u, size):
        result = np.empty(size)
        made.kernels.call(function, np.array(x), np.array(u), constants, result)
        return result

    return call


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build("high_fidelity_vehicle")


@pytest.fixture(scope="module")
def exact(vehicle):
    return caller(*independent_kernels(vehicle))


@pytest.fixture(scope="module")
def frozen(vehicle):
    return caller(*frozen_kernels(vehicle))


@pytest.fixture(scope="module")
def driven(vehicle) -> list[tuple[np.ndarray, np.ndarray]]:
    """States (28,) in a wide range, wheels near rolling, with inputs."""
    rng = np.random.default_rng(4)

    def within(*half: float) -> np.ndarray:
        return rng.uniform(-1.0, 1.0, len(half)) * half

    found = []
    for _ in range(200):
        height, heading = vehicle.start()[2], rng.uniform(-3.0, 3.0)
        place = [*within(50.0, 50.0), height + rng.uniform(-0.05, 0.05), heading]
        joints = within(0.3, 0.3, 0.3, 0.3, 0.2, 0.2, 3.0, 3.0, 3.0, 3.0)
        speed = rng.uniform(15.0, 25.0)
        moving = [speed * np.cos(heading), speed * np.sin(heading), *within(*[1.0] * 8)]
        spins = speed / 0.31 * (1.0 + within(*[0.02] * 4))
        found.append((np.concatenate([place, joints, moving, spins]), within(0.015, 0.1, 1.0)))
    return found


def test_lifted_states_fulfil_the_constraints(vehicle, exact, driven):
    for x, u in driven:
        gaps, rates = vehicle.violations(exact("full_state", x, u, FULL), u)
        assert np.abs(gaps).max() < 1e-14
        assert np.abs(rates).max() < 1e-13


def test_lifted_states_keep_the_independent_coordinates_and_rates(vehicle, exact, driven):
    for x, u in driven:
        np.testing.assert_array_equal(exact("full_state", x, u, FULL)[INDEPENDENT], x)
    for name in vehicle.starts:
        start = vehicle.start(name)
        lifted = exact("full_state", start[INDEPENDENT], STRAIGHT, FULL)
        np.testing.assert_allclose(lifted, start, rtol=0, atol=1e-14)


def test_accelerations_are_those_of_the_constrained_vehicle(vehicle, exact, driven):
    for x, u in driven:
        expected = vehicle.derivative(exact("full_state", x, u, FULL), u)
        found = exact("derivative", x, u, DERIVATIVE)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected[INDEPENDENT], rtol=0, atol=1e-12 * scale)


def test_lifted_states_move_as_the_constrained_vehicle(vehicle, exact, driven):
    for x, u in driven[::5]:
        expected = vehicle.derivative(exact("full_state", x, u, FULL), u)
        slope = exact("derivative", x, u, DERIVATIVE)
        moved = np.array([u[1], u[2], 0.0])

        def along(h, x=x, u=u, slope=slope, moved=moved):
            return exact("full_state", x + h * slope, u + h * moved, FULL)

        h = 1e-4
        found = (8 * (along(h) - along(-h)) - (along(2 * h) - along(-2 * h))) / (12 * h)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * scale)


def test_outputs_are_those_of_the_constrained_vehicle(vehicle, exact, driven):
    for x, u in driven[::5]:
        lifted = exact("full_state", x, u, FULL)
        expected = vehicle.outputs_at(lifted[None], u[None])[0]
        found = exact("outputs", x, u, len(vehicle.outputs))
        atol = 1e-12 * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=atol)


def test_mass_and_speeds_give_the_energy_of_motion(vehicle, exact, driven):
    """Kinetic energy of the 26 coordinates, rack still, equals that of the 14."""
    for x, u in driven[::20]:
        still = np.array([u[0], 0.0, 0.0])
        lifted = exact("full_state", x, still, FULL)
        expected = lifted[26:] @ vehicle.mass_matrix(lifted, still) @ lifted[26:]
        mass = exact("mass", x, still, (14, 14))
        speeds = np.concatenate([exact("quasi_speeds", x, still, 14)[:10], x[24:]])
        assert speeds @ mass @ speeds == pytest.approx(expected, rel=1e-12)


# The vehicle with frozen inertia


def test_states_with_spins_in_space_go_there_and_back(vehicle, exact, frozen, driven):
    for x, u in driven[::20]:
        lifted = exact("full_state", x, u, FULL)
        there = exact_vehicle(vehicle).encode(lifted, u)
        back = frozen("full_state", there, u, FULL)
        np.testing.assert_allclose(back, lifted, rtol=0, atol=1e-12 * np.abs(lifted).max())


def test_the_equilibrium_is_kept(vehicle, frozen):
    start = exact_vehicle(vehicle).encode(vehicle.start(), STRAIGHT)
    assert np.abs(frozen("derivative", start, STRAIGHT, DERIVATIVE)[14:]).max() < 1e-8


def test_frozen_inertia_is_exact_to_first_order_at_the_design_position(vehicle, exact, frozen):
    """Twice the distance makes four times the error."""
    rng = np.random.default_rng(3)
    # No rates about the straight run: the tires' friction has a kink there.
    start = exact_vehicle(vehicle).encode(vehicle.start(), STRAIGHT)
    for place in (2, 4, 5, 6, 7, 8, 9):
        step = np.zeros(28)
        step[place] = rng.choice([-1.0, 1.0])

        def error(size, step=step):
            x = start + size * step
            lifted = frozen("full_state", x, STRAIGHT, FULL)[INDEPENDENT]
            slope = exact("derivative", lifted, STRAIGHT, DERIVATIVE)
            ahead, behind = (
                exact("quasi_speeds", lifted + h * slope, STRAIGHT, 14) for h in (1e-5, -1e-5)
            )
            found = frozen("derivative", x, STRAIGHT, DERIVATIVE)[14:]
            return np.abs(found - (ahead - behind) / 2e-5).max()

        assert error(1e-3) < 0.3 * error(2e-3) + 1e-7


def test_a_lane_change_is_predicted(vehicle, frozen):
    maneuver = rack_lane_change.perturbed(1.0, 1.5)
    reference = vehicle.simulate(maneuver)

    def slope(t, x):
        return frozen("derivative", x, maneuver.at(np.array([t]))[0], DERIVATIVE)

    start = exact_vehicle(vehicle).encode(vehicle.start(), STRAIGHT)
    run = solve_ivp(
        slope, (0.0, 10.0), start, "LSODA", maneuver.times, rtol=1e-7, atol=1e-7, max_step=0.02
    )
    assert run.success
    states = run.y.T
    expected = {name: reference.outputs[:, k] for k, name in enumerate(vehicle.outputs)}
    vertical = [slope(t, x)[2] for t, x in zip(maneuver.times, states, strict=True)]
    assert np.abs(states[:, 1] - expected["lateral_position"]).max() < 0.02
    assert np.sqrt(np.mean((states[:, 15] - expected["lateral_speed"]) ** 2)) < 5e-4
    assert np.sqrt(np.mean((vertical - expected["vertical_speed"]) ** 2)) < 1e-3
