"""Studies over parameters: axes and samples of them, and what is trained on."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.study.small import small_study
from vehiclemor.cli import main
from vehiclemor.errors import FileError
from vehiclemor.study.plans.grid import expand, sampled
from vehiclemor.study.plans.study_file import Sampling, StudyFile

CAR = "independent_suspension_vehicle"


def test_a_grid_over_parameters_is_single_simulations_of_these_cars(tmp_path):
    text = """
keep = "metrics"
parameters = { roll_inertia = 250.0 }
start = ["dropped"]
methods = [{ method = "full_order" }, { method = "pod", settings = { rank = 4 } }]
grid = { "parameters.sprung_mass" = [900.0, 1100.0], "parameters.initial_speed" = [25.0] }
"""
    found = vm.run_study(small_study(tmp_path, text, model=CAR), out=tmp_path)
    axis = found["parameters.sprung_mass"]
    assert (axis.attrs["units"], axis.values.tolist()) == ("kg", [900.0, 1100.0])
    for mass in (900.0, 1100.0):
        own = {"roll_inertia": 250.0, "sprung_mass": mass, "initial_speed": 25.0}
        alone = vm.simulate(vm.model(CAR, own), "pod", rank=4, start="dropped")
        here = found.sel({"parameters.sprung_mass": mass, "label": "pod"}).squeeze()
        for name in ("rms_error", "floor_rms_error", "signal_range"):
            np.testing.assert_array_equal(here[name], alone[name])


def test_samples_are_a_dimension_with_the_sampled_values(tmp_path):
    text = """
keep = "metrics"
[sampling]
plan = "latin_hypercube"
count = 5
seed = 3
ranges = { "parameters.tie_rod_inner.z" = [-0.1, -0.09], amplitude_factor = [0.5, 1.0] }
"""
    found = vm.run_study(small_study(tmp_path, text, "full_order"), out=tmp_path)
    assert found["status"].values.ravel().tolist() == ["ok"] * 5
    ranges = found["signal_range"].sel(output="toe").squeeze()
    for index in (0, 4):
        at = found.isel(sample=index)
        car = {"tie_rod_inner.z": float(at["parameters.tie_rod_inner.z"])}
        alone = vm.simulate(
            vm.model("double_wishbone", car), amplitude=float(at["amplitude_factor"])
        )
        assert float(ranges[index]) == float(alone["signal_range"].sel(output="toe"))


@pytest.mark.parametrize("plan", ["latin_hypercube", "sobol"])
def test_a_plan_has_one_point_in_every_slice_of_every_range(plan):
    ranges = {"parameters.a": [2.0, 4.0], "amplitude_factor": [0.0, 9.0]}
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


WISHBONE = "double_wishbone"
MASSES = '{ "parameters.sprung_mass" = [1e3, 1e5] }'
SAMPLES = f'{{ plan = "sobol", count = 2, seed = 1, ranges = {MASSES} }}'
TWICE = 'grid = { start = ["equilibrium"] }\nstart = ["equilibrium"]'


@pytest.mark.parametrize(
    ("model", "text", "words"),
    [
        (WISHBONE, 'grid = { "parameters.tie_rod_iner.z" = [0.1] }', "tie_rod_inner"),
        (WISHBONE, 'grid = { "parameters.tie_rod_inner" = [0.1] }', "3 components"),
        (WISHBONE, 'grid = { "parameters.tie_rod_inner.z" = [-90.0] }', "millimetres"),
        (WISHBONE, 'grid = { training = ["mached"] }', "did you mean matched"),
        (WISHBONE, 'training = "lane_change"', "gives inputs delta, double_wishbone needs z, s0"),
        (WISHBONE, 'training = "set"', "'set' needs training_set"),
        (WISHBONE, TWICE, "start is set twice"),
        (CAR, f"grid = {MASSES}", "sprung_mass = 100000.*can't stand"),
        (CAR, f"sampling = {SAMPLES}", "sprung_mass = .*can't stand"),
    ],
)
def test_wrong_cars_are_told_before_the_first_cell(tmp_path, model, text, words):
    path = small_study(tmp_path, f'keep = "metrics"\n{text}\n', "full_order", model=model)
    with pytest.raises(FileError, match=words) as error:
        vm.run_study(path, out=tmp_path / "results")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "results").exists()


def test_a_run_says_why_cells_are_rejected(tmp_path, capsys):
    path = small_study(tmp_path, 'keep = "metrics"\n', "two_track", model=CAR)
    assert main(["run", str(path), "--out", str(tmp_path)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"1 rejected: {CAR} has no y_dot" in printed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 6, "plan": "sobol"}, "power of two"),
        ({"ranges": {"parameters.a": [2.0, 1.0]}}, "not \\[from, to\\]"),
        ({"ranges": {"a": [1.0, 2.0]}}, "neither parameters.NAME"),
    ],
)
def test_wrong_samplings_are_told(change, words):
    ranges = {"parameters.a": [0.0, 1.0]}
    given = {"plan": "latin_hypercube", "count": 2, "seed": 0, "ranges": ranges}
    with pytest.raises(ValueError, match=words):
        Sampling.model_validate(given | change)


def test_histories_of_other_output_times_are_refused():
    given = {
        "title": "t",
        "model": CAR,
        "grid": {"maneuver": ["lane_change", "step_steer"]},
        "methods": [{"method": "full_order"}],
    }
    with pytest.raises(FileError, match='need keep = "metrics"'):
        expand("mine", StudyFile.model_validate(given))
    assert expand("mine", StudyFile.model_validate(given | {"keep": "metrics"})).unique
