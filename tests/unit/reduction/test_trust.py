"""What reduced models tell of their runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build, reparametrised


@given(size=st.floats(0.0, 3.0), sample=st.integers(0, 9), column=st.integers(0, 1))
def test_the_first_range_that_is_left_is_named(size, sample, column):
    used = np.zeros((10, 2))
    used[sample:, column] = -size
    found = trust_of(np.arange(10.0), used, ("roll", "speed"))
    assert found.indicator == size
    assert found.until == (sample if size > 1.0 else np.inf)
    assert found.reason.startswith(("roll", "speed")[column] if size > 1.0 else "")
    assert bool(found.reason) == (size > 1.0)


def test_what_is_no_number_is_beyond():
    found = trust_of(np.arange(3.0), np.array([[0.5], [np.nan], [0.1]]), ("roll",))
    assert (found.indicator, found.until) == (0.5, 1.0)


@pytest.mark.parametrize(("amplitude", "status"), [(1.0, "ok"), (-1.0, "ok"), (1.6, "untrusted")])
def test_frozen_inertia_tells_when_its_arms_leave_what_it_knows(amplitude, status):
    model, method = build("high_fidelity_vehicle"), component("method", "frozen_inertia")
    reduced = method.fit(model, [], validated(method, "dae", {}))
    lane_change = component("maneuver", "rack_lane_change").perturbed(1.0, amplitude)
    run = reduced.simulate(lane_change, "equilibrium")
    assert run.status == status
    if status == "untrusted":
        assert "arm is beyond its known range" in run.message
        # The steering sets in at 1 s.
        assert 1.0 < run.trust.until < 5.0
        assert np.isfinite(run.outputs).all()


@pytest.mark.parametrize(("speed", "status"), [(20.0, "ok"), (22.0, "ok"), (30.0, "untrusted")])
def test_frozen_inertia_tells_when_a_fast_car_slides_with_its_arms_in_range(speed, status):
    stiff = {"front_stiffness": 80000.0, "rear_stiffness": 50000.0, "initial_speed": speed}
    model = reparametrised(build("high_fidelity_vehicle"), stiff)
    method = component("method", "frozen_inertia")
    reduced = method.fit(model, [], validated(method, "dae", {"tolerance": 1e-4}))
    lane_change = component("maneuver", "rack_lane_change").perturbed(1.5, 1.1)
    run, true = reduced.simulate(lane_change, "equilibrium"), model.simulate(lane_change)
    aside = model.outputs.index("lateral_position")
    wrong = np.abs(run.outputs - true.outputs)[:, aside].max() > 0.05
    assert run.status == status
    assert wrong == (status == "untrusted")
    assert run.message.count("lateral speed is beyond") == int(wrong)
