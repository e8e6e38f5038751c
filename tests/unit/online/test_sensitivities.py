"""Sensitivities as datasets, and what is refused with one clear line."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.oracles.differences import extrapolated
from vehiclemor.errors import InputError
from vehiclemor.registry import component

CAR, WISHBONE = "independent_suspension_vehicle", "double_wishbone"


@pytest.fixture(scope="module")
def step():
    return component("maneuver", "step_steer")


@pytest.fixture(scope="module")
def found(step):
    return vm.sensitivities(CAR, step, parameters=["front_stiffness", "rear_damping"])


def test_the_dataset_has_names_and_units(found):
    assert found["d_output"].dims == ("time", "parameter", "output")
    assert found["parameter"].values.tolist() == ["front_stiffness", "rear_damping"]
    assert found["parameter_unit"].values.tolist() == ["N/m", "N s/m"]
    assert found["d_output"].attrs["units"] == "output_unit / parameter_unit"
    run = vm.model(CAR).simulate(component("maneuver", "step_steer"))
    np.testing.assert_allclose(found["outputs"][:, :9], run.outputs[:, :9], atol=1e-7)
    # A coordinate that is an output moves as that does.
    pair = found["d_output"].sel(output="roll"), found["d_coordinate"].sel(coordinate="phi")
    np.testing.assert_allclose(*pair, atol=1e-12)
    assert found["d_speed"].shape == (run.time.size, 2, 14)


@pytest.mark.parametrize("name", ["peak_roll", "overshoot", "settling_time"])
def test_gradients_are_those_of_other_cars(found, step, name):
    objective, car = vm.objective(name), vm.model(CAR)
    gradient = objective.gradient(found)
    for parameter in found["parameter"].values:
        value = float(car.parameters[parameter])

        def of(part, value=value, parameter=parameter):
            other = vm.model(CAR, parameters={parameter: value * (1.0 + part)})
            run = other.simulate(step, tolerance=1e-12)
            histories = [run.outputs[:, car.outputs.index(h)] for h in objective.histories]
            return objective.measured(run.time, histories).value

        expected = extrapolated(of, 2e-2) / value
        assert float(gradient.sel(parameter=parameter)) == pytest.approx(expected, rel=1e-6)
    assert gradient.attrs["units"] == f"{objective.unit} / parameter_unit"


def test_bump_steer_moves_with_the_hard_points():
    points = ["tie_rod_inner.z", "tie_rod_outer.z", "upper_ball_joint"]
    found = vm.sensitivities(WISHBONE, parameters=points)
    assert "d_speed" not in found
    gradient = vm.objective("bump_steer").gradient(found)
    design = vm.model(WISHBONE).parameters["tie_rod_inner"]

    def of(change):
        moved = vm.model(WISHBONE, parameters={"tie_rod_inner.z": design[2] + change})
        return vm.objective("bump_steer")(vm.simulate(moved, errors=False))

    expected = extrapolated(of, 1e-3)
    assert float(gradient[0]) == pytest.approx(expected, rel=1e-6)
    assert gradient["parameter"].values.tolist()[2:] == [
        f"upper_ball_joint.{axis}" for axis in "xyz"
    ]


def test_the_full_order_is_the_model_itself(step, found):
    full = vm.reduce(CAR, "full_order", tolerance=1e-3)
    same = vm.sensitivities(full, step, parameters=["front_stiffness", "rear_damping"])
    np.testing.assert_array_equal(same["d_output"], found["d_output"])


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"parameters": "mass"}, "'mass' is not a parameter"),
        ({"parameters": []}, "parameters are none"),
        ({"parameters": ["PKY1", "PKY1"]}, "the same name twice"),
        ({"model": 3}, "model is 3"),
        ({"maneuver": "step_stear"}, "did you mean step_steer"),
        ({"start": "droped"}, "unknown start"),
        ({"tolerance": "small"}, "tolerance"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"model": ("modal_truncation", {})}, "its runs have no derivatives by parameters"),
        ({"model": ("pod", {"rank": 3})}, "choose formulation='state'"),
        ({"model": ("pod", {"rank": 3, "formulation": "state"})}, "trained on runs of one model"),
    ],
)
def test_wrong_input_is_one_line(step, changes, line):
    given = {"model": CAR, "maneuver": step, "parameters": ["sprung_mass"]} | changes
    if isinstance(given["model"], tuple):
        method, settings = given["model"]
        given["model"] = vm.reduce(CAR, method, training=[step], **settings)
    with pytest.raises(InputError) as error:
        vm.sensitivities(**given)
    assert line in str(error.value)
    assert "\n" not in str(error.value)
