"""Maneuvers give the inputs that they describe, and refuse factors that make no sense."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import vehiclemor as vm
from tests.models import CAR
from vehiclemor.inputs.checks import check_resolved
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.registry import names

factors, amplitudes = st.floats(0.1, 4.0), st.floats(-3.0, 3.0)


@pytest.mark.parametrize("name", names("maneuver"))
def test_every_maneuver_is_finite_scales_and_breaks_inside_its_run(name):
    maneuver = vm.maneuver(name)
    assert maneuver == maneuver.perturbed(np.float32(1.0), np.int64(1))
    assert maneuver.name == name
    linear = not name.endswith(("_in_turn", "split_friction", "random_drive"))
    assert maneuver.linear_in_amplitude == linear
    for frequency in (1.0, 0.8, 2.0):
        perturbed = vm.maneuver(name, frequency=frequency)
        times, points = perturbed.times, perturbed.break_points
        assert (times[0], times[-1], len(times)) == (0.0, maneuver.duration, maneuver.samples)
        inputs = perturbed.at(times)
        assert inputs.shape == (len(times), len(maneuver.inputs))
        assert np.isfinite(inputs).all()
        # A value depends on its time alone.
        np.testing.assert_array_equal(perturbed.at(times[7:9]), inputs[7:9])
        if linear:
            scaled = maneuver.perturbed(frequency, -1.5).at(times)
            np.testing.assert_allclose(scaled, -1.5 * inputs, rtol=1e-14, atol=1e-16)
            assert not maneuver.perturbed(frequency, 0.0).at(times).any()
        assert list(points) == sorted(points)
        assert all(0.0 < point < maneuver.duration for point in points)
        assert "straight_ahead" not in name or not (inputs.any() or points)


def test_sine_travel_is_the_papers_input(nominal):
    times = nominal.times
    assert (len(times), times[0], times[-1], nominal.inputs) == (1001, 0.0, 10.0, ("z", "s0"))
    inputs = nominal.at(times)
    assert inputs[:, 0] == pytest.approx(0.1 * np.sin(2 * np.pi * 0.1 * times), abs=1e-16)
    assert not inputs[:, 1].any()


@settings(max_examples=30)
@given(frequency=factors, amplitude=amplitudes)
@example(frequency=3.516026232433491, amplitude=-2.7134626451811217)
@pytest.mark.parametrize("name", ["sine_travel", "travel_and_rack", "travel_and_rack_multisine"])
def test_factors_scale_time_and_values_and_do_not_pile_up(name, frequency, amplitude):
    nominal = vm.maneuver(name)
    perturbed, times = nominal.perturbed(3.0, 3.0).perturbed(frequency, amplitude), nominal.times
    assert perturbed == nominal.perturbed(frequency, amplitude)
    assert perturbed.perturbed() == nominal
    expected = amplitude * nominal.at(frequency * times)
    # Factors and time are rounded differently: by a few digits of the largest phase (rad).
    phase = 2.0 * np.pi * 1.4 * frequency * times[-1]
    rounding = 4.0 * np.finfo(float).eps * phase * 0.1 * abs(amplitude)
    np.testing.assert_allclose(perturbed.at(times), expected, rtol=0, atol=rounding + 1e-16)
    # The run's length and its output times stay.
    np.testing.assert_array_equal(perturbed.times, times)


def test_sweeps_go_from_their_first_to_their_last_frequency():
    times = np.linspace(0.0, 10.0, 100001)
    chirp, sweep = (vm.maneuver(n).at(times) for n in ("chirp_travel", "travel_and_rack_sweep"))
    # Hz, first and last, and zeros at each half turn of their mean over 10 s.
    for travel, largest, first, last, zeros in (
        (chirp[:, 0], 0.1, 0.1, 0.4, 4),
        (sweep[:, 0], 0.1, 0.1, 0.4, 4),
        (sweep[:, 1], 0.03, 0.5, 0.1618034, 6),
    ):
        assert np.abs(travel).max() == pytest.approx(largest, rel=1e-6)
        found = times[np.flatnonzero(np.diff(np.sign(travel[1:-1])))]
        assert len(found) == zeros
        assert np.all(np.diff(found, 2) * (last - first) < 0.0)
        rate = 2.0 * np.pi * largest * first
        assert np.gradient(travel, times)[0] == pytest.approx(rate, rel=1e-3)
    last = abs(np.gradient(chirp[:, 0], times)[-1])
    assert last == pytest.approx(2.0 * np.pi * 0.1 * 0.4, rel=1e-3)


@pytest.mark.parametrize("name", [n for n in names("maneuver") if n.startswith("travel_and_rack")])
def test_travel_and_rack_take_every_side_of_each_other_within_their_rectangle(name):
    for frequency, amplitude in ((1.0, 1.0), (0.7, -1.15), (1.8, 1.15)):
        maneuver = vm.maneuver(name, frequency=frequency, amplitude=amplitude)
        largest = np.abs(maneuver.at(maneuver.times)).max(axis=0)
        assert np.all(largest <= abs(amplitude) * np.array([0.1, 0.03]) * (1.0 + 1e-12))
        check_resolved(maneuver)
    inputs = vm.maneuver(name).at(np.linspace(0.0, 10.0, 1001))
    sides = {tuple(row) for row in np.sign(inputs[np.all(inputs != 0.0, axis=1)]).tolist()}
    assert len(sides) == 4
    # Not along a line.
    assert abs(np.corrcoef(inputs.T)[0, 1]) < 0.4


@settings(max_examples=30)
@given(frequency=factors, amplitude=amplitudes)
def test_the_rack_pulse_is_as_described_and_has_no_corner(frequency, amplitude):
    pulse = vm.maneuver("rack_lane_change", frequency=frequency, amplitude=amplitude)
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
    # Speed and acceleration vanish at its ends as those of a smooth curve do.
    third = 0.0046903 * 3.0 * (2.0 * np.pi * frequency / 2.5) ** 3
    near = np.abs(pulse.at(np.array([begin + step, end - step]))[:, 1:])
    expected = abs(amplitude) * third * np.array([step**2 / 2.0, step])
    np.testing.assert_allclose(near, [expected, expected], rtol=1e-5, atol=3e-12)


SHAPES = ["lane_change", "step_steer", "sine_sweep", "multisine", "slow_ramp_steer", "weave"]


@pytest.mark.parametrize("shape", [*SHAPES, "sine_with_dwell", "random_steer:7"])
def test_racks_move_as_they_say(shape):
    rack, steering = vm.maneuver(f"rack_{shape}"), vm.maneuver(shape)
    times = np.linspace(0.0, rack.duration, 20001)
    place, speed, acceleration = rack.at(times).T
    for lower, higher in ((place, speed), (speed, acceleration)):
        wanted = np.gradient(lower, times)[5:-5]
        np.testing.assert_allclose(higher[5:-5], wanted, atol=5e-3 * np.abs(higher).max())
    wanted = -0.0046903 / 0.0300768 * steering.at(times)[:, 0]
    np.testing.assert_allclose(place, wanted, rtol=1e-12)


def test_sine_with_dwell_is_that_of_the_standard():
    steer = vm.maneuver("sine_with_dwell")
    period = 1.0 / 0.7
    largest = np.abs(steer.at(steer.times)).max()

    def at(*times: float) -> np.ndarray:
        return steer.at(1.0 + np.array(times))[:, 0] / largest

    # A sine of 0.7 Hz, held for half a second from its second peak on.
    quarter = np.linspace(0.06, 0.7 * period, 50)
    assert at(*quarter) == pytest.approx(np.sin(2.0 * np.pi * 0.7 * quarter), abs=1e-9)
    assert at(*np.linspace(0.75 * period + 0.06, 0.75 * period + 0.44, 9)) == pytest.approx(-1.0)
    last = np.linspace(0.8 * period, period - 0.06, 20)
    assert at(*(last + 0.5)) == pytest.approx(np.sin(2.0 * np.pi * 0.7 * last), abs=1e-9)
    assert at(-0.06, period + 0.56, 4.9) == pytest.approx(0.0, abs=1e-12)


def columns(maneuver, times):
    return dict(zip(maneuver.inputs, maneuver.at(times).T, strict=True))


def test_torques_give_the_acceleration_that_is_asked_for():
    model = vm.model(CAR)
    p = model.parameters.values()
    mass, brakes = p["sprung_mass"] + 4 * p["unsprung_mass"], vm.maneuver("straight_braking")
    torque = columns(brakes, np.array([0.9, 3.0]))
    assert not any(each[0] for each in torque.values())
    assert sum(each[1] for each in torque.values()) == pytest.approx(mass * 0.327 * 2.943, rel=1e-3)
    front = torque["brake_torque_FL"][1] / torque["brake_torque_RL"][1]
    assert front == pytest.approx(0.66 / 0.34)
    speed = model.simulate(brakes).chosen("longitudinal_speed", [2.0, 4.0]).outputs[:, 0]
    # The brakes stop the spin of the wheels too.
    share = mass / (mass + 4.0 * p["spin_inertia"] / 0.327**2)
    assert (speed[0] - speed[1]) / 2.0 == pytest.approx(0.3 * 9.81 * share, rel=0.01)
    turn = vm.maneuver("power_in_turn", amplitude=2.0)
    drive = columns(turn, np.array([5.0]))
    assert drive["drive_torque_RR"] == pytest.approx(mass * 0.327 * 0.4 * 9.81 / 2.0, rel=1e-3)
    held = vm.maneuver("braking_in_turn", amplitude=2.0)
    assert columns(held, np.array([5.0]))["delta"] == drive["delta"]


def test_the_bump_passes_the_rear_wheel_a_wheelbase_later():
    times = np.linspace(0.0, 4.0, 40001)
    road = columns(vm.maneuver("bump", frequency=0.5), times)
    front, rear = road["road_FL"], road["road_RL"]
    assert front.max() == pytest.approx(0.02, rel=1e-6)
    assert np.ptp(times[front > 0.0]) == pytest.approx(2.4 / 10.0, abs=1e-3)
    assert times[rear.argmax()] - times[front.argmax()] == pytest.approx(2.58 / 10.0, abs=1e-3)
    for wheel in ("FL", "RL"):
        rate = np.gradient(road[f"road_{wheel}"], times)
        np.testing.assert_allclose(road[f"road_{wheel}_dot"], rate, atol=1e-3)


def test_random_driving_stays_below_lock_up_and_follows_the_friction():
    frictions = []
    for seed in range(20):
        driven = vm.maneuver(f"random_drive:{seed}")
        check_resolved(driven.perturbed(0.9))
        inputs = columns(driven, driven.times)
        friction = inputs["friction_RR"][0]
        frictions.append(friction)
        steering = vm.maneuver(f"random_steer:{seed}").at(driven.times)[:, 0]
        np.testing.assert_allclose(inputs["delta"], friction * steering)
        drive, brakes = (
            np.sum([inputs[f"{torque}_torque_{wheel}"] for wheel in WHEELS], axis=0)
            for torque in ("drive", "brake")
        )
        assert not (drive * brakes).any()
        # MASS and RADIUS of the car: at most 3 m/s^2 on a road of friction 1.
        assert 0.0 <= brakes.min() <= brakes.max() <= friction * 1093.3 * 0.327 * 3.0
        run = vm.model(CAR).simulate(driven)
        slips = [run[f"slip_ratio_{wheel}"] for wheel in WHEELS]
        assert (run.status, np.abs(slips).max() < 0.1) == ("ok", True)
    assert 0.4 <= min(frictions) < 0.5
    assert 0.9 < max(frictions) <= 1.0
