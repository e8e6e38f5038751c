"""Grids: places are complete, experiments are made once, parameters are axes."""

import numpy as np

import vehiclemor as vm
from tests.models import CAR
from tests.refusing import refused
from tests.study.small import small_study
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.loading import load_studies, read_study, write_study
from vehiclemor.study.plans.results import flattened
from vehiclemor.study.run import run_studies


def test_a_method_that_a_setting_does_not_concern_is_computed_once():
    grid = expand("figures-6-7", load_studies("figures-6-7")["figures-6-7"])
    labels = grid.dimensions["label"]
    assert grid.keys.size == 2 * len(labels)
    shared = {"full_order", "full_order_strongest", "replay"}
    assert len(grid.experiments) == len(shared) + 2 * (len(labels) - len(shared))


def test_a_grid_over_parameters_is_single_simulations_of_these_cars(tmp_path):
    text = """
keep = "metrics"
parameters = { roll_inertia = 250.0 }
start = ["dropped"]
methods = [{ method = "full_order" }, { method = "pod", settings = { rank = 4 } }]
grid = { parameters.sprung_mass = [900.0, 1100.0], "parameters.initial_speed" = [25.0] }
"""
    found = vm.run_study(small_study(tmp_path, text, model=CAR), results=tmp_path)
    axis = found["parameters.sprung_mass"]
    assert (axis.attrs["units"], axis.values.tolist()) == ("kg", [900.0, 1100.0])
    for mass in (900.0, 1100.0):
        own = {"roll_inertia": 250.0, "sprung_mass": mass, "initial_speed": 25.0}
        alone = vm.simulate(vm.model(CAR, own), "pod", rank=4, start="dropped")
        here = found.sel({"parameters.sprung_mass": mass, "label": "pod"}).squeeze()
        for name in ("rms_error", "floor_rms_error", "signal_range", "rms_speed_error"):
            np.testing.assert_array_equal(here[name], alone[name])


def test_rows_of_different_models_keep_their_units_and_counts(tmp_path):
    car = small_study(tmp_path, "", "full_order", model=CAR)
    rows = flattened(run_studies("figures-6-7", tmp_path) | run_studies(str(car), tmp_path))
    assert rows.sizes["cell"] == 2 * 6 + 1
    for output, unit in (("yaw", "rad"), ("spindle_y", "m")):
        assert str(rows["output_unit"].sel(output=output).item()) == unit
    of_car = rows["study"].values == "small"
    for counted, there in (("rhs_calls", of_car), ("iterations", ~of_car)):
        assert (np.isfinite(rows[counted].values) == there).all()
    speeds = np.isfinite(rows["rms_speed_error"].transpose("cell", ...).values)
    assert (speeds == of_car[:, None]).all()
    found = run_studies(str(car), tmp_path)["small"]
    other = found.assign_coords(output_unit=("output", ["ft"] * found.sizes["output"]))
    assert "several units" in refused(lambda: flattened({"one": found, "other": other}))


def test_a_study_that_is_written_is_the_same_again(tmp_path, protocol_text):
    (tmp_path / "a.toml").write_text(protocol_text)
    names = ["figure-11", "vehicle-perturbations", "predictive", str(tmp_path / "a.toml")]
    for definition in (study for name in names for study in load_studies(name).values()):
        path = write_study(definition, tmp_path / "b.toml")
        assert read_study(path) == definition
