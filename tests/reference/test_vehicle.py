"""The 14-DOF vehicle against independent mechanics, conservation laws and other integrators."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from tests.oracles import vehicle_lagrange as oracle
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel

NAME = "independent_suspension_vehicle"
LANE_CHANGE = component("maneuver", "lane_change")
# What the published vehicle leaves out: product of inertia and damping of the tires.
EXTENDED = {"product_of_inertia": 35.0, "tire_damping": 400.0, "unsprung_mass": 44.0}
IN_ORACLE = {"product_of_inertia": "Ixz", "tire_damping": "ct", "unsprung_mass": "m_u"}
EXTENDED_ORACLE = {**oracle.PARAMETERS, **{IN_ORACLE[k]: v for k, v in EXTENDED.items()}}


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build(NAME)


@pytest.fixture(scope="module")
def extended() -> DynamicModel:
    return build(NAME, overrides=EXTENDED)


def states(seed: int, number: int) -> list[tuple[np.ndarray, float]]:
    """Random large motions with steering angles; in some of them wheels are off the road."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(number):
        q = np.concatenate(
            [
                rng.uniform(-50.0, 50.0, 2),
                0.6 + rng.uniform(-0.08, 0.06, 1),
                rng.uniform(-3.0, 3.0, 1),
                rng.uniform(-0.25, 0.25, 2),
                rng.uniform(-0.08, 0.08, 4),
                rng.uniform(-20.0, 20.0, 4),
            ]
        )
        nu = np.concatenate(
            [
                [rng.uniform(5.0, 35.0), *rng.uniform(-4.0, 4.0, 2)],
                rng.uniform(-2.0, 2.0, 3),
                rng.uniform(-2.0, 2.0, 4),
                rng.uniform(10.0, 110.0, 4),
            ]
        )
        found.append((np.concatenate([q, nu]), float(rng.uniform(-0.5, 0.5))))
    return found


LARGE = [*states(1, 28), (oracle.dropped(), 0.0), (oracle.dropped(), 0.3)]


def close(found, expected, tolerance=1e-9) -> None:
    found, expected = np.asarray(found), np.asarray(expected)
    error = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
    assert error.max() < tolerance


def outputs(model: DynamicModel, x: np.ndarray, delta: float) -> dict[str, np.ndarray]:
    """Outputs by name, four values where there is one for each wheel."""
    row = dict(zip(model.outputs, model.outputs_at(x[None], np.array([[delta]]))[0], strict=True))
    wheels = ("FL", "FR", "RL", "RR")
    names = ("Fx", "Fy", "Fz", "Mz", "slip_ratio", "slip_angle")
    return {name: np.array([row[f"{name}_{wheel}"] for wheel in wheels]) for name in names}


def second_order(model: DynamicModel, x, delta) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix and forces of the equations in the coordinates."""
    result = np.empty((14, 15))
    model.kernels.call("second_order", x, np.array([delta]), model.constants, result)
    return result[:, :-1], result[:, -1]


def speeds(model: DynamicModel, q, rates) -> np.ndarray:
    return model.speeds_of_rates(np.concatenate([q, rates]))


# Equations of motion


def test_accelerations_are_those_of_dalemberts_principle(vehicle, extended):
    """The published vehicle, and one with every parameter in play."""
    for x, delta in LARGE:
        close(vehicle.rhs(x, delta), oracle.accelerations(x, delta))
    for x, delta in states(2, 12):
        expected = oracle.accelerations(x, delta, EXTENDED_ORACLE)
        close(extended.rhs(x, delta), expected)


def test_tire_forces_and_slips_are_those_of_the_specification(vehicle):
    off = 0
    for x, delta in LARGE:
        found, expected = outputs(vehicle, x, delta), oracle.tire_forces(x, delta)
        pairs = {"slip_ratio": "kappa", "slip_angle": "alpha"}
        for name, values in found.items():
            close(values, expected[pairs.get(name, name)])
        lifted = expected["Fz"] == 0.0
        off += lifted.sum()
        for name in ("Fx", "Fy", "Mz"):
            assert not found[name][lifted].any()
    assert off > 8


def test_second_order_form_holds_with_the_oracles_second_derivatives(vehicle):
    for x, delta in LARGE:
        rates = oracle.accelerations(x, delta)
        # The kinematic equations, differentiated along the motion without rounding.
        q_second = oracle.accelerations(x + 1e-30j * rates, delta)[:14].imag / 1e-30
        mass, force = second_order(vehicle, x, delta)
        np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-12 * np.abs(mass).max())
        assert np.linalg.eigvalsh(mass).min() > 0.1
        close(np.linalg.solve(mass, force), q_second)
        # Speeds invert the kinematic equations; the mass matrix is the kinetic energy's.
        close(speeds(vehicle, x[:14], rates[:14]), x[14:], 1e-12)
        per_rate = np.array([speeds(vehicle, x[:14], e) for e in np.eye(14)]).T
        expected = per_rate.T @ oracle.kinetic_matrix(x, 0.0) @ per_rate
        close(vehicle.mass_matrix(x), expected, 1e-11)


# Equilibrium and symmetries


def test_straight_running_is_an_equilibrium(vehicle):
    x = vehicle.start("equilibrium")
    np.testing.assert_allclose(x, oracle.equilibrium(), rtol=1e-15)
    rates = vehicle.rhs(x, 0.0)
    assert np.abs(rates[14:]).max() < 1e-9
    assert rates[0] == pytest.approx(20.0)
    p = oracle.PARAMETERS
    weight = (p["m_s"] + 4 * p["m_u"]) * p["g"]
    assert outputs(vehicle, x, 0.0)["Fz"].sum() == pytest.approx(weight, rel=1e-12)


def test_any_speed_and_any_load_has_its_equilibrium(extended):
    fast = build(NAME, overrides={"initial_speed": 37.0, "product_of_inertia": -20.0})
    for model in (fast, extended):
        rates = model.rhs(model.start(), 0.0)
        assert np.abs(rates[14:]).max() < 1e-9


def test_the_dropped_start_keeps_its_velocity_in_space(vehicle):
    x = vehicle.start("dropped")
    np.testing.assert_allclose(x, oracle.dropped(), rtol=1e-15)
    np.testing.assert_allclose(vehicle.rhs(x, 0.0)[:3], [20.0, 0.0, 0.0], atol=1e-14)


# Energy


def test_energy_changes_by_the_power_of_tires_and_dampers(vehicle):
    for x, delta in LARGE:
        rates = vehicle.rhs(x, delta)
        rate = oracle.energy(x + 1e-30j * rates, delta=delta).imag / 1e-30
        assert rate == pytest.approx(oracle.power(x, delta), rel=1e-9, abs=1e-5)


# Linear theory


def test_eigenvalues_are_those_of_the_exact_jacobian(vehicle):
    x = vehicle.start()
    active = vehicle.active
    exact = oracle.jacobian(x, 0.0)
    found = np.linalg.eigvals(vehicle.system.jacobian(x, np.zeros(1)))
    expected = np.linalg.eigvals(exact)
    assert np.sum(np.abs(expected) < 1e-5) == 8
    distance = np.abs(found[:, None] - expected)
    pairs = linear_sum_assignment(distance)
    assert distance[pairs].max() < 1e-5
    # Nothing but the path in the plane depends on what is left out.
    left_out = np.delete(np.arange(28), active)
    assert np.abs(exact[2:][:, left_out]).max() < 1e-12
    # The wheels' spins are the stiff part.
    assert np.sum(expected.real < -100.0) == 4


# Trajectories


def test_the_lane_change_ends_where_its_amplitude_was_calibrated(vehicle):
    end = vehicle.simulate(LANE_CHANGE, times=[25.0], solver="dopri5", tolerance=1e-10)
    assert end.outputs[0, 1] == pytest.approx(3.4999973, abs=1e-6)
    assert end.outputs[0, 2] == pytest.approx(6.8e-4, abs=5e-6)
