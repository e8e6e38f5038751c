"""Maneuvers give the inputs that they describe, and refuse factors that make no sense."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.errors import InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.registry import component

factors = st.floats(0.1, 4.0)


def test_sine_travel_is_the_papers_input(nominal: Maneuver) -> None:
    times = nominal.times
    assert (len(times), times[0], times[-1]) == (1001, 0.0, 10.0)
    inputs = nominal.at(times)
    assert inputs[:, 0] == pytest.approx(0.1 * np.sin(2 * np.pi * 0.1 * times), abs=1e-16)
    assert not inputs[:, 1].any()
    assert nominal.inputs == ("z", "s0")


@given(frequency=factors, amplitude=st.floats(-3.0, 3.0))
def test_factors_scale_frequency_and_amplitude(
    nominal: Maneuver, frequency: float, amplitude: float
) -> None:
    perturbed = nominal.perturbed(frequency, amplitude)
    times = nominal.times
    expected = amplitude * nominal.at(frequency * times)[:, 0]
    assert perturbed.at(times)[:, 0] == pytest.approx(expected, abs=1e-14)
    # The run's length and its output times stay.
    np.testing.assert_array_equal(perturbed.times, times)


@given(frequency=factors, amplitude=st.floats(0.1, 3.0))
def test_factors_are_set_and_do_not_pile_up(
    nominal: Maneuver, frequency: float, amplitude: float
) -> None:
    twice = nominal.perturbed(3.0, 3.0).perturbed(frequency, amplitude)
    assert twice == nominal.perturbed(frequency, amplitude)
    assert nominal.perturbed(frequency, amplitude).perturbed() == nominal.perturbed()
    assert (nominal.frequency_factor, nominal.amplitude_factor) == (1.0, 1.0)


def test_chirp_sweeps_from_its_first_to_its_last_frequency() -> None:
    chirp = component("maneuver", "chirp_travel")
    times = np.linspace(0.0, chirp.duration, 100001)
    travel = chirp.at(times)[:, 0]
    assert np.abs(travel).max() == pytest.approx(0.1, rel=1e-6)
    # 0.25 Hz on average for 10 s: five half waves, each shorter than the one before.
    crossings = times[np.flatnonzero(np.diff(np.sign(travel[1:-1])))]
    assert len(crossings) == 4
    assert np.all(np.diff(crossings, 2) < 0.0)
    slopes = np.abs(np.gradient(travel, times)[[0, -1]])
    assert slopes == pytest.approx(0.1 * 2 * np.pi * np.array([0.1, 0.4]), rel=1e-3)


@pytest.mark.parametrize(
    ("given_factors", "message"),
    [
        ({"frequency": 0.0}, "frequency factor: 0 is not positive"),
        ({"frequency": -1.0}, "frequency factor: -1 is not positive"),
        ({"frequency": float("nan")}, "frequency factor: nan is not finite"),
        ({"amplitude": float("inf")}, "amplitude factor: inf is not finite"),
        ({"amplitude": "1.2"}, "amplitude factor: '1.2' is not a number"),
        ({"frequency": True}, "frequency factor: True is not a number"),
        ({"amplitude": None}, "amplitude factor: None is not a number"),
    ],
)
def test_wrong_factor_is_one_line(nominal: Maneuver, given_factors: dict, message: str) -> None:
    with pytest.raises(InputError) as error:
        nominal.perturbed(**given_factors)
    assert str(error.value) == message


def test_numpy_numbers_are_numbers(nominal: Maneuver) -> None:
    assert nominal.perturbed(np.float32(2.0), np.int64(1)) == nominal.perturbed(2.0, 1.0)


def test_break_points_follow_the_frequency() -> None:
    corners = Maneuver(
        "pulse", "", lambda t, *_: t[:, None], ("z",), 4.0, 5, lambda f: (1.0 / f, 2.0 / f)
    )
    assert corners.break_points == (1.0, 2.0)
    assert corners.perturbed(frequency=2.0).break_points == (0.5, 1.0)
