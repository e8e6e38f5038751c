"""Reduced vehicles know how long runs may last and which starts they know."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.reducing import CARS
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.vehicle.decoding import NOTHING_KNOWN, durations
from vehiclemor.reduction.vehicle.decoding_loops import LEVELS
from vehiclemor.reduction.vehicle.reduced_vehicle import NOTHING_EXCITED


@pytest.fixture(scope="module")
def reduced(reduced):
    """Any steering is known here: that has tests of its own."""
    return replace(reduced, reach=replace(reduced.reach, inputs=NOTHING_KNOWN.inputs))


def test_durations_of_the_compiled_loop_are_those_of_numpy(reduced):
    model, maneuver = reduced.model, CARS[reduced.model.name]
    times, lift = maneuver.times, reduced.decoder
    path, inputs = reduced.path(maneuver, "equilibrium"), maneuver.at(times)
    columns, size = reduced.features.lateral, 2 * len(model.coordinates)
    rng = np.random.default_rng(5)
    sizes = np.abs(lift.states(times, path, inputs, NOTHING_EXCITED)[0][:, size : size + columns])
    beyond = durations(times, sizes)
    for lasted in (beyond[-1] * 0.7 + 1e-3, *rng.uniform(0.5, 60.0, (4, 2 * columns, LEVELS))):
        known = replace(reduced, reach=replace(reduced.reach, lasted=lasted))
        _, trust = known.decoder.states(times, path, inputs, NOTHING_EXCITED)
        part = (beyond[-1] / lasted).max()
        assert trust.indicator == pytest.approx(max(part, sizes.max()), rel=1e-9)
        if part > 1.0 and not (sizes > 1.0).any():
            first = times[(beyond > lasted).any(axis=(1, 2))][0]
            assert trust.until == pytest.approx(first, abs=0.021)
            assert "longer" in trust.reason


def held(reduced, seconds, begin=1.0):
    """A third of the lane change's steering, held for so long from a time on."""
    known = CARS[reduced.model.name]
    size = np.abs(known.at(known.times)[:, 0]).max() / 3.0

    def signal(times, _, amplitude):
        s = np.clip((times - begin) / 0.5, 0.0, 1.0) - np.clip(
            (times - begin - seconds) / 0.5, 0.0, 1.0
        )
        inside = (s > 0.0) & (s < 1.0)
        slope = np.where(times < begin + 1.0, 2.0, -2.0) * inside
        value, first = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 * slope
        second = 60 * s * (1 - s) * (1 - 2 * s) * slope**2
        return amplitude * size * np.column_stack([value, first, second])[:, : len(known.inputs)]

    corners = (begin, begin + 0.5, begin + seconds, begin + seconds + 0.5)
    duration = begin + seconds + 3.0
    samples = round(50 * duration) + 1
    return Maneuver("held", "", signal, known.inputs, duration, samples, lambda _: corners)


def test_what_lasts_longer_than_in_any_training_run_is_told(reduced):
    run = reduced.simulate(held(reduced, 20.0), "equilibrium")
    assert run.status == "untrusted"
    assert "longer" in run.message
    assert 1.5 < run.trust.until < 20.0
    assert run.trust.indicator > 1.0


def test_the_least_motion_lasts_no_longer_than_training_runs_and_none_for_ever(reduced):
    longest = reduced.reach.lasted[0, 0]
    little = held(reduced, 30.0).perturbed(1.0, 0.02)
    run = reduced.simulate(little, "equilibrium")
    assert run.status == "untrusted"
    assert "longer" in run.message
    # It is told at a step of the integration.
    assert 1.0 < run.trust.until - longest < 3.5
    for start in reduced.model.starts:
        straight = reduced.simulate(little.perturbed(1.0, 0.0), start).trust
        assert "lateral" not in straight.reason


def test_training_runs_are_known(reduced):
    for factors in ((1.0, 1.0), (1.3, -0.7)):
        maneuver = CARS[reduced.model.name].perturbed(*factors)
        for start in reduced.model.starts:
            trust = reduced.simulate(maneuver, start).trust
            assert "longer" not in trust.reason
            assert "start" not in trust.reason


@pytest.mark.parametrize("begin", [0.0, 1.0])
def test_who_steers_before_the_car_has_settled_is_told(reduced, begin):
    run = reduced.simulate(held(reduced, 1.0, begin), "dropped")
    told = ("heave and pitch", "lateral motion begins earlier")
    if begin == 0.0:
        assert run.trust.reason.startswith(told)
    # The rough fit of the other car does not know the drop itself.
    elif reduced.model.name.startswith("independent"):
        assert run.trust.reason == ""
    assert reduced.simulate(held(reduced, 1.0, begin), "equilibrium").trust.reason == ""


def test_a_drop_has_settled_when_training_runs_were_steered(reduced):
    excited = reduced.excited(reduced.model.start("dropped"))
    assert reduced.reach.decay_time(excited) >= 0.99 * reduced.reach.faded > 0.5
    assert reduced.reach.decay_time(excited * [[[1.0]], [[1e-3]]]) < 0.1
    trust = reduced.simulate(held(reduced, 1.0, 0.3), "dropped").trust
    told = ("heave and pitch", "lateral motion begins earlier")
    assert trust.until < 0.5
    assert trust.reason.startswith(told)


@given(first=st.floats(0.1, 30.0), second=st.floats(0.1, 30.0), rate=st.floats(1.0, 20.0))
def test_a_start_has_settled_when_its_transient_is_as_in_training_runs(first, second, rate):
    known = replace(NOTHING_KNOWN, decaying=np.array([1.0, 0.5]))
    excited = np.array([[[-rate, 3.0], [-2.0 * rate, 0.0]], [[0.0, first], [second, 0.0]]])
    time = known.decay_time(excited)
    parts = np.exp(excited[0, :, 0] * time) * [first, second] / known.decaying
    assert parts.max() == pytest.approx(1.0) or (time == 0.0 and parts.max() <= 1.0)


def test_a_wheel_out_of_place_is_told(reduced):
    model, state = reduced.model, np.array(reduced.model.start("equilibrium"))
    assert reduced.known(state, np.zeros(len(model.inputs))).start_trust[1] < 0.1
    state[model.coordinates.index("z_RL" if "z_RL" in model.coordinates else "xi_FL")] += 0.05
    run = reduced.simulate(CARS[model.name].perturbed(1.0, 0.5), state)
    assert run.status == "untrusted"
    assert run.trust.until == 0.0
    assert "start" in run.message


def test_a_start_that_turns_is_told(reduced):
    model, maneuver = reduced.model, CARS[reduced.model.name].perturbed(1.1, 0.6)
    turning = np.array([model.start(name) for name in model.starts])
    yaw_rate = model.speeds.index("r" if "r" in model.speeds else "psi_dot")
    turning[:, len(model.coordinates) + yaw_rate] += 0.1
    amid = reduced.simulate(maneuver, "equilibrium").states[100]
    for start in (*turning, amid):
        run = reduced.simulate(maneuver, start)
        assert run.status == "untrusted"
        assert run.trust.until == 0.0
        assert "start" in run.message
