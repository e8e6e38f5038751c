"""Films: written whole, with the frames asked for, drawn where the run's outputs say."""

import numpy as np
import pytest
from PIL import Image

import vehiclemor as vm
from vehiclemor.exceptions import InputError
from vehiclemor.report.figures import animation

CAR = "independent_suspension_vehicle"


@pytest.fixture(scope="module")
def runs():
    model = vm.model(CAR)
    return vm.reduce(model, "pod", rank=3).simulate("lane_change"), model.simulate("lane_change")


def middle(lines):
    """Middle (frames, 3) of what is drawn."""
    return 0.5 * (np.nanmin(lines, axis=1) + np.nanmax(lines, axis=1))


def test_film_of_reduced_and_full_order(runs, tmp_path):
    path = vm.animate(*runs, duration=0.5, out=tmp_path / "film.gif")
    with Image.open(path) as film:
        assert film.n_frames == 6
        assert film.size[0] == 560
    assert list(tmp_path.iterdir()) == [path]


def test_a_car_is_drawn_where_its_outputs_say(runs):
    _, run = runs
    histories = animation._quantities(run.dataset(), "outputs")
    lines = animation.car(histories, {}, 1.0)
    places = np.stack([run["longitudinal_position"], run["lateral_position"]], -1)
    assert abs(middle(lines)[:, :2] - places).max() < 0.2
    # The line from the middle of the tail to that of the nose points to where the car heads.
    rear, front = lines[:, 7:13].mean(1), lines[:, 0:6].mean(1)
    heading = np.arctan2(*(front - rear)[:, 1::-1].T)
    assert abs(heading - run["yaw"]).max() < 0.02


def test_wrong_input_is_one_line(runs, tmp_path):
    run, full = runs
    wrong = [
        ((run, full), {"out": tmp_path / "film.mp4"}, "a film ends with .gif"),
        ((run, full), {"labels": ["POD"]}, "2 runs are drawn, not 1"),
        ((run, full), {"duration": 0.0}, "duration: 0 s is below 0.5 s"),
        ((run.chosen(times=full.times[:9]), full), {}, "runs of one input"),
        ((run.chosen("yaw"),), {}, "a car it lacks longitudinal_position, lateral_position, pi"),
        (("film",), {}, "neither a run nor a dataset"),
    ]
    for wrong_runs, options, text in wrong:
        with pytest.raises(InputError, match=text):
            vm.animate(*wrong_runs, **{"out": tmp_path / "film.gif"} | options)
    assert not list(tmp_path.iterdir())
