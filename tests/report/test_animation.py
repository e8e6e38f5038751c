"""Films: written whole, with the frames asked for, drawn where the run's outputs say."""

import numpy as np
import pytest
from PIL import Image

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.exceptions import InputError
from vehiclemor.report.figures import animation


@pytest.fixture(scope="module")
def suspension():
    model = vm.model("double_wishbone")
    return vm.reduce(model, "pod", rank=3).simulate("sine_travel"), model.simulate("sine_travel")


def middle(lines):
    """Middle (frames, 3) of what is drawn."""
    return 0.5 * (np.nanmin(lines, axis=1) + np.nanmax(lines, axis=1))


@pytest.mark.parametrize(
    ("model", "method"),
    [("independent_suspension_vehicle", "pod"), ("flexible_truck", "craig_bampton")],
)
def test_film_of_reduced_and_full_order(tmp_path, model, method):
    input_ = vm.model(model).definition.maneuver
    run, full = vm.reduce(model, method).simulate(input_), vm.model(model).simulate(input_)
    path = vm.animate(run, full, duration=0.5, out=tmp_path / "film.gif")
    with Image.open(path) as film:
        assert film.n_frames == 6
        assert film.size[0] == 560
    assert list(tmp_path.iterdir()) == [path]


def test_a_car_is_drawn_where_its_outputs_say():
    run = vm.model("independent_suspension_vehicle").simulate("lane_change")
    histories = animation._quantities(run.dataset(), "outputs")
    lines = animation.car(histories, {}, 1.0)
    places = np.stack([run["longitudinal_position"], run["lateral_position"]], -1)
    assert abs(middle(lines)[:, :2] - places).max() < 0.2
    # The line from the middle of the tail to that of the nose points to where the car heads.
    rear, front = lines[:, 7:13].mean(1), lines[:, 0:6].mean(1)
    heading = np.arctan2(*(front - rear)[:, 1::-1].T)
    assert abs(heading - run["yaw"]).max() < 0.02


def test_the_linkage_closes(suspension):
    """Joints of the drawing, placed by the outputs, are those of the model."""
    model, full = vm.model("double_wishbone"), suspension[1]
    histories = animation._quantities(full.dataset(), "outputs")
    lines = animation.suspension(histories, model.parameters.values(), 1.0)
    for k in (0, 300, 900):
        joints = model.joints_at(full.coordinates[k])
        for joint in list(joints.values())[:5]:
            assert np.nanmin(np.linalg.norm(lines[k] - joint, axis=1)) < 1e-9


def test_wrong_input_is_one_line(suspension, tmp_path):
    run, full = suspension
    wrong = [
        ((run, full), {"out": tmp_path / "film.mp4"}, "a film ends with .gif"),
        ((run, full), {"labels": ["POD"]}, "2 runs are drawn, not 1"),
        ((run, full), {"duration": 0.0}, "duration: 0 s is below 0.5 s"),
        ((run.chosen(times=full.times[:9]), full), {}, "runs of one input"),
        ((run.chosen("toe"),), {}, "a suspension it lacks spindle_x, spindle_y, second"),
        (("film",), {}, "neither a run nor a dataset"),
    ]
    for runs, options, text in wrong:
        with pytest.raises(InputError, match=text):
            vm.animate(*runs, **{"out": tmp_path / "film.gif"} | options)
    assert not list(tmp_path.iterdir())


def test_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 1)
    kept, film = tmp_path / "run.nc", tmp_path / "film.gif"
    assert main(["simulate", "double_wishbone", "--method", "pod", "--out", str(kept)]) == 0
    assert main(["plot", str(kept), "--animate", str(film)]) == 0
    assert film.stat().st_size > 0
    both = ["--out", str(tmp_path / "a.png"), "--animate", str(tmp_path / "b.gif")]
    assert main(["plot", str(kept), "--kind", "errors", *both]) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == [f"written: {path}" for path in both[1::2]]
    assert all((tmp_path / name).stat().st_size > 0 for name in ("a.png", "b.gif"))
    assert main(["plot", str(kept), "--animate", str(tmp_path / "film.png")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
