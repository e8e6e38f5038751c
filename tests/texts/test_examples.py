"""The examples: models in loops with what answers them."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import VEHICLES

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    return SimpleNamespace(**runpy.run_path(str(EXAMPLES / f"{name}.py")))


@pytest.fixture(scope="module", params=VEHICLES)
def cars(request):
    reduced = vm.rom(request.param)
    return reduced, vm.reduce(reduced.model, "full_order")


def test_one_driver_drives_the_full_and_the_reduced_car(cars):
    change = example("double_lane_change")
    _, full = cars
    start = vm.model(full.model.name, parameters={"initial_speed": change.SPEED}).start()
    (found, known), (expected, _) = (change.drive(car, start) for car in cars)
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


def test_a_driver_keeps_to_the_course_with_steering_throttle_and_brake():
    course = example("around_a_course")
    middle, _, car, record, _ = course.lap()
    x, y, speed, steering, drive, _, brake = record.T[:7]
    off = np.abs((x + 1j * y)[:, None] - middle).min(axis=1)
    assert off.max() < 1.5
    # Once round: the heading turns by 360 degrees, to the left.
    assert len(record) * course.PERIOD > np.abs(np.diff(middle)).sum() / course.FASTEST
    assert min(drive.max(), brake.max()) > 100.0
    assert np.ptp(speed) > 10.0
    assert steering.mean() > 0.0
    times = course.PERIOD * np.arange(len(record))
    again = vm.Signal.from_samples(times, record[:, 3:], "zero", inputs=["delta", *course.INPUTS])
    run = car.simulate(again)
    assert (
        np.hypot(run["longitudinal_position"][-1] - x[-1], run["lateral_position"][-1] - y[-1])
        < 0.1
    )


def test_hard_points_are_an_optimum_within_bounds_that_the_path_map_finds():
    design = example("hard_points")
    place, found = (design.hard_points(method) for method in ("full_order", "path_map"))
    np.testing.assert_allclose(found, place, atol=1e-7)
    slope = design.off(place, "full_order") @ design.slopes(place, "full_order")
    at = np.sign(place) * (np.abs(place) > design.LARGEST * (1.0 - 1e-4))
    assert 0 < np.count_nonzero(at) < len(at)
    assert np.abs(slope[at == 0]).max() < 1e-4 * np.abs(slope).max()
    assert (slope[at != 0] * at[at != 0] < 0.0).all()


@pytest.fixture(scope="module")
def control():
    return example("predictive_control")


@pytest.fixture(scope="module")
def reduced(control):
    return vm.rom(control.MODEL)


def test_the_car_goes_around_the_obstacle_and_comes_back(control, reduced):
    full = vm.reduce(reduced.model, "full_order")
    runs = [control.drive(control.Controller(reduced), car, 3.6) for car in (full, reduced)]
    for run in runs:
        assert control.clearance(run["path"]) > 0.98
        assert np.abs(run["steering"]).max() < control.LIMIT
        # Begun with the plan before, a few predictions do.
        assert run["evaluations"].mean() < 6.0
        x, y, yaw = run["path"].T
        assert x[-1] > control.OBSTACLE[0] + 2.0 * control.CLEARANCE[0]
        assert abs(y[-1]) < 1.0
        assert abs(yaw[-1]) < 0.1
    # Straight on, the car would hit it.
    assert control.clearance(runs[0]["path"] * [1.0, 0.0, 0.0]) < 0.2
    # The loop is closed over the full car, whose state the reduced one begins with.
    apart = np.abs(runs[0]["path"] - runs[1]["path"]).max(axis=0)
    assert (apart < [0.02, 0.02, 2e-3]).all()


def test_full_and_reduced_car_have_one_optimal_lane_change(reduced):
    planning = example("optimal_control")
    full, track = (vm.reduce(reduced.model, m) for m in ("full_order", "linear_single_track"))
    cars = ((reduced, 1), (full, 0), (track, 1))
    planners = [planning.Planner(car, 20, steps) for car, steps in cars]
    plan, expected, linear = (p.plan(p.start())[0] for p in planners)
    # A model without roll and saturating tires plans another one.
    assert np.abs(plan - expected).max() < 0.1 * np.abs(linear - expected).max()


def test_a_mean_of_sampled_plans_leads_around_the_obstacle(control, reduced):
    sampling = example("sampled_plans")
    full = vm.reduce(reduced.model, "full_order")
    places, _ = sampling.drive(sampling.Sampler(reduced), full, 3.2)
    assert places[-1, 0] > sampling.OBSTACLE[0] + sampling.CLEARANCE[0]
    assert control.clearance(places) > 0.98
