"""Films: written whole, with the frames asked for, drawn where the run's outputs say."""

import numpy as np
import pytest
from PIL import Image

import vehiclemor as vm
from vehiclemor.exceptions import InputError
from vehiclemor.report.figures import animation
from vehiclemor.report.labels import declared

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


def test_a_film_shows_what_has_been_driven_and_left_at_the_left(runs):
    car, (_, full) = vm.model(CAR), runs
    histories = animation._quantities(full.dataset(), "outputs")
    frames = {name: values[:2000:100] for name, values in histories.items()}
    looks = animation._styles(["slow_manifold", "full_order"])
    names = "reduced", "full order"
    film = animation._film([frames] * 2, names, looks, car.parameters.values(), 1.0)
    film._draw_was_started = True
    above, behind = film._fig.axes
    for frame in (0, 7):
        film._func(frame)
        for path in above.lines[2:]:
            x, y = path.get_data()
            np.testing.assert_array_equal(x, frames["longitudinal_position"][: frame + 1])
            np.testing.assert_array_equal(y, frames["lateral_position"][: frame + 1])
    assert (above.get_ylabel(), behind.get_xlabel()) == ("Y, left (m)",) * 2
    low, high = above.get_ylim()
    left, right = behind.get_xlim()
    assert low < high
    assert left > right
    assert above.lines[0].get_color() == declared().methods["slow_manifold"].color


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


@pytest.mark.usefixtures("plug_in_package")
def test_a_model_without_the_outputs_is_refused(tmp_path):
    run = vm.model("quarter_car").simulate("quarter_car_road")
    with pytest.raises(InputError, match=r"no film of these runs: to draw a car it lacks "):
        vm.animate(run, out=tmp_path / "film.gif")
