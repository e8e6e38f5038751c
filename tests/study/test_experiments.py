"""Experiments: identity follows from content, runs are measured, what is common is fitted once."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
from vehiclemor.study.evaluate import cached_fit, evaluate, fresh_fit, known_inputs
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import Scenario, speed_of

HEAVY = (("sprung_mass", 1500.0), ("initial_speed", 25.0))
MOVED = (("tie_rod_inner.z", -0.09),)


def make_cell(model, maneuver, method, given, training="matched", **factors):
    """An experiment on one run from the equilibrium."""
    test = Scenario(maneuver, "equilibrium")
    settings = complete_settings(model, method, given)
    trained = training_set(model, method, training, test, **factors)
    return make_experiment(model, method, settings, trained, (test,))


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
        assert "not to be trusted" in metrics["remark"].item()


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
    complete = complete_settings(model, method, settings)
    return make_experiment(model, method, complete, SCENARIOS, SCENARIOS, "errors")


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


def test_a_bug_of_a_fit_is_not_kept_and_a_failure_is(vehicle, monkeypatch):
    method, raised = component("method", "slow_manifold"), []

    def fit(*given):
        raised.append(given)
        raise ZeroDivisionError if len(raised) < 3 else ConvergenceError("no fit")

    broken = replace(method, fit=fit)
    monkeypatch.setattr("vehiclemor.study.evaluate.component", lambda *_: broken)
    wanted = experiment(vehicle, "slow_manifold", terms=1, steps=0)
    found = [cached_fit(vehicle, wanted).status for _ in range(4)]
    assert found == ["error", "error", "diverged", "diverged"]
    assert len(raised) == 3


def test_a_fit_for_a_model_of_another_kind_is_a_failure(vehicle):
    assert isinstance(cached_fit(vehicle, experiment(vehicle, "path_map")), Failure)


MODELS = {
    "independent_suspension_vehicle": "lane_change",
    "high_fidelity_vehicle": "rack_multisine",
}


def scenario(model, frequency=1.0, amplitude=1.0, speed=20.0):
    maneuver = component("maneuver", MODELS[model]).perturbed(frequency, amplitude)
    return Scenario(maneuver, "equilibrium", speed)


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=20)
@given(frequency=st.floats(0.5, 2.0), amplitude=st.floats(-2.0, 2.0), speed=st.floats(15.0, 25.0))
def test_a_run_is_trusted_exactly_within_the_range(model, frequency, amplitude, speed):
    training = (scenario(model, 1.0, 1.2, 18.0), scenario(model, 1.3, -0.8, 22.0))
    known = known_inputs(build(model), training)
    test = scenario(model, frequency, amplitude, speed)
    found = known.trust(build(model), test.maneuver, speed_of(build(model), test))
    if abs(amplitude) > 1.201 or not 17.99 < speed < 22.01:
        assert found.indicator > 1.0
        assert found.reason
    # Slower and clearly smaller than a training run.
    elif abs(amplitude) <= 1.0 and frequency <= 1.0:
        assert found.indicator <= 1.0


@pytest.mark.parametrize(
    ("method", "amplitude", "status"),
    [
        ("fixed_basis", 1.5, "untrusted"),
        ("linear_single_track", 1.5, "untrusted"),
        ("full_order", 1.5, "ok"),
        ("replay", 1.5, "ok"),
    ],
)
def test_no_reduced_vehicle_is_silent_where_it_is_wrong(method, amplitude, status):
    model = build("independent_suspension_vehicle")
    tests = (scenario(model.name, 1.0, amplitude),)
    chosen = complete_settings(model, method)
    training = (scenario(model.name, 1.0, 1.1),)
    found = evaluate(make_experiment(model, method, chosen, training, tests, "errors"))
    assert found["status"].item() == status
    if status == "untrusted":
        assert "the estimated error of" in found["message"].item()
        assert found["trust_indicator"].item() > 1.0
