"""High-fidelity vehicles that can't stand and parameters that are none: one line, exit status 2."""

from functools import partial

import pytest

import vehiclemor as vm
from vehiclemor.errors import VehiclemorError
from vehiclemor.resources import data_folder

NAME = "high_fidelity_vehicle"
SIMULATE = ("simulate", NAME)
TEXT = (data_folder() / "parameters" / f"{NAME}.toml").read_text()


@pytest.fixture
def vehicle_file(parameter_file):
    """Parameter file of the vehicle with some values replaced."""
    return partial(parameter_file, NAME)


WRONG_VEHICLES = [
    ({"chassis_mass": -1515.0}, ["chassis_mass", "-1515 kg", "smallest allowed 0.001 kg"]),
    ({"gravity": 0.0}, ["gravity", "0 m/s^2 is not above 0"]),
    ({"baumgarte_a": -50.0}, ["baumgarte_a", "-50 1/s", "smallest allowed 0 1/s"]),
    ({"baumgarte_b": 2e4}, ["baumgarte_b", "20000 1/s", "largest allowed 10000 1/s"]),
    ({"initial_speed": 0.5}, ["initial_speed", "0.5 m/s", "smallest allowed 3 m/s"]),
    ({"tire_stiffness": "nan"}, ["tire_stiffness", "not finite"]),
    ({"largest_friction": 11.0}, ["largest_friction", "11 is above the largest allowed 10"]),
    ({"drop_height": 5.0}, ["drop_height", "5 m", "largest allowed 1 m"]),
    ({"wheel_centre": 0.3}, ["wheel_centre", "a point has 3 components (x, y, z), not 1"]),
    ({"wheel_centre": [0.0, 0.8]}, ["wheel_centre", "3 components", "not 2"]),
    ({"chassis_mass": [1.0, 2.0, 3.0]}, ["chassis_mass", "a number is needed, not a list of 3"]),
    ({"carrier_inertia": [1.0, 0.0, 1.0]}, ["carrier_inertia", "0 kg m^2 is not above 0"]),
    ({"tie_rod_outer": [-150.0, 770.0, -120.0]}, ["tie_rod_outer", "millimetres"]),
    # The chassis hangs over an axle: the wheels at the other end would have to hold it down.
    ({"chassis_centre": [1.7, 0.0, 0.2]}, ["can't stand", "lifts the rear wheels"]),
    ({"chassis_centre": [-1.7, 0.0, 0.2]}, ["can't stand", "lifts the front wheels"]),
    ({"tire_stiffness": 9000.0}, ["can't stand", "presses the front tires flat"]),
    ({"rear_wheel_centre": [2.0, 0.8, 0.0]}, ["can't stand", "not ahead of the rear"]),
    ({"upper_arm_front_pivot": [-0.25, 0.51, 0.11]}, ["can't be assembled", "upper arm axis"]),
    ({"front_spring_chassis_point": [0.0, 0.62, -0.27]}, ["front spring has length 0"]),
    ({"rear_stiffness": 0.0}, ["rear_stiffness", "0 N/m is not above 0"]),
    ({"chassis_centre": [0.0, 0.3, 0.2]}, ["chassis_centre", "beside the midplane"]),
]


@pytest.mark.parametrize(("values", "words"), WRONG_VEHICLES)
def test_a_vehicle_that_cant_be(fails, vehicle_file, values, words):
    fails([*SIMULATE, "--parameters", vehicle_file(values)], *words)


@pytest.mark.parametrize(("values", "words"), WRONG_VEHICLES)
def test_the_python_interface_refuses_what_the_command_line_refuses(values, words):
    given = {name: float("nan") if value == "nan" else value for name, value in values.items()}
    with pytest.raises(VehiclemorError) as error:
        vm.model(NAME, given)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_a_parameter_of_another_model(fails, tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text(TEXT.replace("[parameters.tire_width]", "[parameters.tyre_width]"))
    fails([*SIMULATE, "--parameters", path], "parameters.tire_width is missing")
    extra = TEXT[TEXT.index("[parameters.tire_width]") :].split("\n\n")[0]
    path.write_text(f"{TEXT}\n{extra.replace('tire_width', 'cup_holders')}\n")
    fails([*SIMULATE, "--parameters", path], "parameters.cup_holders is not a parameter")
    with pytest.raises(VehiclemorError, match="'cup_holders' is not a parameter"):
        vm.model(NAME, {"cup_holders": 4.0})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--start", "droped"], ["unknown start 'droped'", "equilibrium, dropped"]),
        (["--maneuver", "lane_change"], ["lane_change", "inputs delta", "needs s, s_dot, s_ddot"]),
        (["--amplitude", "inf"], ["amplitude factor", "not finite"]),
    ],
)
def test_wrong_arguments(fails, arguments, words):
    fails([*SIMULATE, *arguments], *words)
