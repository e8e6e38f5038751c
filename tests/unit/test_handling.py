"""Numbers of handling tests, on a linear single-track model and on signals of known answers."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import lsim

import vehiclemor as vm
from tests.models import CAR, FIDELITY, WISHBONE
from tests.refusing import refused
from vehiclemor.simulation.trajectory import Trajectory

# A single-track model: mass, yaw inertia, axle distances, axle stiffnesses, speed, roll by
# acceleration; x' = STATE x + STEER delta of lateral speed and yaw rate.
M, IZ, A, B, CF, CR, V, ROLL = 1500.0, 2500.0, 1.2, 1.5, 80e3, 110e3, 22.0, 0.02
L = A + B
MOMENT = A * CF - B * CR
STATE = np.array(
    [
        [-(CF + CR) / (M * V), -V - MOMENT / (M * V)],
        [-MOMENT / (IZ * V), -(A**2 * CF + B**2 * CR) / (IZ * V)],
    ]
)
STEER = np.array([[CF / M], [A * CF / IZ]])
UNDERSTEER = M / L * (B / CF - A / CR)
TIMES = np.linspace(0.0, 6.0, 301)
ONES = np.ones(len(TIMES))


def run_of(times, driven, maneuver, inputs=("delta",), **signals):
    """A run of signals; what is not among them is that of a car driving straight ahead at V."""
    columns = dict.fromkeys(("lateral_position", "yaw", "roll", "lateral_speed", "yaw_rate"), 0.0)
    columns |= {"longitudinal_position": V * times, "longitudinal_speed": V} | signals
    outputs = np.column_stack([np.broadcast_to(each, len(times)) for each in columns.values()])
    names, nothing = tuple(columns), np.zeros((len(times), 0))
    model = SimpleNamespace(
        inputs=inputs,
        outputs=names,
        parameters=SimpleNamespace(values=dict),
        definition=SimpleNamespace(wheelbase=lambda _: L),
    )
    histories = driven[:, None], nothing, nothing, outputs
    fields = {"names": names, "model": model, "maneuver": maneuver}
    return Trajectory(times, *histories, {}, 0.0, **fields)


def single_track(name):
    """The linear model steered by a maneuver, recorded at its output times."""
    maneuver = vm.maneuver(name)
    times = np.linspace(0.0, maneuver.duration, 100 * (maneuver.samples - 1) + 1)
    steering = maneuver.at(times)[:, 0]
    system = STATE, STEER, np.eye(2), np.zeros((2, 1))
    lateral, yaw_rate = lsim(system, steering, times)[1].T
    acceleration = STATE[0] @ [lateral, yaw_rate] + STEER[0] * steering + V * yaw_rate
    signals = {"lateral_speed": lateral, "yaw_rate": yaw_rate, "roll": ROLL * acceleration}
    recorded = {key: signal[::100] for key, signal in signals.items()}
    return run_of(times[::100], steering[::100], name, **recorded)


def response(hertz):
    """Yaw rate and lateral acceleration of the linear model over the steering angle."""
    s = 2j * np.pi * hertz
    lateral, yaw_rate = np.linalg.solve(s * np.eye(2) - STATE, STEER)[:, 0]
    return {"yaw_rate": yaw_rate, "lateral_acceleration": s * lateral + V * yaw_rate}


def test_gradients_of_a_slow_ramp_are_those_of_the_axles():
    numbers = vm.metrics(single_track("slow_ramp_steer"))
    assert numbers["understeer_gradient"] == pytest.approx(UNDERSTEER, rel=0.01)
    assert numbers["roll_gradient"] == pytest.approx(ROLL, rel=1e-6)
    assert numbers["sideslip_gradient"] == pytest.approx(B / V**2 - M * A / (L * CR), rel=0.01)
    assert numbers["speed"] == V
    assert numbers["understeer_gradient"].attrs["units"] == "rad s^2/m"
    assert numbers["understeer_gradient"].attrs["standard"] == "ISO 4138"


def test_a_step_is_answered_as_a_damped_oscillation_does():
    damping, turning = 0.4, 5.0
    damped = turning * np.sqrt(1.0 - damping**2)

    def answer(time):
        decay = np.exp(-damping * turning * time)
        sine = damping * turning / damped * np.sin(damped * time)
        return np.where(time > 0.0, 1.0 - decay * (np.cos(damped * time) + sine), 0.0)

    steering = np.interp(TIMES, [1.0, 1.2], [0.0, 0.02])
    # The car drives on a line that turns without slip: a = r u.
    run = run_of(TIMES, steering, "step_steer", yaw_rate=0.1 * answer(TIMES - 1.1))
    numbers = vm.metrics(run)
    rise = brentq(lambda time: answer(time) - 0.9, 1e-3, 1.0)
    assert numbers["yaw_rate_gain"] == pytest.approx(5.0, rel=1e-3)
    assert numbers["yaw_rate_response_time"] == pytest.approx(rise, abs=2e-3)
    assert numbers["lateral_acceleration_response_time"] == pytest.approx(rise, abs=2e-3)
    assert numbers["yaw_rate_peak_time"] == pytest.approx(np.pi / damped, abs=0.011)
    overshoot = np.exp(-damping * np.pi / np.sqrt(1.0 - damping**2))
    assert numbers["yaw_rate_overshoot"] == pytest.approx(overshoot, abs=2e-3)


def test_a_sweep_gives_gain_and_phase_of_the_linear_model():
    numbers = vm.metrics(single_track("sine_sweep"))
    for hertz in (0.4, 0.8, 1.2):
        at = numbers.sel(frequency=hertz, method="nearest")
        for name, exact in response(hertz).items():
            assert at[f"{name}_gain"] == pytest.approx(abs(exact), rel=0.01)
            assert at[f"{name}_phase"] == pytest.approx(np.angle(exact), abs=0.01)


def test_a_weave_gives_the_slope_and_the_width_of_the_ellipse():
    numbers = vm.metrics(single_track("weave"))
    largest = np.abs(vm.maneuver("weave").at(np.linspace(3.0, 9.0, 6001))).max()
    for name, exact in response(0.2).items():
        lag = -np.angle(exact)
        assert numbers[f"{name}_gain"] == pytest.approx(abs(exact) * np.cos(lag), rel=0.01)
        width = 2.0 * largest * np.sin(lag)
        assert numbers[f"{name}_hysteresis"] == pytest.approx(width, rel=0.01)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_sine_with_dwell_is_judged_at_the_times_of_the_standard(side):
    maneuver = vm.maneuver("sine_with_dwell", amplitude=side)
    steering, end = maneuver.at(TIMES)[:, 0], 1.0 + 1.0 / 0.7 + 0.5
    late = np.maximum(TIMES - end, 0.0)
    reversed_since = 1.0 + 0.5 / 0.7
    yaw_rate = np.where(reversed_since < TIMES, -0.5 * np.exp(-late / 0.8), 0.7)
    heading, aside = 0.3, 0.5 * 4.0 * np.maximum(TIMES - 1.0, 0.0) ** 2
    position = V * TIMES + 1j * side * aside
    turned = position * np.exp(1j * heading)
    path = {"longitudinal_position": turned.real, "lateral_position": turned.imag, "yaw": heading}
    run = run_of(TIMES, steering, "sine_with_dwell", yaw_rate=side * yaw_rate, **path)
    numbers = vm.metrics(run)
    # Steering begins and ends where it passes 5 % of its largest value: by 15 ms.
    assert numbers["early_yaw_rate_ratio"] == pytest.approx(np.exp(-1.0 / 0.8), rel=0.02)
    assert numbers["late_yaw_rate_ratio"] == pytest.approx(np.exp(-1.75 / 0.8), rel=0.02)
    assert numbers["lateral_displacement"] == pytest.approx(0.5 * 4.0 * 1.07**2, rel=0.03)


def braked(maneuver, begin, **signals):
    torque = 100.0 * (begin + 1e-6 < TIMES)
    return vm.metrics(run_of(TIMES, torque, maneuver, ("brake_torque_FL",), **signals))


def test_straight_braking_takes_the_distance_of_a_constant_deceleration():
    late = np.maximum(TIMES - 1.0, 0.0)
    x = V * TIMES - 0.5 * 3.0 * late**2
    speeds = {"longitudinal_position": x, "longitudinal_speed": V - 3.0 * late}
    numbers = braked("straight_braking", 1.0, **speeds)
    assert numbers["distance"] == pytest.approx(V * 5.0 - 0.5 * 3.0 * 5.0**2, rel=1e-6)
    assert numbers["mean_deceleration"] == pytest.approx(3.0, rel=1e-6)
    assert numbers["final_speed"] == pytest.approx(V - 15.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_braking_in_a_turn_is_compared_with_the_circle_that_would_go_on(side):
    late, radius = np.maximum(TIMES - 3.0, 0.0), 100.0
    # A circle until the brakes act, then the tangent: so the car leaves the circle outwards.
    path = V * TIMES - 0.5 * 4.0 * late**2
    angle = V * np.minimum(TIMES, 3.0) / radius
    straight = np.maximum(path - 3.0 * V, 0.0)
    x = radius * np.sin(angle) + straight * np.cos(angle)
    y = side * (radius * (1.0 - np.cos(angle)) + straight * np.sin(angle))
    signals = {"longitudinal_position": x, "lateral_position": y, "yaw": side * angle}
    speed = V - 4.0 * late
    rate = np.where(TIMES < 3.5, side * V / radius, side * 0.25 * V / radius)
    numbers = braked("braking_in_turn", 3.0, longitudinal_speed=speed, yaw_rate=rate, **signals)
    outwards = np.hypot(radius, V * 1.0 - 2.0) - radius
    assert numbers["path_deviation"] == pytest.approx(-outwards, rel=1e-6)
    assert numbers["mean_deceleration"] == pytest.approx(4.0, rel=1e-6)
    assert numbers["yaw_rate_ratio"] == pytest.approx(0.25, rel=1e-6)


def test_split_friction_and_other_inputs_give_what_is_largest_while_they_act():
    rate = np.where(TIMES < 0.9, 5.0, -0.2 * np.sin(TIMES))
    numbers = braked("split_friction", 1.0, yaw_rate=rate, lateral_speed=V * np.tan(rate / 4.0))
    assert numbers["largest_yaw_rate"] == pytest.approx(0.2, rel=1e-3)
    assert numbers["largest_sideslip"] == pytest.approx(0.05, rel=1e-3)
    slips = {"slip_ratio_RL": 0.1 * np.sin(TIMES), "slip_ratio_RR": -0.3 * np.sin(TIMES)}
    slip = vm.metrics(run_of(TIMES, 0.0 * ONES, "power_in_turn", **slips))["largest_slip"]
    assert slip == pytest.approx(0.3, rel=1e-3)
    loads = {"roll": -0.1 * np.sin(TIMES), "Fz_FL": 3e3 * ONES, "Fz_RR": 2e3 + 1e3 * np.sin(TIMES)}
    numbers = vm.metrics(run_of(TIMES, 0.0 * ONES, "bump", **loads))
    assert numbers["largest_roll"] == pytest.approx(0.1, rel=1e-3)
    assert numbers["smallest_load"] == pytest.approx(1e3, rel=1e-3)


def test_a_car_that_stops_has_the_distance_to_its_stop():
    run = vm.model(CAR, {"initial_speed": 10.0}).simulate("straight_braking")
    assert run.status == "stopped"
    numbers = vm.metrics(run)
    assert numbers["final_speed"] < 0.6
    expected = 10.0**2 / (2.0 * numbers["mean_deceleration"])
    assert numbers["distance"] == pytest.approx(float(expected), rel=0.01)


@pytest.mark.parametrize(("name", "prefix"), [(CAR, ""), (FIDELITY, "rack_")])
def test_reduced_vehicles_have_the_numbers_of_the_full_ones(name, prefix):
    full = vm.metrics(vm.model(name).simulate(vm.maneuver(f"{prefix}step_steer")))
    reduced = vm.metrics(vm.rom(name).simulate(f"{prefix}step_steer"))
    assert float(reduced["yaw_rate_gain"]) == pytest.approx(float(full["yaw_rate_gain"]), rel=0.02)
    # The output times are 20 ms apart.
    time = "lateral_acceleration_response_time"
    assert float(reduced[time]) == pytest.approx(float(full[time]), abs=0.02)
    # A left turn and a right turn are alike.
    right = vm.model(name).simulate(vm.maneuver(f"{prefix}step_steer", amplitude=-1.0))
    for number, value in vm.metrics(right).items():
        assert float(value) == pytest.approx(float(full[number]), rel=1e-3), number


# Test, steering that is not that of it, and what the line says.
SLOW, FAST = 0.01 * np.sin(np.pi * TIMES / 3.0), 0.01 * np.sin(3.0 * TIMES)
NO_TESTS = [
    ("step_steer", 0.0 * ONES, "straight at the end"),
    ("step_steer", FAST, "rise within 1 s to stay within 10%"),
    ("step_steer", 0.01 * TIMES, "rise within 1 s to stay within 10%"),
    ("slow_ramp_steer", FAST, "more than 25% in a second"),
    ("sine_sweep", SLOW, "at 0.3 to 1.5 Hz"),
    ("weave", SLOW, "to and fro twice"),
    ("sine_with_dwell", FAST, "change its side once, and end"),
    ("straight_braking", FAST, "no brake acts"),
]


def test_what_has_no_numbers_is_refused():
    run = run_of(TIMES, 0.01 * ONES, "lane_change")
    refused(lambda: vm.metrics(run), "lane_change", "step_steer")
    refused(lambda: vm.metrics(run, "weeve"), "weave")
    refused(lambda: vm.metrics(run_of(TIMES, 0.01 * ONES, "")), "maneuver")
    refused(lambda: vm.metrics(3), "not a run")
    refused(lambda: vm.metrics(vm.rom(WISHBONE).simulate("sine_travel"), "weave"), "no vehicle")
    lost = run_of(TIMES, 0.01 * ONES, "weave", yaw=np.where(TIMES > 2.0, np.nan, 0.0))
    refused(lambda: vm.metrics(lost), "end")
    for name, steering, words in NO_TESTS:
        refused(lambda name=name, u=steering: vm.metrics(run_of(TIMES, u, name)), words)
    refused(lambda: braked("braking_in_turn", 3.0), "drives straight")
    still = vm.metrics(run_of(TIMES, 0.0 * ONES, "slow_ramp_steer"))
    assert np.isnan(still["understeer_gradient"])
