"""The 14-DOF vehicle whose tires relax: it stops, stands and starts."""

from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from vehiclemor.exceptions import InputError
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.registry import component
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS

NAME = "relaxation_vehicle"
INPUTS = (*(f"brake_torque_{wheel}" for wheel in WHEELS), "drive_torque_RL", "drive_torque_RR")
SHARES = np.array([1.0, 1.0, 0.5, 0.5])


def torques(times, brake, drive):
    """Brakes on four wheels, drive on the rear axle: a torque in N m at each time in s."""
    values = np.column_stack([np.outer(brake, SHARES), drive, drive])
    return vm.Signal.from_samples(np.array(times), values, inputs=INPUTS)


@pytest.mark.parametrize("speed", [0.0, 1.0, 2.0, 5.0, 20.0, 30.0, 60.0])
def test_it_is_no_stiffer_at_low_speed(speed):
    """Contact and spin of a wheel oscillate at 96 1/s; above 35 m/s the contact alone is faster."""
    model = vm.model(NAME, {"initial_speed": max(speed, 1.0)}).driving(INPUTS)
    state = model.start(None if speed else "standing")
    eigenvalues = np.linalg.eigvals(model.jacobian(state, model.inputs_at_rest))
    assert abs(eigenvalues).max() < 164.0
    # The classical Runge-Kutta method is stable in steps of 16 ms.
    z = 0.016 * eigenvalues
    assert abs(1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))).max() < 1.0 + 1e-6


@pytest.fixture(scope="module")
def stop_and_go():
    brake, drive = [0, 0, 900, 900, 0, 0, 0], [0, 0, 0, 0, 0, 400, 400]
    return torques([0.0, 0.5, 0.7, 7.0, 7.2, 7.4, 10.0], brake, drive)


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_it_stops_stands_and_drives_off(stop_and_go, solver):
    run = vm.model(NAME).simulate(stop_and_go, solver=solver, tolerance=1e-5)
    assert run.status == "ok"
    standing = (run.times > 5.0) & (run.times < 7.0)
    assert abs(run["longitudinal_speed"][standing]).max() < 0.01
    # From 1.5 s after the stop on it creeps, since the tires unload.
    assert np.ptp(run["longitudinal_position"][standing]) < 0.001
    assert run["longitudinal_speed"][-1] > 5.0


def test_a_lane_change_lags_by_the_relaxation():
    maneuver = vm.maneuver("lane_change")
    early = maneuver.times < 5.0
    path = vm.model(CAR).simulate(maneuver)["lateral_position"][early]
    delays = []
    for length in (0.4, 0.1):
        relaxed = vm.model(NAME, {"lateral_relaxation": length}).simulate(maneuver)
        delays.append(abs(relaxed["lateral_position"][early] - path).max())
    assert 0.01 < delays[0] < 0.05
    assert delays[1] < 0.4 * delays[0]


def test_a_wheel_that_spins_at_standstill_winds_up_by_the_relaxation_length_at_most():
    brake = np.full(6, 1000.0)
    signal = torques([0.0, 0.2, 0.4, 2.0, 2.2, 3.0], brake, [0, 0, 3000, 3000, 0, 0])
    model = vm.model(NAME, inputs={f"friction_{wheel}": 0.3 for wheel in WHEELS})
    run = model.simulate(signal, start="standing")
    assert run["omega_RL"].max() > 100.0
    assert run["longitudinal_speed"].max() < 1.0
    assert 0.9 < run["e_x_RL"].max() / model.parameters["longitudinal_relaxation"] < 1.01


def test_further_states_stand_behind_the_speeds():
    definition = component("model", NAME)
    run = vm.model(NAME).simulate(vm.maneuver("lane_change"))
    assert run.further_states.shape == (len(run.times), 8)
    np.testing.assert_array_equal(run.states[:, 28:], run.further_states)
    np.testing.assert_array_equal(run["e_y_FL"], run.dataset().further_states[:, 4])
    with pytest.raises(InputError, match="further states; only coordinates and speeds"):
        vm.reduce(NAME, "pod")
    with pytest.raises(InputError, match="only kind ode has any"):
        replace(definition, kind="dae")
