"""A fast model with the full order behind it, which runs where the fast one leaves."""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.methods.full_order import FullOrderSystem
from vehiclemor.reduction.methods.guarded import METHOD, FallbackModel
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trust

TOLERANCE = 1e-8
STEER = component("maneuver", "step_steer")


@dataclass(frozen=True)
class LeavesAt:
    """A fast model that is right until it leaves; from then on nothing that it gives is."""

    until: float
    status: str = "untrusted"
    told: bool = True
    offline: OfflineCost = field(default_factory=OfflineCost)
    order: int = 0

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


def guarded(fast):
    safe = FullOrderSystem(model(), "dopri5", TOLERANCE)
    return FallbackModel(fast, safe, OfflineCost())


@settings(max_examples=15)
@given(until=st.floats(0.0, 5.0))
def test_the_safe_model_does_the_run_wherever_the_fast_one_leaves(until):
    run, full = guarded(LeavesAt(until)).simulate(STEER, "dropped"), whole()
    np.testing.assert_array_equal(run.times, full.times)
    np.testing.assert_array_equal(run.outputs, full.outputs)
    assert (run.status, run.message) == ("ok", "")
    assert run.remark.startswith("full_order did the run: the steering is beyond")
    assert (run.trust.indicator, run.trust.until) == (2.0, until)
    assert run.counts["rhs_calls"] > full.counts["rhs_calls"]


def test_a_trusted_run_is_the_fast_one():
    fast = LeavesAt(np.inf, status="ok")
    run, own = guarded(fast).simulate(STEER, "dropped"), fast.simulate()
    assert (run.status, run.remark) == ("ok", own.remark)
    np.testing.assert_array_equal(run.outputs, own.outputs)


def test_a_fast_run_that_fails_without_a_warning_is_trusted_nowhere():
    fast = LeavesAt(3.0, status="diverged", told=False)
    run = guarded(fast).simulate(STEER, "dropped")
    np.testing.assert_array_equal(run.outputs, whole().outputs)
    assert run.remark.startswith("full_order did the run: why, from t = 0 s on")


def test_what_the_safe_model_tells_of_itself_is_kept():
    class Doubtful(FullOrderSystem):
        def simulate(self, *given):
            return super().simulate(*given).judged(Trust(3.0, 4.0, "an arm is beyond"))

    safe = Doubtful(model(), "dopri5", TOLERANCE)
    run = replace(guarded(LeavesAt(2.0)), safe=safe).simulate(STEER, "dropped")
    assert run.status == "untrusted"
    assert "an arm is beyond" in run.message


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fast": "guarded"}, "guard itself"),
        ({"fast": "no_such"}, "no_such"),
        ({"fast_settings": "terms = "}, "fast_settings"),
        ({"fast_settings": "terms = 1.5"}, "terms"),
        ({"fast_settings": "no_such = 1"}, "no_such"),
        ({"fast_settings": "tolerance = 1e-3"}, "setting of its own"),
        ({"fast_settings": "terms.high = 3"}, "terms"),
    ],
)
def test_wrong_settings_are_named(given, words):
    with pytest.raises(InputError, match=words):
        METHOD.check(model(), validated(METHOD, "ode", given))


@pytest.mark.parametrize("text", ["rank = 2, snapshots = 9", "rank = 2\n\nsnapshots = 9,\n"])
def test_settings_of_the_fast_model_stand_in_one_line_or_several(text):
    given = {"fast": "fixed_basis", "solver": "dopri5", "fast_settings": text}
    METHOD.check(model(), validated(METHOD, "ode", given))
    with pytest.raises(InputError, match="snapshots"):
        METHOD.check(
            model(), validated(METHOD, "ode", given | {"fast_settings": text.replace("9", "1")})
        )


def test_settings_reach_both_models():
    vehicle = model()
    given = {"fast": "full_order", "solver": "dopri5", "tolerance": 1e-4, "safe_tolerance": 1e-5}
    fitted = METHOD.fit(vehicle, [], validated(METHOD, "ode", given))
    assert (fitted.fast.solver, fitted.fast.tolerance) == ("dopri5", 1e-4)
    assert (fitted.safe.solver, fitted.safe.tolerance) == ("etdrk4", 1e-5)
