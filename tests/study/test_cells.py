"""Cells: identity follows from content, grids are complete, rows of a collection are all there."""

import dataclasses

import numpy as np
import pytest

from tests.study.small import small_study
from vehiclemor.codegen import cache
from vehiclemor.errors import InputError
from vehiclemor.maneuver import sine_travel
from vehiclemor.reduction.methods import pod
from vehiclemor.simulation.build import build
from vehiclemor.study import evaluate as evaluation
from vehiclemor.study import provenance
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.plans.results import flattened
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.run import run_studies
from vehiclemor.study.scenario import Scenario


def make_cell(model, maneuver, method, given, training="matched", **factors):
    """An experiment on one run from the equilibrium."""
    test = Scenario(maneuver, "equilibrium")
    settings = complete_settings(model, method, given)
    trained = training_set(model, method, training, test, **factors)
    return make_experiment(model, method, settings, trained, (test,))


@pytest.fixture(autouse=True)
def _nothing_kept():
    """What an earlier test has fitted or solved is not used again."""
    evaluation.kept_reference.cache_clear()
    evaluation._KEPT.clear()


@pytest.fixture(scope="module")
def cell():
    return make_cell(build("double_wishbone"), sine_travel, "pod", {"rank": 3})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("test", (Scenario(sine_travel.perturbed(1.0000001), "equilibrium"),)),
        ("kernel", "another"),
        ("code", "another"),
        ("test", (Scenario(dataclasses.replace(sine_travel, samples=1002), "equilibrium"),)),
        ("test", (Scenario(sine_travel, "dropped"),)),
        ("training", (Scenario(sine_travel.perturbed(1.1), "equilibrium"),)),
        ("settings", {"rank": 4}),
        ("parameters", {}),
        ("keep", "metrics"),
    ],
)
def test_key_changes_with_all_that_determines_the_result(cell, field, value):
    again = make_cell(build("double_wishbone"), sine_travel, "pod", {"rank": 3})
    assert dataclasses.replace(cell, **{field: value}).key != again.key == cell.key


def test_versions_count_where_a_method_declares_them(cell, monkeypatch):
    def key() -> str:
        return make_cell(build("double_wishbone"), sine_travel, "pod", {"rank": 3}).key

    declared = dataclasses.replace(pod.METHOD, packages=("scipy",))
    keys = []
    for _ in range(2):
        monkeypatch.setattr(pod, "METHOD", declared)
        keys.append(key())
        monkeypatch.undo()
        assert key() == cell.key
        # Another processor, other libraries.
        monkeypatch.setattr(cache, "compiler_identity", lambda: "another")
        monkeypatch.setattr(provenance, "version", lambda _: "0.0")
        assert key() == cell.key
    assert len({cell.key, *keys}) == 3


def test_another_geometry_gives_another_key_and_result(cell):
    moved = build("double_wishbone", overrides={"tie_rod_inner": [-0.2, 0.4921, -0.0962]})
    other = make_cell(moved, sine_travel, "full_order", {})
    assert other.key != cell.key
    dataset = evaluate(other)
    # The low-bump-steer tie rod of the source: toe within 0.06 deg over +-0.1 m.
    assert float(abs(dataset["outputs"].sel(output="toe")).max()) < 0.06 * 3.15 / 180.0


def test_a_method_that_a_setting_does_not_concern_is_computed_once():
    grid = expand("figures-6-7", load_studies("figures-6-7")["figures-6-7"])
    labels = grid.dimensions["label"]
    assert grid.keys.size == 2 * len(labels)
    shared = {"full_order", "full_order_strongest", "replay"}
    assert len(grid.unique) == len(shared) + 2 * (len(labels) - len(shared))


def test_a_plug_in_model_that_breaks_in_the_reference_spoils_only_its_cell(
    cell, model, monkeypatch
):
    def broken(*_):
        raise ZeroDivisionError("in a plug-in")

    monkeypatch.setattr(type(model), "simulate", broken)
    dataset = evaluate(cell)
    assert dataset["status"].item() == "error"
    assert "ZeroDivisionError: in a plug-in" in dataset["message"].item()


def test_set_policy_needs_and_uses_its_factors():
    model = build("double_wishbone")
    with pytest.raises(InputError, match="training_set"):
        make_cell(model, sine_travel, "pod", {}, training="set")
    errors = {}
    for factors in (((1.0, 1.0),), ((1.0, 1.0), (1.2, 1.0))):
        faster, trained = sine_travel.perturbed(1.2), {"training": "set", "factors": factors}
        cell = make_cell(model, faster, "pod", {"rank": 4}, **trained)
        errors[len(factors)] = float(evaluate(cell)["rms_error"].sel(output="spindle_y"))
    assert errors[2] < 0.5 * errors[1]


def test_rows_of_different_models_keep_their_units_and_counts(tmp_path):
    car = small_study(tmp_path, "", "full_order", model="independent_suspension_vehicle")
    rows = flattened(run_studies("figures-6-7", tmp_path) | run_studies(str(car), tmp_path))
    assert rows.sizes["cell"] == 2 * 6 + 1
    for output, unit in (("yaw", "rad"), ("spindle_y", "m")):
        assert str(rows["output_unit"].sel(output=output).item()) == unit
    of_car = rows["study"].values == "small"
    for counted, there in (("rhs_calls", of_car), ("iterations", ~of_car)):
        assert (np.isfinite(rows[counted].values) == there).all()
    speeds = np.isfinite(rows["rms_speed_error"].transpose("cell", ...).values)
    assert (speeds == of_car[:, None]).all()


def test_settings_of_a_method_that_refuses_the_model_are_not_judged():
    model = build("double_wishbone")
    cell = make_cell(model, sine_travel, "two_track", {"rnk": 3})
    assert cell.settings == {}
    dataset = evaluate(cell)
    assert dataset["status"].item() == "rejected"
    assert "double_wishbone" in dataset["message"].item()
    assert np.isnan(dataset["coordinates"]).all()
