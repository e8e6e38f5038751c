"""Runs with other parameters: each is what a model with these gives alone."""

from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import InputError
from vehiclemor.maneuver import sine_travel
from vehiclemor.registry import component
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.scenario import Scenario, start_of, training_run

HEAVY = (("sprung_mass", 1500.0), ("initial_speed", 25.0))
MOVED = (("tie_rod_inner.z", -0.09),)


@pytest.fixture(scope="module")
def vehicle():
    return vm.model("independent_suspension_vehicle")


@pytest.fixture(scope="module")
def suspension():
    return vm.model("double_wishbone")


def lane_change(parameters=(), **further):
    return Scenario(component("maneuver", "lane_change"), "dropped", None, parameters, **further)


def experiment(model, method, training, tests, **settings):
    complete = complete_settings(model, method, settings)
    return make_experiment(model, method, complete, training, tests, "errors")


def test_a_run_of_another_car_is_that_of_a_model_made_with_its_parameters(vehicle):
    alone = vm.model(vehicle.name, dict(HEAVY))
    run = training_run(vehicle, lane_change(HEAVY)).recorded()
    expected = alone.simulate(component("maneuver", "lane_change"), "dropped")
    np.testing.assert_array_equal(run.states, expected.states)
    # It stands lower on its springs, and starts faster.
    assert not np.array_equal(alone.start("dropped"), vehicle.start("dropped"))
    faster = replace(lane_change(HEAVY), speed=31.0)
    own = vm.model(vehicle.name, dict(HEAVY) | {"initial_speed": 31.0})
    np.testing.assert_array_equal(start_of(vehicle, faster), own.start("dropped"))


def test_a_component_of_a_point_is_a_parameter(suspension):
    x, y, _ = suspension.parameters["tie_rod_inner"]
    whole = vm.model(suspension.name, {"tie_rod_inner": [x, y, -0.09]})
    moved = vm.model(suspension.name, dict(MOVED))
    np.testing.assert_array_equal(moved.constants, whole.constants)
    for wrong in ({"tie_rod_inner.w": 0.0}, {"tie_rod_inner.z": [0.0, 0.0]}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            vm.model(suspension.name, wrong)


def test_a_method_is_not_used_on_a_model_that_it_was_not_trained_on(suspension):
    runs = Scenario(sine_travel, "equilibrium"), Scenario(sine_travel, "equilibrium", None, MOVED)
    found = evaluate(experiment(suspension, "pod", runs[:1], runs[1:], rank=3))
    assert found["status"].item() == "rejected"
    assert "another" in found["message"].item()
    with pytest.raises(ValueError, match="of one model"):
        experiment(suspension, "pod", runs[:1], runs, rank=3)


def test_a_car_is_part_of_the_key_and_no_car_leaves_it_as_it_was(vehicle):
    nominal, heavy = lane_change(), lane_change(HEAVY)
    assert "parameters" not in nominal.content
    assert nominal.run_key != heavy.run_key
    keys = {experiment(vehicle, "pod", (t,), (nominal,)).key for t in (nominal, heavy)}
    assert len(keys) == 2
