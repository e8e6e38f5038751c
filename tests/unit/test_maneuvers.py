"""Maneuvers give the inputs that they describe, and refuse factors that make no sense."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component, names
from vehiclemor.simulation.maneuver_checks import check_resolved

factors, amplitudes = st.floats(0.1, 4.0), st.floats(-3.0, 3.0)


@pytest.mark.parametrize("name", names("maneuver"))
def test_every_maneuver_is_finite_scales_and_breaks_inside_its_run(name: str) -> None:
    maneuver = component("maneuver", name)
    assert maneuver == maneuver.perturbed(np.float32(1.0), np.int64(1))
    assert (maneuver.name, maneuver.linear_in_amplitude) == (name, True)
    for frequency in (1.0, 0.8, 2.0):
        perturbed = maneuver.perturbed(frequency)
        times, points = perturbed.times, perturbed.break_points
        assert (times[0], times[-1], len(times)) == (0.0, maneuver.duration, maneuver.samples)
        inputs = perturbed.at(times)
        assert inputs.shape == (len(times), len(maneuver.inputs))
        assert np.isfinite(inputs).all()
        # A value depends on its time alone.
        np.testing.assert_array_equal(perturbed.at(times[7:9]), inputs[7:9])
        scaled = maneuver.perturbed(frequency, -1.5).at(times)
        np.testing.assert_allclose(scaled, -1.5 * inputs, rtol=1e-14, atol=1e-16)
        assert not maneuver.perturbed(frequency, 0.0).at(times).any()
        assert list(points) == sorted(points)
        assert all(0.0 < point < maneuver.duration for point in points)


def test_sine_travel_is_the_papers_input(nominal: Maneuver) -> None:
    times = nominal.times
    assert (len(times), times[0], times[-1]) == (1001, 0.0, 10.0)
    inputs = nominal.at(times)
    assert inputs[:, 0] == pytest.approx(0.1 * np.sin(2 * np.pi * 0.1 * times), abs=1e-16)
    assert not inputs[:, 1].any()
    assert nominal.inputs == ("z", "s0")


@settings(max_examples=30)
@given(frequency=factors, amplitude=amplitudes)
@pytest.mark.parametrize("name", ["sine_travel", "travel_and_rack", "travel_and_rack_multisine"])
def test_factors_scale_time_and_values_and_do_not_pile_up(name, frequency, amplitude):
    nominal = component("maneuver", name)
    perturbed, times = nominal.perturbed(3.0, 3.0).perturbed(frequency, amplitude), nominal.times
    assert perturbed == nominal.perturbed(frequency, amplitude)
    assert perturbed.perturbed() == nominal
    expected = amplitude * nominal.at(frequency * times)
    np.testing.assert_allclose(perturbed.at(times), expected, rtol=0, atol=1e-14)
    # The run's length and its output times stay.
    np.testing.assert_array_equal(perturbed.times, times)


def crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which a signal changes its sign, its ends apart."""
    return times[np.flatnonzero(np.diff(np.sign(values[1:-1])))]


def test_sweeps_go_from_their_first_to_their_last_frequency() -> None:
    chirp, sweep = (component("maneuver", n) for n in ("chirp_travel", "travel_and_rack_sweep"))
    times = np.linspace(0.0, 10.0, 100001)
    # Hz, first and last, and zeros at each half turn of their mean over 10 s.
    for travel, largest, first, last, zeros in (
        (chirp.at(times)[:, 0], 0.1, 0.1, 0.4, 4),
        (sweep.at(times)[:, 0], 0.1, 0.1, 0.4, 4),
        (sweep.at(times)[:, 1], 0.03, 0.5, 0.1618034, 6),
    ):
        assert np.abs(travel).max() == pytest.approx(largest, rel=1e-6)
        found = crossings(times, travel)
        assert len(found) == zeros
        assert np.all(np.diff(found, 2) * (last - first) < 0.0)
        rate = 2.0 * np.pi * largest * first
        assert np.gradient(travel, times)[0] == pytest.approx(rate, rel=1e-3)
    assert abs(np.gradient(chirp.at(times)[:, 0], times)[-1]) == pytest.approx(
        2.0 * np.pi * 0.1 * 0.4, rel=1e-3
    )


# Travel with a rack that moves

TWO_WAY = ("travel_and_rack", "travel_and_rack_sweep", "travel_and_rack_multisine")


@pytest.mark.parametrize("name", TWO_WAY)
@settings(max_examples=20)
@given(frequency=st.floats(0.7, 1.8), amplitude=st.floats(-1.15, 1.15))
def test_travel_and_rack_stay_within_their_rectangle(
    name: str, frequency: float, amplitude: float
) -> None:
    maneuver = component("maneuver", name).perturbed(frequency, amplitude)
    largest = np.abs(maneuver.at(maneuver.times)).max(axis=0)
    assert np.all(largest <= abs(amplitude) * np.array([0.1, 0.03]) * (1.0 + 1e-12))
    check_resolved(maneuver)


def test_travel_and_rack_take_every_side_of_each_other_and_never_repeat() -> None:
    for name in TWO_WAY:
        inputs = component("maneuver", name).at(np.linspace(0.0, 10.0, 1001))
        sides = {tuple(row) for row in np.sign(inputs[np.all(inputs != 0.0, axis=1)]).tolist()}
        assert len(sides) == 4
        # Not along a line.
        assert abs(np.corrcoef(inputs.T)[0, 1]) < 0.4
    # Spectral lines in the golden ratio: no common period.
    sines = component("maneuver", "travel_and_rack").at(np.linspace(0.0, 1000.0, 100001)[:-1])
    lines = np.abs(np.fft.rfft(sines, axis=0)).argmax(axis=0) / 1000.0
    assert lines == pytest.approx([0.1, 0.1618], abs=1e-3)


# Pulses of the steering rack


def rack_pulse(frequency: float = 1.0, amplitude: float = 1.0) -> Maneuver:
    return component("maneuver", "rack_lane_change").perturbed(frequency, amplitude)


def spectral_derivative(values: np.ndarray, period: float) -> np.ndarray:
    """Derivative of equidistant values of a periodic function with few harmonics: exact."""
    n = len(values)
    rates = 2j * np.pi * np.fft.fftfreq(n, period / n)
    return np.fft.ifft(rates * np.fft.fft(values)).real


@settings(max_examples=30)
@given(frequency=factors, amplitude=amplitudes)
def test_rack_speed_and_acceleration_are_derivatives_of_its_place(
    frequency: float, amplitude: float
) -> None:
    pulse = rack_pulse(frequency, amplitude)
    begin, end = pulse.break_points
    times = np.linspace(begin, end, 33)[:-1]
    place, speed, acceleration = pulse.at(times).T
    rate = 2.0 * np.pi / (end - begin)
    # The pulse has two harmonics; its values are of the order of the amplitude.
    scale = 0.0047 * max(abs(amplitude), 1e-6)
    close = {"rtol": 0.0, "atol": 1e-12 * scale * rate}
    np.testing.assert_allclose(spectral_derivative(place, end - begin), speed, **close)
    # Where it begins, the pulse's acceleration is zero, as the periodic function's.
    close["atol"] *= rate
    np.testing.assert_allclose(spectral_derivative(speed, end - begin), acceleration, **close)


@settings(max_examples=30)
@given(frequency=factors, amplitude=amplitudes)
def test_the_rack_pulse_is_as_described_and_has_no_corner(
    frequency: float, amplitude: float
) -> None:
    pulse = rack_pulse(frequency, amplitude)
    assert (pulse.duration, len(pulse.times), pulse.inputs) == (10.0, 501, ("s", "s_dot", "s_ddot"))
    assert pulse.break_points == (1.0, pytest.approx(1.0 + 2.5 / frequency))
    begin, end = pulse.break_points
    place = pulse.at(np.linspace(begin, end, 3001))[:, 0]
    # sin x - sin(2 x) / 2 = sin x (1 - cos x) is largest at a third of the turn.  A positive
    # displacement steers to the right: the lane change to the left begins negative.
    highest = 0.0046903 * 0.75 * np.sqrt(3.0)
    assert place[1000] == pytest.approx(-amplitude * highest, abs=1e-15)
    assert np.abs(place).max() == pytest.approx(abs(amplitude) * highest, abs=1e-15)
    # To the one side and then to the other, by the same amount.
    np.testing.assert_allclose(place[::-1], -place, rtol=0, atol=1e-15)
    step = 1e-7
    rest = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(end + step, end + 9.0, 50)])
    np.testing.assert_array_equal(pulse.at(rest), 0.0)
    # Inside the place grows with the third power of time: its third derivative alone jumps.
    third = 0.0046903 * 3.0 * (2.0 * np.pi * frequency / 2.5) ** 3
    near = pulse.at(np.array([begin + step, end - step]))
    powers = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0]]) * [step**3 / 6.0, step**2 / 2.0, step]
    # The corner's time is rounded, and so is the pulse itself where it is next to nothing.
    expected = -amplitude * third * powers
    np.testing.assert_allclose(near[:, 1:], expected[:, 1:], rtol=1e-5, atol=3e-12)
    np.testing.assert_allclose(near[:, 0], expected[:, 0], rtol=0, atol=3e-17)


def test_a_rack_that_is_held_does_not_move() -> None:
    held = component("maneuver", "rack_straight_ahead").perturbed(2.0, 3.0)
    assert (held.inputs, held.break_points) == (rack_pulse().inputs, ())
    np.testing.assert_array_equal(held.at(held.times), np.zeros((501, 3)))
