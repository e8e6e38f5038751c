"""Vehicles that can't drive and inputs that are none: one clear line, exit status 2."""

from functools import partial

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import VehiclemorError
from vehiclemor.maneuver import Maneuver

NAME = "independent_suspension_vehicle"
SIMULATE = ("simulate", NAME)


@pytest.fixture
def vehicle_file(parameter_file):
    """Parameter file of the vehicle with some values replaced."""
    return partial(parameter_file, NAME)


WRONG_VEHICLES = [
    ({"sprung_mass": -900.0}, ["sprung_mass", "-900 kg is below the smallest allowed"]),
    ({"unsprung_mass": 0.0}, ["unsprung_mass", "0 kg is not above 0"]),
    ({"initial_speed": 0.0}, ["initial_speed", "0 m/s", "smallest allowed 1 m/s"]),
    ({"initial_speed": -20.0}, ["initial_speed", "-20 m/s"]),
    ({"tire_stiffness": "nan"}, ["tire_stiffness", "not finite"]),
    ({"front_damping": -1.0}, ["front_damping", "-1 N s/m"]),
    ({"front_track": 1386.84}, ["front_track", "largest allowed 20 m"]),
    # The sprung mass hangs over an axle: the wheels at the other end would have to hold it down.
    ({"front_axle_distance": 0.05}, ["can't stand", "front axle", "rear wheels leave the ground"]),
    ({"rear_axle_distance": 0.05}, ["can't stand", "rear axle", "front wheels leave the ground"]),
    ({"tire_stiffness": 5000.0}, ["can't stand", "flat"]),
    ({"whole_car_yaw_inertia": 100.0}, ["yaw inertia", "unsprung masses alone"]),
]


@pytest.mark.parametrize(("values", "words"), WRONG_VEHICLES)
def test_a_vehicle_that_cant_be(fails, vehicle_file, values, words):
    fails([*SIMULATE, "--parameters", vehicle_file(values)], *words)


@pytest.mark.parametrize(("values", "words"), WRONG_VEHICLES)
def test_the_python_interface_refuses_what_the_command_line_refuses(values, words):
    numbers = {name: float(value) for name, value in values.items()}
    with pytest.raises(VehiclemorError) as error:
        vm.model(NAME, numbers)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--start", "droped"], ["unknown start 'droped'", "equilibrium, dropped"]),
        (["--maneuver", "sine_travel"], ["sine_travel", "inputs z, s0", "needs delta"]),
        (["--maneuver", "lane_chang"], ["unknown maneuver", "lane_change"]),
        (["--amplitude", "nan"], ["amplitude factor", "not finite"]),
        (["--frequency", "0"], ["frequency factor", "not positive"]),
    ],
)
def test_wrong_arguments(fails, arguments, words):
    fails([*SIMULATE, *arguments], *words)


def steering(signal, inputs=("delta",)) -> Maneuver:
    return Maneuver("mine", "", lambda t, *_: signal(t)[:, None], inputs, 5.0, 51, lambda _: ())


@pytest.mark.parametrize(
    ("maneuver", "message"),
    [
        (
            steering(lambda t: np.where(t >= 2.0, np.nan, 0.0)),
            "input delta is not finite at t = 2 s",
        ),
        (steering(lambda t: np.where(t >= 2.0, np.inf, 0.0)), "input delta is not finite"),
        (steering(lambda t: np.where(t < 2.0, 0.0, 0.1)), "name the times of its corners"),
        (steering(np.sin, inputs=("rudder",)), "gives inputs rudder"),
    ],
)
def test_steering_that_is_none(maneuver, message):
    with pytest.raises(VehiclemorError) as error:
        vm.simulate(NAME, maneuver=maneuver)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("x", "u", "message"),
    [
        (np.zeros(27), 0.0, r"x has shape \(27,\)"),
        (np.zeros(28), [0.0, 0.0], r"u has shape \(2,\)"),
        (np.full(28, np.nan), 0.0, r"x\[0\] is not finite"),
        (np.zeros(28), np.inf, r"u\[0\] is not finite"),
    ],
)
def test_a_state_that_is_none(x, u, message):
    with pytest.raises(VehiclemorError, match=message):
        vm.model(NAME).derivative(x, u)
