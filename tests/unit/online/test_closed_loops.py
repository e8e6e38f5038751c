"""The examples: models in loops with what answers them."""

import runpy
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from tests.texts.markdown import ROOT

CARS = ("independent_suspension_vehicle", "high_fidelity_vehicle")


def example(name: str) -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(ROOT / "examples" / f"{name}.py")))


@pytest.fixture(scope="module", params=CARS)
def cars(request):
    reduced = vm.rom(request.param)
    return reduced, vm.reduce(reduced.model, "full_order")


def test_one_driver_drives_the_full_and_the_reduced_car(cars):
    change, speed = example("double_lane_change"), 80.0 / 3.6
    _, full = cars
    start = vm.model(full.model.name, parameters={"initial_speed": speed}).start()
    (found, known), (expected, _) = (change.drive(car, start, speed) for car in cars)
    x, y, yaw = (full.output_names.index(name) for name in change.SEEN)
    lanes = np.array([change.lane(place) for place in expected[:, x]])
    # The driver follows: in the lanes to half a meter, from one to the other and back.
    assert np.abs(expected[:, y] - lanes)[lanes % change.OFFSET == 0.0].max() < 0.5
    assert expected[:, y].max() > 3.0
    samples = min(len(found), len(expected))
    off = np.abs(found[:samples] - expected[:samples]).max(axis=0)
    assert (off[[x, y]] < 0.02).all()
    assert off[yaw] < 1e-3
    assert known < 1.0


def test_the_other_lane_is_the_mirror_image(cars):
    # Of all that the driver sees and the steering does, whatever the model.
    change, speed = example("double_lane_change"), 20.0
    start = cars[0].model.start()
    left, _ = change.drive(cars[0], start, speed)
    change.drive.__globals__["OFFSET"] *= -1.0
    right, _ = change.drive(cars[0], start, speed)
    _, y, yaw = (cars[0].output_names.index(name) for name in change.SEEN)
    np.testing.assert_allclose(right[:, [y, yaw]], -left[:, [y, yaw]], atol=1e-6)


def test_the_example_prints_what_it_has_found(capsys):
    example("double_lane_change").main()
    assert capsys.readouterr().out.count("apart by") == 10


def test_a_coupling_has_order_two():
    coupled = example("steering_cosimulation")
    reduced = vm.rom(CARS[0])
    full = vm.reduce(reduced.model, "full_order")
    steps, y = (0.04, 0.02, 0.01), full.output_names.index("lateral_position")
    coarse, middle, fine = (coupled.drive(full, step, 2.0) for step in steps)
    first = np.abs(coarse - middle[::2]).max(axis=0)[[y, -1]]
    second = np.abs(middle - fine[::2]).max(axis=0)[[y, -1]]
    assert np.all(first / second > 3.0)
    off = np.abs(coupled.drive(reduced, 0.01, 2.0) - fine).max(axis=0)
    assert off[y] < 5e-3
    assert off[-1] < 5e-4
