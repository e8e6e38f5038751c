"""Equations of the high-fidelity vehicle against independent mechanics and linear theory."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from tests.oracles import high_fidelity_pinocchio as pinocchio
from tests.oracles import high_fidelity_vehicle as oracle
from tests.oracles.high_fidelity_data import PARAMETERS, design
from tests.oracles.projected_simulation import projected_state
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel

NAME = "high_fidelity_vehicle"
N, LOOPS = 26, 12
WHEELS = ("FL", "FR", "RL", "RR")
TIRE = ("Fx", "Fy", "Fz", "Mz", "slip_ratio", "slip_angle")
REST = np.zeros(3)
MASS = 1653.686


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build(NAME)


class State(NamedTuple):
    """Coordinates, their rates, and the rack's position, velocity and acceleration."""

    q: np.ndarray
    qd: np.ndarray
    s: float
    sd: float
    sdd: float


def random_state(model: DynamicModel, number: int) -> State:
    """Of even numbers with closed loops, of the others with open ones; the last ones crawl.

    Every third one moves gently, so that tyres slip little.
    """
    rng, vivid = np.random.default_rng(number), 0.02 if number % 3 == 2 else 1.0
    scale, forward = rng.uniform(), rng.uniform(5.0, 30.0) if number < 36 else rng.uniform(-1, 1)
    x, u = model.start(), rng.uniform(-1.0, 1.0, 3) * [0.03, 0.1 * vivid, 1.0]
    x[:2], x[3] = rng.uniform(-50.0, 50.0, 2), rng.uniform(-np.pi, np.pi)
    x[4:6] = scale * rng.uniform(-0.2, 0.2, 2)
    x[[10, 17, 20, 21]] = scale * rng.uniform(-0.3, 0.3, 4)
    x[22:N] = rng.uniform(-np.pi, np.pi, 4)
    x[2] += rng.uniform(-0.04, 0.08)
    x[N:] = vivid * rng.uniform(-2.0, 2.0, N)
    x[N : N + 2] += forward * np.cos(x[3]), forward * np.sin(x[3])
    x[48:] = forward / 0.31 * (1.0 + vivid * rng.uniform(-0.2, 0.2, 4))
    x = projected_state(model, x, u)
    if number % 2:
        x[6:22] += rng.uniform(-1e-3, 1e-3, 16)
        x[32:48] += vivid * rng.uniform(-2.0, 2.0, 16)
    return State(x[:N], x[N:], *u)


@dataclass(frozen=True)
class Case:
    """A state, and what the oracle says of it."""

    state: State
    mass: np.ndarray
    bias: np.ndarray
    applied: np.ndarray
    constraints: tuple[np.ndarray, ...]
    tires: list[dict]
    velocity: np.ndarray  # of the chassis, chassis components
    qdd: np.ndarray

    @property
    def at(self) -> tuple[np.ndarray, np.ndarray]:
        """State and inputs as the model takes them."""
        return np.concatenate([self.state.q, self.state.qd]), np.array(self.state[2:])


@pytest.fixture(scope="module")
def cases(vehicle) -> list[Case]:
    """Large motions with closed and open loops; in the last ones the vehicle crawls."""
    found = []
    for state in (random_state(vehicle, number) for number in range(50)):
        now = oracle.Instant(*state, PARAMETERS)
        loops = oracle.stabilised(now.loops, PARAMETERS)
        mechanics = (*now.mass_and_bias(), now.applied_forces(), loops, now.tyres())
        velocity = now.turns[0].T @ now.v[0]
        found.append(Case(state, *mechanics, velocity, oracle.accelerations(*state)))
    return found


def error(found, expected) -> float:
    """Largest difference relative to the largest entry."""
    return np.abs(np.subtract(found, expected)).max() / max(1.0, np.abs(expected).max())


def outputs(model: DynamicModel, x: np.ndarray, u: np.ndarray) -> dict[str, float]:
    return dict(zip(model.outputs, model.outputs_at(x[None], u[None])[0], strict=True))


# Equations of motion


def test_equations_of_motion_are_the_oracles_and_pinocchios(vehicle, cases):
    for case in cases:
        found = vehicle.rhs(*case.at)
        np.testing.assert_array_equal(found[:N], case.state.qd)
        assert error(found[N:], case.qdd) < 1e-12
        mass, force, _, _ = vehicle.descriptor(*case.at)
        assert error(mass, case.mass) < 1e-14
        assert error(force, case.applied - case.bias) < 1e-12
        np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-14 * mass.max())
        assert np.linalg.eigvalsh(mass).min() > 0.0
        expected, bias = pinocchio.mass_and_bias(*case.state)
        assert error(mass, expected) < 1e-14
        # What is left of the model's forces without the applied ones.
        assert np.abs(case.applied - force - bias).max() < 1e-12 * np.abs(case.applied).max()


def test_the_mass_matrix_is_that_of_the_straight_rack(vehicle, cases):
    """The tie rods' place on the chassis follows the rack."""
    for case in cases[:10]:
        x, _ = case.at
        expected, _ = pinocchio.mass_and_bias(case.state.q, case.state.qd, 0.0, 0.0, 0.0)
        assert error(vehicle.mass_matrix(x), expected) < 1e-14


def test_constraints_and_their_derivatives_are_the_oracles(vehicle, cases):
    opened = 0
    for case in cases:
        phi, rate, jacobian, gamma = case.constraints
        found, found_rate = vehicle.violations(*case.at)
        np.testing.assert_allclose(found, phi, rtol=0, atol=3e-15)
        np.testing.assert_allclose(found_rate, rate, rtol=0, atol=3e-15)
        _, _, by_q, right = vehicle.descriptor(*case.at)
        assert error(by_q, jacobian) < 1e-14
        # Rounding of lengths, times 2500 1/s^2.
        assert error(right, gamma) < 1e-11
        drift = outputs(vehicle, *case.at)
        assert drift["position_drift"] == pytest.approx(np.linalg.norm(phi), abs=1e-14)
        assert drift["velocity_drift"] == pytest.approx(np.linalg.norm(rate), abs=1e-14)
        opened += np.abs(phi).max() > 1e-5
    assert 15 < opened < 35


def test_elimination_solves_the_equations_with_multipliers(vehicle, cases, rng):
    """The dense symmetric way to the same accelerations."""
    x, u = (np.repeat([case.at[k] for case in cases], 10, axis=0) for k in (0, 1))
    x[:, 6:22] += rng.uniform(-1e-3, 1e-3, (len(x), 16))
    x[:, N:] += rng.uniform(-2.0, 2.0, (len(x), N))
    systems, right = np.zeros((len(x), N + LOOPS, N + LOOPS)), np.empty((len(x), N + LOOPS))
    for k, at in enumerate(zip(x, u, strict=True)):
        mass, force, jacobian, gamma = vehicle.descriptor(*at)
        systems[k, :N] = np.column_stack([mass, -jacobian.T])
        systems[k, N:, :N] = jacobian
        right[k] = [*force, *gamma]
    expected = np.linalg.solve(systems, right[..., None])[:, :N, 0]
    found = vehicle.rhs_at(x, u)[:, N:]
    largest = np.abs(expected).max(axis=1)
    assert (np.abs(found - expected).max(axis=1) / largest).max() < 1e-13


# Outputs


def test_tire_forces_and_slips_are_the_oracles(vehicle, cases):
    lifted, slow = 0, 0
    for case in cases:
        found = outputs(vehicle, *case.at)
        for wheel, tire in zip(WHEELS, case.tires, strict=True):
            expected = {**tire, "slip_ratio": tire["kappa"], "slip_angle": np.arctan(tire["t"])}
            for name in TIRE:
                close = pytest.approx(expected[name], rel=1e-11, abs=1e-9)
                assert found[f"{name}_{wheel}"] == close, (name, wheel)
            if tire["Fz"] == 0.0:
                lifted += 1
                assert not any(found[f"{name}_{wheel}"] for name in ("Fx", "Fy", "Fz", "Mz"))
            slow += abs(tire["V_x"]) < PARAMETERS["tyre.v_low"]
    # Both branches of the load and of the slip's denominator.
    assert 40 < lifted < 200
    assert slow > 10


def test_outputs_of_the_chassis_are_the_oracles(vehicle, cases):
    for case in cases:
        found = outputs(vehicle, *case.at)
        q, qd = case.state.q, case.state.qd
        names = ("longitudinal_position", "lateral_position", "yaw", "pitch", "roll")
        assert [found[name] for name in names] == list(q[[0, 1, 3, 4, 5]])
        assert found["longitudinal_speed"] == pytest.approx(case.velocity[0], abs=1e-13)
        assert found["lateral_speed"] == pytest.approx(case.velocity[1], abs=1e-13)
        assert found["vertical_speed"] == qd[2]


# Equilibrium


def test_the_equilibrium_is_the_published_one(vehicle):
    x = vehicle.start()
    assert x[2] == pytest.approx(0.5398585628801991, abs=1e-14)
    assert x[4] == pytest.approx(-1.009393484258528e-4, abs=1e-14)
    np.testing.assert_allclose(np.delete(x[:N] - design(), [2, 4]), 0.0, atol=1e-15)
    np.testing.assert_allclose(x[48:], np.repeat([64.04125940508, 64.09877154573], 2), rtol=1e-12)
    np.testing.assert_array_equal(x[N:48], [20.0, *np.zeros(21)])
    assert np.abs(vehicle.rhs(x, REST)[N:]).max() < 1e-9
    found = outputs(vehicle, x, REST)
    loads = [found[f"Fz_{wheel}"] for wheel in WHEELS]
    np.testing.assert_allclose(loads, np.repeat([4016.3188, 4095.0110], 2), atol=5e-5)
    assert sum(loads) == pytest.approx(MASS * 9.81, rel=1e-12)
    assert max(abs(found[f"{name}_{w}"]) for name in TIRE[4:] for w in WHEELS) < 1e-15


def test_the_dropped_start_is_the_equilibrium_raised_and_pitched(vehicle):
    x, dropped = vehicle.start("equilibrium"), vehicle.start("dropped")
    change = np.zeros(2 * N)
    change[[2, 4]] = 0.03, 0.015
    np.testing.assert_allclose(dropped - x, change, rtol=0, atol=1e-15)
    loads = [outputs(vehicle, dropped, REST)[f"Fz_{wheel}"] for wheel in WHEELS]
    for start in (x, dropped):
        np.testing.assert_allclose(vehicle.violations(start, REST), 0.0, atol=1e-15)
    assert 0.0 < loads[0] == pytest.approx(loads[1], rel=1e-12)
    assert loads[0] < 4000.0
    assert loads[2:] == [0.0, 0.0]


# Linear theory


@pytest.fixture(scope="module")
def straight(vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian of straight running at 20 m/s, and Phi_q."""
    x = vehicle.start()
    return vehicle.system.jacobian(x, REST), vehicle.descriptor(x, REST)[2]


def test_eigenvalues_are_those_of_the_specification(straight):
    """Of motions that hold the constraints, so that those of the stabilisation do not interfere."""
    jacobian, constraints = straight
    free = np.linalg.svd(constraints)[2][LOOPS:].T
    motions = np.kron(np.eye(2), free)
    system = motions.T @ jacobian @ motions
    # No such motion leaves the constraints.
    difference = jacobian @ motions - motions @ system
    assert np.abs(difference).max() < 1e-11 * np.abs(jacobian).max()
    found = np.linalg.eigvals(system)
    # Position in the plane, heading, speed and angles of the wheels.
    resting = np.abs(found) < 1e-3
    assert resting.sum() == 8
    found = found[~resting]
    slip = np.sort(found.real)[:4]
    np.testing.assert_allclose(slip[[0, -1]], [-526.0, -511.7], atol=0.05)
    pairs = np.array([-59.3 + 67.4j, -58.8 + 67.5j, -2.9 + 8.1j, -4.1 + 5.8j, -6.3 + 4.8j])
    single = [-167.8, -164.0, -51.0, -47.5, -36.9, -17.8]
    expected = np.concatenate([pairs, pairs.conj(), single])
    found = found[found.real > -500.0]
    distance = np.abs(found[:, None] - expected)
    match = linear_sum_assignment(distance)
    assert len(found) == len(expected)
    gaps = found[match[0]] - expected[match[1]]
    # Printed with one digit after the point.
    assert max(np.abs(gaps.real).max(), np.abs(gaps.imag).max()) < 0.0501
