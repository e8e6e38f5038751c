"""What experiments of a study have in common is fitted once."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from vehiclemor.errors import ConvergenceError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.study.evaluate import fresh_fit, kept_fit
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.scenario import Scenario

FAILING = 3
SCENARIOS = (Scenario(component("maneuver", "lane_change"), "equilibrium"),)


@pytest.fixture(scope="module")
def vehicle():
    return build("independent_suspension_vehicle")


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


def guarded(terms):
    words = f"terms = {terms}, sweeps = 0"
    return {"fast": "slow_manifold", "fast_settings": words, "tolerance": 5e-3}


def test_a_guarded_model_is_fitted_around_the_fast_one_that_stands_beside_it(vehicle, fits):
    alone = kept_fit(vehicle, experiment(vehicle, "slow_manifold", terms=2, sweeps=0))
    both = kept_fit(vehicle, experiment(vehicle, "guarded", **guarded(2)))
    assert len(fits) == 1
    assert both.ahead.tolerance == 5e-3
    assert both.fast.coefficients is alone.coefficients
    assert both.offline.seconds == pytest.approx(alone.offline.seconds)
    # What a user fits is fitted for itself, and is the same.
    anew = fresh_fit(vehicle, experiment(vehicle, "guarded", **guarded(2)))
    assert anew.fast.coefficients is not alone.coefficients
    np.testing.assert_array_equal(anew.fast.coefficients, alone.coefficients)
    failed = kept_fit(vehicle, experiment(vehicle, "guarded", **guarded(FAILING)))
    assert failed == Failure("diverged", "no fit")


def test_a_bug_of_a_fit_is_not_kept_and_a_failure_is(vehicle, monkeypatch):
    method, raised = component("method", "slow_manifold"), []

    def fit(*given):
        raised.append(given)
        raise ZeroDivisionError if len(raised) < 3 else ConvergenceError("no fit")

    broken = replace(method, fit=fit)
    monkeypatch.setattr("vehiclemor.study.evaluate.component", lambda *_: broken)
    wanted = experiment(vehicle, "slow_manifold", terms=1, sweeps=0)
    found = [kept_fit(vehicle, wanted).status for _ in range(4)]
    assert found == ["error", "error", "diverged", "diverged"]
    assert len(raised) == 3


def sent(maneuver):
    """What another process gets of a scenario's maneuver."""
    return pickle.loads(pickle.dumps(Scenario(maneuver, "equilibrium"))).maneuver  # noqa: S301 - own


def test_a_registered_maneuver_that_was_sent_is_the_same_again():
    # Its functions are made by another, which no process could find by name.
    maneuver = component("maneuver", "lane_change").perturbed(1.1, 0.9)
    assert sent(maneuver) == maneuver
    # Of two batches it is one, by which a worker finds what it has fitted.
    assert sent(maneuver) is sent(maneuver)
