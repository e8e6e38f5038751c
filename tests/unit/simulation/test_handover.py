"""Runs that begin in mid-maneuver: cut at any time and continued, a run is the uncut one."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vehiclemor.errors import InputError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build

CASES = (
    ("independent_suspension_vehicle", "step_steer"),
    ("high_fidelity_vehicle", "rack_step_steer"),
)
TOLERANCE = 1e-8


@cache
def uncut(model_name, maneuver_name):
    model, maneuver = build(model_name), component("maneuver", maneuver_name)
    return maneuver, model, model.simulate(maneuver, "dropped", tolerance=TOLERANCE)


# The steering moves from 1 s to 1.2 s; its acceleration jumps in neither.
@pytest.mark.parametrize("case", CASES)
@settings(max_examples=6)
@given(sample=st.integers(0, 250))
@example(sample=0)
@example(sample=50)
@example(sample=55)
@example(sample=60)
@example(sample=250)
def test_a_cut_run_goes_on_as_the_uncut_one(case, sample):
    maneuver, model, whole = uncut(*case)
    begin = float(whole.time[sample])
    later = model.simulate(maneuver, whole.states[sample], tolerance=TOLERANCE, begin=begin)
    np.testing.assert_array_equal(later.time, whole.time[sample:])
    scale = np.abs(whole.states).max(axis=0) + 1.0
    # Both runs are wrong by their tolerance a step, in hundreds of steps.
    assert np.abs((later.states - whole.states[sample:]) / scale).max() < 3e3 * TOLERANCE


def test_a_run_begins_between_output_times_too():
    model, maneuver = build("independent_suspension_vehicle"), component("maneuver", "step_steer")
    whole = model.simulate(maneuver)
    begin = 1.0137
    state = model.simulate(maneuver, times=[0.0, begin]).states[-1]
    later = model.simulate(maneuver, state, begin=begin)
    np.testing.assert_array_equal(later.time, whole.time[whole.time > begin])
    np.testing.assert_allclose(later.states, whole.states[-len(later.time) :], atol=1e-5)


def test_a_run_begins_within_its_maneuver_and_no_output_time_lies_before():
    model, maneuver = build("independent_suspension_vehicle"), component("maneuver", "step_steer")
    for begin in (-0.1, 5.1, np.nan):
        with pytest.raises(InputError, match="begin"):
            model.simulate(maneuver, begin=begin)
    with pytest.raises(InputError, match="1 to 5 s"):
        model.simulate(maneuver, times=[0.5, 2.0], begin=1.0)
