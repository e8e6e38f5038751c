"""A reduced model with the full order behind it, which repeats what is not to be trusted."""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.reduction.fallback import FallbackModel, run_of
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.methods.full_order import FullOrderSystem
from vehiclemor.reduction.validation import fitted, validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trust

TOLERANCE = 1e-8
STEER = component("maneuver", "step_steer")


@dataclass(frozen=True)
class LeavesAt:
    """A reduced model that is right until it leaves; from then on nothing that it gives is."""

    until: float
    status: str = "untrusted"
    told: bool = True
    offline: OfflineCost = field(default_factory=OfflineCost)
    order: int = 0
    reduced: str = "called as that of a model with fallback"

    def simulate(self, *_):
        full = whole()
        late = full.times >= self.until
        wrong = {
            name: np.where(late[:, None], np.nan, getattr(full, name))
            for name in ("coordinates", "speeds", "outputs")
        }
        trust = Trust(2.0, self.until, "the steering is beyond") if self.told else None
        return replace(full, status=self.status, message="why", trust=trust, **wrong)


@cache
def whole():
    return model().simulate(STEER, "dropped", solver="dopri5", tolerance=TOLERANCE)


def model():
    return build("independent_suspension_vehicle")


def guarded(reduced):
    return FallbackModel(reduced, FullOrderSystem(model(), "dopri5", TOLERANCE))


@settings(max_examples=15)
@given(until=st.floats(0.0, 5.0))
def test_the_full_order_does_the_run_wherever_the_reduced_model_leaves(until):
    run, full = guarded(LeavesAt(until)).simulate(STEER, "dropped"), whole()
    np.testing.assert_array_equal(run.times, full.times)
    np.testing.assert_array_equal(run.outputs, full.outputs)
    assert (run.status, run.message) == ("ok", "")
    assert run.remark.startswith("full_order did the run: the steering is beyond")
    assert (run.trust.indicator, run.trust.until) == (2.0, until)
    assert run.counts["rhs_calls"] > full.counts["rhs_calls"]


def test_a_trusted_run_is_the_reduced_one():
    reduced = LeavesAt(np.inf, status="ok")
    run, own = guarded(reduced).simulate(STEER, "dropped"), reduced.simulate()
    assert (run.status, run.remark) == ("ok", own.remark)
    np.testing.assert_array_equal(run.outputs, own.outputs)
    assert run_of(reduced, (STEER, "dropped"), None, None, estimate=False).status == "ok"


def test_a_reduced_run_that_fails_without_a_warning_is_trusted_nowhere():
    run = guarded(LeavesAt(3.0, status="diverged", told=False)).simulate(STEER, "dropped")
    np.testing.assert_array_equal(run.outputs, whole().outputs)
    assert run.remark.startswith("full_order did the run: why, from t = 0 s on")


def test_settings_reach_both_models():
    method, vehicle = component("method", "modal_truncation"), model()
    settings = {"tolerance": 1e-4, "fallback": "dopri5", "fallback_tolerance": TOLERANCE}
    reduced = fitted(method, vehicle, [], validated(method, "ode", settings))
    assert reduced.reduced.tolerance == 1e-4
    # A car that is linear lands otherwise.
    run = reduced.simulate(STEER, "dropped")
    np.testing.assert_array_equal(run.outputs, whole().outputs)
    assert run.remark.startswith("full_order did the run: the estimated error of ")
    assert fitted(method, vehicle, [], validated(method, "ode", {})).tolerance == 1e-3
