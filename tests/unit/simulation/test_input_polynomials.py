"""Inputs as piecewise polynomials equal the maneuvers that they are made from."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import values_at
from vehiclemor.inputs.maneuver import Maneuver, smooth
from vehiclemor.inputs.polynomial_loops import Pieces
from vehiclemor.inputs.polynomials import fitted_pieces
from vehiclemor.registry import component

LANE_CHANGE = component("maneuver", "lane_change")


def value(signal: Pieces, t: float) -> float:
    """The first input at one time; at a break point that after it."""
    return values_at(signal, np.array([t]))[0, 0]


def steered(signal, corners=(), duration=10.0) -> Maneuver:
    """A steering maneuver from a function of the times alone."""

    def inputs(times, frequency, amplitude):
        del frequency, amplitude
        return signal(times)[:, None]

    return Maneuver("mine", "", inputs, ("delta",), duration, 11, lambda _: corners)


@settings(max_examples=30)
@given(frequency=st.floats(0.2, 5.0), amplitude=st.floats(-4.0, 4.0))
def test_polynomials_equal_the_lane_change_at_any_time(frequency, amplitude):
    perturbed = LANE_CHANGE.perturbed(frequency, amplitude)
    signal, end = perturbed.pieces, 1.0 + 2.5 / frequency
    times = np.sort(np.random.default_rng(1).uniform(0.0, min(end + 0.1, 25.0), 40))
    # 0.03 rad: relative to that, ten digits.
    within = 3e-12 * max(abs(amplitude), 1e-6)
    np.testing.assert_allclose(values_at(signal, times), perturbed.at(times), rtol=0, atol=within)
    np.testing.assert_allclose(signal.edges, [0.0, 1.0, end, 25.0], rtol=1e-15)
    # Before and after the pulse the input is one constant.
    assert np.diff(signal.first)[[0, 2]].tolist() == [1, 1]
    assert not signal.coefficients[[0, -1]].any()


@pytest.mark.parametrize("at_jump", [0.0, 0.5, 1.0])
def test_a_jump_has_both_its_values_and_that_at_its_very_time_means_nothing(at_jump):
    step = steered(lambda t: np.where(t == 4.0, at_jump, np.where(t < 4.0, 0.0, 0.02 * t)), (4.0,))
    signal = step.pieces
    assert value(signal, 4.0 - 1e-9) == pytest.approx(0.0, abs=1e-12)
    assert value(signal, 4.0) == pytest.approx(0.08, abs=1e-11)
    # Break points may lie close together.
    close = steered(lambda t: np.where(t < 3, 0.0, np.where(t < 3 + 1e-9, 1.0, 2.0)), (3, 3 + 1e-9))
    found = values_at(close.pieces, np.array([2.0, 3 + 5e-10, 4.0]))[:, 0]
    assert found.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    "corner",
    [lambda t: np.where(t < 4.1, 0.0, 0.02), lambda t: 0.02 * np.abs(t - 4.1)],
    ids=["jump", "corner"],
)
def test_a_corner_that_has_no_name_is_refused(corner):
    with pytest.raises(InputError, match=r"'mine' is not smooth"):
        fitted_pieces(steered(corner))
    assert len(steered(corner, corners=(4.1,)).pieces.edges) == 3


PULSE = 4.4321


@pytest.mark.parametrize(
    ("signal", "corners", "duration"),
    [
        (
            lambda t: 0.02 * np.sin(np.pi * np.clip((t - 4.431) / 2e-3, 0, 1)) ** 2,
            (4.431, 4.433),
            10,
        ),
        # Between the points that a few pieces are made of, but not between the 1001 of a run.
        (lambda t: 0.02 * np.exp(-(((t - PULSE) / 0.011) ** 2)), (), 10.0),
        (lambda t: 0.02 + 0.02 * np.exp(-(((t - PULSE) / 0.011) ** 2)), (), 10.0),
        # Many periods, to the very ends.
        (lambda t: np.sin(3.0 * t), (), 1000.0),
        (lambda t: np.sin(100.0 * t), (), 10.0),
    ],
)
def test_short_pulses_and_many_periods_are_followed(signal, corners, duration):
    ends = np.concatenate([np.geomspace(1e-12, 1.0, 50), np.linspace(0.0, duration, 501)])
    times = np.sort(np.concatenate([ends, duration - ends, [PULSE]]))
    found = values_at(steered(signal, corners, duration).pieces, times)[:, 0]
    np.testing.assert_allclose(found, signal(times), rtol=0, atol=1e-11)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_number_is_refused_with_its_time(bad):
    with pytest.raises(InputError, match=r"delta .* t = 7 s"):
        fitted_pieces(steered(lambda t: np.where(t >= 7.0, bad, 0.0)))
    # Not at one of the thousand equidistant times, but where the polynomials are made.
    with pytest.raises(InputError, match="not finite"):
        fitted_pieces(steered(lambda t: np.where((t > 0.6249) & (t < 0.6251), bad, np.cos(t))))


def test_a_copy_with_another_signal_is_not_taken_for_linear():
    linear = component("maneuver", "lane_change").perturbed(1.0, 1.5)
    fixed = dataclasses.replace(linear, signal=lambda t, *_: np.sin(t)[:, None], corners=smooth)
    np.testing.assert_array_equal(fixed.recorded_inputs[1][:, 0], np.sin(fixed.times))
    found = values_at(fixed.pieces, fixed.times)[:, 0]
    np.testing.assert_allclose(found, np.sin(fixed.times), rtol=0.0, atol=1e-11)
