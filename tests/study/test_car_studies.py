"""Studies over parameters: axes and samples of them, and what is trained on."""

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.errors import FileError
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.sampling import sampled
from vehiclemor.study.plans.study_file import Sampling, StudyFile

HEAD = """
title = "for the tests"
model = "{}"
keep = "metrics"
"""
SUSPENSION = HEAD.format("double_wishbone")


@pytest.fixture
def study(tmp_path):
    """Writes a study file and runs it."""

    def run(text: str):
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return vm.run_study(path, out=tmp_path / "results")

    return run


def test_a_grid_over_parameters_is_single_simulations_of_these_cars(study):
    found = study(
        HEAD.format("independent_suspension_vehicle")
        + """
parameters = { roll_inertia = 250.0 }
start = ["dropped"]
methods = [{ method = "full_order" }, { method = "pod", settings = { rank = 4 } }]
grid = { "parameters.sprung_mass" = [900.0, 1100.0], "parameters.initial_speed" = [25.0] }
"""
    )
    axis = found["parameters.sprung_mass"]
    assert (axis.attrs["units"], axis.values.tolist()) == ("kg", [900.0, 1100.0])
    assert "mass" in axis.attrs["long_name"]
    for mass in (900.0, 1100.0):
        own = {"roll_inertia": 250.0, "sprung_mass": mass, "initial_speed": 25.0}
        car = vm.model("independent_suspension_vehicle", own)
        alone = vm.simulate(car, "pod", rank=4, start="dropped")
        here = found.sel({"parameters.sprung_mass": mass, "method": "pod"}).squeeze()
        for name in ("rms_error", "floor_rms_error", "signal_range"):
            np.testing.assert_array_equal(here[name], alone[name])


def test_samples_are_a_dimension_with_the_sampled_values(study):
    found = study(
        SUSPENSION
        + """
methods = [{ method = "full_order" }]
[sampling]
plan = "latin_hypercube"
count = 5
seed = 3
ranges = { "parameters.tie_rod_inner.z" = [-0.1, -0.09], amplitude_factor = [0.5, 1.0] }
"""
    )
    assert found.sizes["sample"] == 5
    assert found["status"].values.ravel().tolist() == ["ok"] * 5
    ranges = found["signal_range"].sel(output="toe").squeeze()
    for index in (0, 4):
        at = found.isel(sample=index)
        car = {"tie_rod_inner.z": float(at["parameters.tie_rod_inner.z"])}
        alone = vm.simulate(
            vm.model("double_wishbone", car), amplitude=float(at["amplitude_factor"])
        )
        expected = float(alone["signal_range"].sel(output="toe"))
        assert float(ranges[index]) == expected


@pytest.mark.parametrize("plan", ["latin_hypercube", "sobol"])
def test_a_plan_has_one_point_in_every_slice_of_every_range(plan):
    ranges = {
        "parameters.a": [2.0, 4.0],
        "parameters.b": [-1.0, 0.0],
        "amplitude_factor": [0.0, 9.0],
    }
    given = Sampling(plan=plan, count=64, seed=1, ranges=ranges)
    for name, values in sampled(given).items():
        low, high = ranges[name]
        slices = np.floor(64 * (np.array(values) - low) / (high - low))
        assert sorted(slices) == list(range(64))
    assert sampled(given) == sampled(given)
    assert sampled(given) != sampled(given.model_copy(update={"seed": 2}))


def test_training_policies_and_maneuvers_are_axes():
    given = {
        "title": "t",
        "model": "double_wishbone",
        "keep": "metrics",
        "grid": {
            "training": ["matched", "nominal", "travel_and_rack"],
            "maneuver": ["sine_travel", "chirp_travel"],
            "amplitude_factor": [0.9],
            "parameters.tie_rod_inner.z": [-0.09],
        },
        "methods": [{"method": "pod"}],
    }
    grid = expand("mine", StudyFile.model_validate(given))
    seen = {
        (run.maneuver.name, run.maneuver.amplitude_factor, run.parameters)
        for cell in grid.unique.values()
        for run in cell.training
    }
    # The tested ones, the model's own, and the named one.
    runs = [("sine_travel", 0.9), ("chirp_travel", 0.9), ("sine_travel", 1.0)]
    runs.append(("travel_and_rack", 1.0))
    assert seen == {(*run, (("tie_rod_inner.z", -0.09),)) for run in runs}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('grid = { "parameters.tie_rod_iner.z" = [0.1] }', "did you mean tie_rod_inner"),
        ('grid = { "parameters.tie_rod_inner" = [0.1] }', "a point has 3 components"),
        ('grid = { "parameters.tie_rod_inner.z" = ["low"] }', "'low' is not a number"),
        ('grid = { "parameters.tie_rod_inner.z" = [-90.0] }', "is it in millimetres"),
        ("parameters = { tie_rod = 1.0 }", "'tie_rod' is not a parameter"),
        ('grid = { training = ["mached"] }', "did you mean matched"),
        ('grid = { maneuver = ["sine_travl"] }', "did you mean sine_travel"),
        ('grid = { start = ["equilibrum"] }', "unknown start 'equilibrum'"),
        ('grid = { start = ["equilibrium"] }\nstart = ["equilibrium"]', "start is set twice"),
        ('grid = { "parameters.toe.z" = [1.0] }\nparameters = { "toe.z" = 1.0 }', "set twice"),
    ],
)
def test_wrong_cars_are_told_before_the_first_cell(tmp_path, text, words):
    refused(tmp_path, SUSPENSION + text, words)


def test_a_run_says_why_cells_are_rejected(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(
        HEAD.format("independent_suspension_vehicle")
        + """
methods = [{ method = "two_track" }]
grid = { "parameters.sprung_mass" = [900.0] }
"""
    )
    assert main(["run", str(path), "--out", str(tmp_path)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "1 rejected: independent_suspension_vehicle has no y_dot" in printed


SAMPLED = """
[sampling]
plan = "sobol"
count = 2
seed = 1
ranges = { "parameters.sprung_mass" = [5e4, 1e5] }
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('grid = { "parameters.sprung_mass" = [1e3, 1e5] }', "sprung_mass = 100000.*can't stand"),
        ("parameters = { sprung_mass = 1e5 }", "can't stand"),
        (SAMPLED, "sprung_mass = .*can't stand"),
    ],
)
def test_cars_that_cant_stand_are_told_before_the_first_cell(tmp_path, text, words):
    refused(tmp_path, HEAD.format("independent_suspension_vehicle") + text, words)


def refused(tmp_path, text, words):
    path, results = tmp_path / "mine.toml", tmp_path / "results"
    path.write_text(text + '\n[[methods]]\nmethod = "full_order"\n')
    with pytest.raises(FileError, match=words) as error:
        vm.run_study(path, out=results)
    assert "\n" not in str(error.value)
    assert not results.exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 6, "plan": "sobol"}, "power of two"),
        ({"count": 0}, "greater than or equal to 1"),
        ({"seed": -1}, "greater than or equal to 0"),
        ({"ranges": {}}, "ranges is empty"),
        ({"ranges": {"parameters.a": [2.0, 1.0]}}, "not \\[from, to\\]"),
        ({"ranges": {"parameters.a": [-1e308, 1e308]}}, "not \\[from, to\\]"),
        ({"ranges": {"a": [1.0, 2.0]}}, "neither parameters.NAME"),
        ({"plan": "random"}, "latin_hypercube"),
    ],
)
def test_wrong_samplings_are_told(change, words):
    given = {
        "plan": "latin_hypercube",
        "count": 2,
        "seed": 0,
        "ranges": {"parameters.a": [0.0, 1.0]},
    }
    with pytest.raises(ValueError, match=words):
        Sampling.model_validate(given | change)


def test_histories_of_other_output_times_are_refused():
    given = {
        "title": "t",
        "model": "independent_suspension_vehicle",
        "grid": {"maneuver": ["lane_change", "step_steer"]},
        "methods": [{"method": "full_order"}],
    }
    with pytest.raises(FileError, match='need keep = "metrics"'):
        expand("mine", StudyFile.model_validate(given))
    assert expand("mine", StudyFile.model_validate(given | {"keep": "metrics"})).unique
