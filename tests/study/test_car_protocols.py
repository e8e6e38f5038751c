"""Protocols over cars: what is trained on, drawn, and remade for each tested car."""

from dataclasses import replace

import pytest

from vehiclemor.errors import FileError
from vehiclemor.reduction.validation import fitted
from vehiclemor.registry import component
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study import evaluate as evaluation
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.plans.protocol import OF_CARS, load_protocol
from vehiclemor.study.plans.seal import sealed_sets
from vehiclemor.study.training_cars import RUNS

NAME = "cars-independent_suspension_vehicle"


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(NAME)


def contestant(protocol, label):
    (found,) = (c for c in protocol.contestants if c.label == label)
    return found


def test_a_draw_is_of_cars_in_the_box_and_beyond_it_in_one_parameter(protocol):
    box = protocol.definition.cars
    sets = sealed_sets(protocol, "some seal")
    for scenario in sets["drawn"]:
        car = dict(scenario.parameters)
        assert car.keys() == box.keys()
        assert all(box[name][0] <= value <= box[name][1] for name, value in car.items())
    assert len({scenario.parameters for scenario in sets["drawn"]}) == len(sets["drawn"])
    for scenario in sets["drawn_outside"]:
        ((name, value),) = scenario.parameters
        assert not box[name][0] <= value <= box[name][1]
    assert sealed_sets(protocol, "some seal") == sets


def test_contestants_learn_from_the_cars_that_they_name(protocol):
    cars = {
        label: {run.parameters for run in contestant(protocol, label).training}
        for label in ("slow manifold", "POD, nominal basis", "POD, refitted", "ros34pw2")
    }
    assert cars["POD, nominal basis"] == cars["ros34pw2"] == {()}
    assert cars["POD, refitted"] == {None}
    assert () in cars["slow manifold"]
    assert len(cars["slow manifold"]) > 50
    training = contestant(protocol, "slow manifold").training
    of_one = [run for run in training if run.parameters == training[-1].parameters]
    assert len(of_one) <= RUNS + 1
    # All of the box is trained on, so that no car in it is unknown.
    for name, ends in protocol.definition.cars.items():
        found = [dict(car)[name] for car in cars["slow manifold"] if car]
        assert (min(found), max(found)) == pytest.approx(ends)


@pytest.mark.parametrize("name", data_names(OF_CARS))
def test_validation_is_of_other_cars_than_the_training(name):
    protocol = load_protocol(name)
    trained = {run.parameters for c in protocol.contestants for run in c.training}
    for run in protocol.sets["validation"]:
        assert run.parameters
        assert run.parameters not in trained


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ("sprung_mas = [772.6, 1158.8]", "'sprung_mas' is not a parameter"),
        (
            "sprung_mass = [-5.0, 1158.8]",
            "sprung_mass: -5 kg is below the smallest",
        ),
        ("whole_car_yaw_inertia = [300.0, 2000.0]", "no body has"),
    ],
)
def test_wrong_boxes_are_refused_in_one_line(tmp_path, wrong, why):
    text = (data_folder() / OF_CARS / f"{NAME}.toml").read_text()
    name = "sprung_mass" if wrong.startswith("sprung") else "whole_car_yaw_inertia"
    (line,) = (line for line in text.splitlines() if line.startswith(f"{name} ="))
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(line, wrong))
    with pytest.raises(FileError, match=why) as caught:
        load_protocol(str(path))
    assert "\n" not in str(caught.value)


def test_a_box_is_fitted_once_and_remade_for_every_car(protocol, monkeypatch):
    fits = []

    def counted(method, model, *given):
        fits.append(model)
        return fitted(method, model, *given)

    monkeypatch.setattr(evaluation, "fitted", counted)
    row = contestant(protocol, "POD, concatenated basis")
    trained = row.training
    ends = {trained[0].parameters, trained[-1].parameters, trained[-9].parameters}
    few = [next(run for run in trained if run.parameters == car) for car in ends]
    few.sort(key=lambda run: run.parameters)
    row = replace(row, training=tuple(few))
    tests = sealed_sets(protocol, "another seal")["drawn"][:3]
    found = evaluate(row.experiment(protocol.model, 0, tests))
    assert fits == [evaluation.model_of(row.experiment(protocol.model, 0, tests))]
    # The cars of three runs don't fill the box.
    assert set(found["status"].values.tolist()) <= {"untrusted", "diverged"}
    assert component("method", "pod").learns_from == "any"
