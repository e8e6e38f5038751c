"""Experiments: identity follows from content, runs are measured, what is common is fitted once."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from vehiclemor import provenance
from vehiclemor.codegen import cache
from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.failure import Failure
from vehiclemor.inputs.suspension import sine_travel
from vehiclemor.reduction.methods import pod
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.study import evaluate as evaluation
from vehiclemor.study.evaluate import cached_fit, evaluate, fresh_fit
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.scenario import Scenario

MOVED = (("tie_rod_inner.z", -0.09),)


def make_cell(model, maneuver, method, given):
    """An experiment on one run from the equilibrium, trained on the same."""
    run = (Scenario(maneuver, "equilibrium"),)
    return make_experiment(model, method, complete_settings(model, method, given), run, run)


def of_runs(model, method, training, tests, **settings):
    complete = complete_settings(model, method, settings)
    return make_experiment(model, method, complete, training, tests, "errors")


@pytest.fixture(autouse=True)
def _nothing_kept():
    """What an earlier test has fitted or solved is not used again."""
    evaluation.cached_reference.cache_clear()
    evaluation._FITS.clear()


@pytest.fixture(scope="module")
def cell():
    return make_cell(build("double_wishbone"), sine_travel, "pod", {"rank": 3})


@pytest.fixture(scope="module")
def vehicle():
    return vm.model(CAR)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("test", (Scenario(sine_travel.perturbed(1.0000001), "equilibrium"),)),
        ("kernel", "another"),
        ("code", "another"),
        ("test", (Scenario(dataclasses.replace(sine_travel, samples=1002), "equilibrium"),)),
        ("test", (Scenario(sine_travel, "dropped"),)),
        ("test", (Scenario(sine_travel, "equilibrium", None, MOVED),)),
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


def test_a_run_is_measured_the_same_way_in_grids_and_protocols(vehicle):
    tests = [
        Scenario.of("lane_change", (1.0, amplitude), "equilibrium", 20.0) for amplitude in (1, 1.5)
    ]
    many = evaluate(of_runs(vehicle, "fixed_basis", tuple(tests[:1]), tuple(tests)))
    for number, test in enumerate(tests):
        settings = complete_settings(vehicle, "fixed_basis")
        given = vehicle, "fixed_basis", settings, tuple(tests[:1]), (test,)
        whole, metrics = (
            evaluate(make_experiment(*given, keep)) for keep in ("trajectories", "metrics")
        )
        one = many.isel(scenario=number)
        error = (whole["outputs"] - whole["reference_outputs"]).values
        np.testing.assert_array_equal(one["rms_error"], np.sqrt(np.mean(error**2, axis=0)))
        np.testing.assert_array_equal(one["max_error"], np.abs(error).max(axis=0))
        inside = (
            whole["outputs"].sel(time=slice(0.0, 10.0)),
            whole["outputs"].sel(time=slice(1, 99)),
        )
        np.testing.assert_array_equal(one["largest_output"], np.abs(inside[0]).max("time"))
        np.testing.assert_array_equal(one["smallest_output"], inside[1].min("time"))
        for name in (*one.data_vars, "output_unit"):
            if name not in ("seconds", "offline_seconds", "status", "message", "remark"):
                np.testing.assert_array_equal(one[name], metrics[name], str(name))
        # A grid shows what a protocol would not trust.
        assert bool(one["warned"])
        assert one["status"].item() == "untrusted"
        assert metrics["status"].item() == "ok"
        assert "untrusted: " in metrics["remark"].item()


def test_of_a_run_that_has_failed_nothing_counts_in_a_protocol(model):
    run, given = (Scenario(sine_travel, "equilibrium"),), {"tolerance": 1e-300}
    settings = complete_settings(model, "full_order", given)
    many, one = (
        evaluate(make_experiment(model, "full_order", settings, run, run, keep))
        for keep in ("errors", "metrics")
    )
    for found in (many, one):
        assert (found["status"] == "diverged").all()
        assert np.isnan(found["rms_error"]).all()
        assert not found["warned"].any()
    assert (many["iterations"].item(), many["message"].item()) == (0, one["message"].item())
    assert np.isnan(many["seconds"].item())
    # A grid tells how far it came.
    assert one["iterations"].item() > 0


def test_a_bug_in_a_braked_run_is_a_result(vehicle, monkeypatch):
    braked = make_cell(vehicle, component("maneuver", "braking_in_turn"), "fixed_basis", {})
    monkeypatch.setattr(evaluation, "in_training", None)
    assert evaluate(braked)["status"].item() == "error"


# Runs of other cars


def test_a_method_is_not_used_on_a_model_that_it_was_not_trained_on(model):
    runs = Scenario(sine_travel, "equilibrium"), Scenario(sine_travel, "equilibrium", None, MOVED)
    found = evaluate(of_runs(model, "pod", runs[:1], runs[1:], rank=3))
    assert found["status"].item() == "rejected"
    assert "another" in found["message"].item()
    with pytest.raises(InputError, match="of one model"):
        of_runs(model, "pod", runs[:1], runs, rank=3)


FAILING = 3
SCENARIOS = (Scenario(component("maneuver", "lane_change"), "equilibrium"),)


def experiment(model, method, **settings):
    return of_runs(model, method, SCENARIOS, SCENARIOS, **settings)


@pytest.fixture
def fits(monkeypatch):
    """Fits of the slow manifold that are made: their arguments."""
    method, found = component("method", "slow_manifold"), []

    def fit(*given):
        found.append(given)
        if given[-1].terms == FAILING:
            raise ConvergenceError("no fit")
        return method.fit(*given)

    def spied(kind, name):
        return replace(method, fit=fit) if name == method.name else component(kind, name)

    monkeypatch.setattr("vehiclemor.study.evaluate.component", spied)
    return found


def test_one_fit_serves_all_solvers_tolerances_and_fallbacks(vehicle, fits):
    quick = {"terms": 2, "steps": 0}
    alone = cached_fit(vehicle, experiment(vehicle, "slow_manifold", **quick))
    loose = cached_fit(vehicle, experiment(vehicle, "slow_manifold", tolerance=5e-3, **quick))
    guarded = cached_fit(vehicle, experiment(vehicle, "guarded", fallback="dopri5", **quick))
    assert len(fits) == 1
    assert (loose.tolerance, guarded.reduced.tolerance) == (5e-3, 2e-3)
    assert (guarded.full.solver, guarded.full.tolerance) == ("dopri5", 1e-4)
    assert guarded.reduced.coefficients is loose.coefficients is alone.coefficients
    assert guarded.offline == alone.offline
    # What a user fits is fitted for itself, and is the same.
    anew = fresh_fit(vehicle, experiment(vehicle, "guarded", **quick))
    assert anew.reduced.coefficients is not alone.coefficients
    np.testing.assert_array_equal(anew.reduced.coefficients, alone.coefficients)
    failed = cached_fit(vehicle, experiment(vehicle, "guarded", terms=FAILING, steps=0))
    assert failed == Failure("diverged", "no fit")
