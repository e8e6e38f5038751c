"""Vehicles that drive, brake and meet roads, against independent mechanics and balances."""

import numpy as np
import pytest

from tests.models import CAR, FIDELITY
from tests.oracles import high_fidelity_vehicle as fidelity_oracle
from tests.oracles import vehicle_lagrange as oracle
from tests.oracles.projected_simulation import projected_state
from vehiclemor.multibody.quantities import OPTIONAL_INPUTS
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel

NAMES = [quantity.name for quantity in OPTIONAL_INPUTS]
# Larger torques, rougher roads than a run has: every term shows.
LOW = np.repeat([-3000.0, 0.0, 0.1, -0.05, -3.0], 4)
HIGH = np.repeat([3000.0, 4000.0, 1.4, 0.05, 3.0], 4)


@pytest.fixture(scope="module")
def fidelity() -> DynamicModel:
    return build(FIDELITY, driven=NAMES)


def random_inputs(rng: np.random.Generator) -> np.ndarray:
    """All optional inputs (21,)."""
    return np.array([*rng.uniform(LOW, HIGH), rng.uniform(-5000.0, 5000.0)])


def in_oracle(values: np.ndarray) -> oracle.Driven:
    return oracle.Driven(*values[:20].reshape(5, 4), values[20])


def random_state(rng: np.random.Generator, start: np.ndarray) -> np.ndarray:
    """A large motion of the 14-DOF vehicle; one wheel is locked, one in reverse."""
    x = start.copy()
    x[2:6] += rng.uniform(-0.05, 0.05, 4)
    x[6:10] = rng.uniform(-0.05, 0.05, 4)
    x[14] = rng.uniform(5.0, 35.0)
    x[15:24] = rng.uniform(-1.5, 1.5, 9)
    x[24:] = x[14] / 0.32 * rng.uniform(0.7, 1.2, 4)
    wheels = rng.permutation(4)
    x[24 + wheels[0]], x[24 + wheels[1]] = 0.0, -3.0
    return x


def test_every_input_moves_the_car_as_in_dalemberts_principle(rng):
    """Momenta, spins and travels of all bodies; tires that are damped feel the road's rate."""
    damped = build(CAR, overrides={"tire_damping": 400.0}, driven=NAMES)
    parameters = {**oracle.PARAMETERS, "ct": 400.0}
    for _ in range(40):
        x, delta = random_state(rng, damped.start()), rng.uniform(-0.4, 0.4)
        values = random_inputs(rng)
        found = damped.rhs(x, np.array([delta, *values]))
        expected = oracle.accelerations(x, delta, parameters, in_oracle(values))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)


def test_every_input_moves_the_high_fidelity_vehicle_as_in_dalemberts_principle(fidelity, rng):
    """Half shafts push the chassis back, calipers the carriers; forces are those of the brush."""
    slipped = 0
    for _ in range(20):
        x, rack = fidelity.start(), rng.uniform(-1.0, 1.0, 3) * [0.02, 0.1, 1.0]
        values = random_inputs(rng)
        u = np.array([*rack, *values])
        x[2:6] += rng.uniform(-0.03, 0.03, 4)
        x[[10, 17, 20, 21]] = rng.uniform(-0.1, 0.1, 4)
        x[26:] = rng.uniform(-1.0, 1.0, 26)
        x[26] += rng.uniform(5.0, 30.0)
        x[48:] = x[26] / 0.31 * rng.choice([0.0, 0.9, 1.0, 1.02], 4)
        x = projected_state(fidelity, x, u)
        state = x[:26], x[26:], *rack
        expected = fidelity_oracle.accelerations(*state, driven=in_oracle(values))
        found = fidelity.rhs(x, u)[26:]
        assert np.abs(found - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())
        slipped += np.count_nonzero(x[48:] < 1.0)
    assert slipped > 8
