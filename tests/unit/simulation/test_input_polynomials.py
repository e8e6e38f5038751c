"""Inputs as piecewise polynomials equal the maneuvers that they are made from."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.python_system import python_system
from tests.unit.standard_problems import driven, maneuver
from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver, smooth
from vehiclemor.inputs.piecewise import at
from vehiclemor.inputs.sample_loops import Pieces
from vehiclemor.registry import component
from vehiclemor.simulation.input_polynomials import ACCURACY, recorded_inputs
from vehiclemor.simulation.input_polynomials import signal_of as ready_signal_of
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.system import Solver

LANE_CHANGE = component("maneuver", "lane_change")


def signal_of(maneuver: Maneuver) -> Pieces:
    return ready_signal_of(maneuver).bundle


def value(signal: Pieces, t: float, segment: int | None = None) -> np.ndarray:
    """Inputs at one time; at a break point those after it, unless a segment is given."""
    if segment is None:
        segment = int(np.searchsorted(signal.edges, t, side="right")) - 1
        segment = min(segment, len(signal.edges) - 2)
    a, b = signal.edges[segment], signal.edges[segment + 1]
    pieces = signal.coefficients[signal.first[segment] : signal.first[segment + 1]]
    place = (t - a) / (b - a) * len(pieces)
    piece = min(int(place), len(pieces) - 1)
    return np.array([np.polyval(powers[::-1], place - piece) for powers in pieces[piece]])


def steered(signal, corners=(), duration=10.0) -> Maneuver:
    """A steering maneuver from a function of the times alone."""

    def inputs(times, frequency, amplitude):
        del frequency, amplitude
        return signal(times)[:, None]

    return Maneuver("mine", "", inputs, ("delta",), duration, 11, lambda _: corners)


@settings(max_examples=30)
@given(
    frequency=st.floats(0.2, 5.0),
    amplitude=st.floats(-4.0, 4.0),
    parts=st.lists(st.floats(0.0, 1.0), min_size=40, max_size=40),
)
def test_polynomials_equal_the_lane_change_at_any_time(frequency, amplitude, parts):
    perturbed = LANE_CHANGE.perturbed(frequency, amplitude)
    signal = signal_of(perturbed)
    end = perturbed.break_points[1] + 0.1
    times = np.array(parts) * min(end, 25.0)
    found = np.array([value(signal, t) for t in times])
    # 0.03 rad: relative to that, ten digits.
    within = 3e-12 * max(abs(amplitude), 1e-6)
    np.testing.assert_allclose(found, perturbed.at(times), rtol=0, atol=within)


@given(frequency=st.floats(0.2, 5.0))
@settings(max_examples=20)
def test_segments_end_at_the_break_points_and_at_the_ends(frequency):
    perturbed = LANE_CHANGE.perturbed(frequency)
    signal = signal_of(perturbed)
    end = 1.0 + 2.5 / frequency
    np.testing.assert_allclose(signal.edges, [0.0, 1.0, end, 25.0], rtol=1e-15)
    # Before and after the pulse the input is one constant.
    pieces = np.diff(signal.first)
    assert pieces[0] == pieces[2] == 1
    assert not signal.coefficients[[0, -1]].any()


def test_break_points_outside_the_run_are_no_edges():
    late = steered(np.cos, corners=(-1.0, 0.0, 4.0, 10.0, 30.0))
    np.testing.assert_array_equal(signal_of(late).edges, [0.0, 4.0, 10.0])


@pytest.mark.parametrize("solver", ["dopri5", "etdrk4"])
def test_compiled_loops_read_the_polynomials(solver):
    man, seen = maneuver(driven, 8.0, (2.5,)), []

    def time_itself(x, u):
        seen.append((x[0], *u))
        return [1.0]

    run = python_system(time_itself, [0.0], 3).run(
        man, np.zeros(1), whole_space(1), Solver(solver, 1e-6, longest_step=0.3)
    )
    np.testing.assert_allclose(run.path[:, 0], run.times, rtol=1e-12)
    times, inputs = np.array(seen)[3:, 0], np.array(seen)[3:, 1:]
    assert len(times) > 60
    np.testing.assert_allclose(inputs, man.at(times), rtol=0, atol=1e-10)


@pytest.mark.parametrize("at_jump", [0.0, 0.5, 1.0])
def test_a_jump_has_both_its_values_and_that_at_its_very_time_means_nothing(at_jump):
    step = steered(lambda t: np.where(t == 4.0, at_jump, np.where(t < 4.0, 0.0, 0.02 * t)), (4.0,))
    signal = signal_of(step)
    assert value(signal, 4.0, segment=0) == pytest.approx([0.0], abs=1e-12)
    assert value(signal, 4.0, segment=1) == pytest.approx([0.08], abs=1e-11)
    assert value(signal, np.nextafter(4.0, 0.0)) == pytest.approx([0.0], abs=1e-12)


@pytest.mark.parametrize(
    "corner",
    [lambda t: np.where(t < 4.1, 0.0, 0.02), lambda t: 0.02 * np.abs(t - 4.1)],
    ids=["jump", "corner"],
)
def test_a_corner_that_has_no_name_is_refused(corner):
    with pytest.raises(InputError, match=r"'mine' is not smooth"):
        signal_of(steered(corner))
    assert len(signal_of(steered(corner, corners=(4.1,))).edges) == 3


@pytest.mark.parametrize("at", [4.1, 4.1001, 4.2, 5.0])
def test_a_corner_of_the_curvature_is_refused_or_followed(at):
    bent = steered(lambda t: np.clip(t - at, 0.0, None) ** 2)
    try:
        signal = signal_of(bent)
    except InputError:
        return
    times = at + np.linspace(-2e-3, 2e-3, 4001)
    found = np.array([value(signal, t) for t in times])
    # As exact as a smooth input: 1e-11 of its largest value.
    np.testing.assert_allclose(found, bent.at(times), rtol=0, atol=2e-11 * (10.0 - at) ** 2)


def test_a_short_pulse_between_named_corners_is_accepted():
    def pulse(times):
        return 0.02 * np.sin(np.pi * np.clip((times - 3.001) / 0.002, 0.0, 1.0)) ** 2

    signal = signal_of(steered(pulse, corners=(3.001, 3.003)))
    assert value(signal, 3.0022) == pytest.approx(pulse(np.array([3.0022])), abs=1e-12)


@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_a_short_pulse_without_a_name_is_followed_where_a_probe_meets_it(offset):
    """Between the points that a few pieces are made of, but not between the 1001 of a run."""
    pulse = steered(lambda t: offset + 0.02 * np.exp(-(((t - 4.4321) / 0.011) ** 2)))
    found = value(signal_of(pulse), 4.4321)
    assert found == pytest.approx([offset + 0.02], abs=1e-11)


@pytest.mark.parametrize(("rate", "duration"), [(3.0, 1000.0), (100.0, 10.0)])
def test_many_periods_are_followed_to_the_very_ends(rate, duration):
    signal = signal_of(steered(lambda t: np.sin(rate * t), duration=duration))
    times = np.concatenate([np.geomspace(1e-12, 1.0, 50), np.linspace(0.0, duration, 501)])
    for t in (*times, *(duration - times)):
        assert value(signal, t) == pytest.approx([np.sin(rate * t)], abs=1e-11)


def test_break_points_may_lie_close_together():
    step = steered(lambda t: np.where(t < 3, 0.0, np.where(t < 3 + 1e-9, 1.0, 2.0)), (3, 3 + 1e-9))
    assert [float(value(signal_of(step), t)[0]) for t in (2.0, 3 + 5e-10, 4.0)] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_number_is_refused_with_its_time(bad):
    with pytest.raises(InputError, match=r"delta .* t = 7 s"):
        signal_of(steered(lambda t: np.where(t >= 7.0, bad, 0.0)))
    # Not at one of the thousand equidistant times, but where the polynomials are made.
    with pytest.raises(InputError, match="not finite"):
        signal_of(steered(lambda t: np.where((t > 0.6249) & (t < 0.6251), bad, np.cos(t))))


def test_a_maneuver_that_is_linear_in_its_amplitude_is_searched_once():
    calls = []

    def inputs(times, frequency, amplitude):
        calls.append(amplitude)
        return (amplitude * np.sin(frequency * times))[:, None]

    linear = Maneuver("mine", "", inputs, ("u",), 3.0, 11, smooth, linear_in_amplitude=True)
    general = dataclasses.replace(linear, linear_in_amplitude=False)
    for frequency in (1.0, 2.0):
        signal_of(linear.perturbed(frequency, 3.0))
        calls.clear()
        scaled = signal_of(linear.perturbed(frequency, -0.7))
        assert not calls
        searched = signal_of(general.perturbed(frequency, -0.7))
        assert set(calls) == {-0.7}
        np.testing.assert_array_equal(scaled.edges, searched.edges)
        times = np.linspace(0.0, 3.0, 997)
        found, wanted = (at(signal, times) for signal in (scaled, searched))
        # Both round off in the powers of the pieces, far below the accuracy of these.
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=0.1 * ACCURACY)


def test_a_copy_with_another_signal_is_not_taken_for_linear():
    linear = component("maneuver", "lane_change").perturbed(1.0, 1.5)
    fixed = dataclasses.replace(linear, signal=lambda t, *_: np.sin(t)[:, None], corners=smooth)
    np.testing.assert_array_equal(recorded_inputs(fixed)[1][:, 0], np.sin(fixed.times))
    found = at(signal_of(fixed), fixed.times)[:, 0]
    np.testing.assert_allclose(found, np.sin(fixed.times), rtol=0.0, atol=1e-11)
