"""Motion of a vehicle by the terms of ISO 8855, and its numbers in open-loop tests.

Tests of steering, then with brakes, drive and roads.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vehiclemor.exceptions import InputError

NEEDED = ("longitudinal_position", "lateral_position", "yaw", "roll")
NEEDED += ("longitudinal_speed", "lateral_speed", "yaw_rate")
RESPONSES = ("yaw_rate", "lateral_acceleration")
# m/s^2: gradients of a steady turn are those between these lateral accelerations.
LINEAR_RANGE = (1.0, 3.0)
# Length (s) of the end of a step's run, whose mean is the steady value; a step rises faster.
STEADY = 1.0
# Part of a step's steering that is on either side of its rise, and by which it may be off after it:
# response times end at nine tenths of the answer, and gains follow the steering.
HELD = 0.1
# Part of a slow ramp's largest steering that may be passed in a second.  A car follows its steering
# by 0.1 to 0.2 s: faster, and gradients would be those of its lag.
SLOW = 0.25
# Part of the spectrum's largest amplitude from which on the steering moves at a frequency: beside
# that of a sine, which moves at no other, the spectrum reaches 0.22.
MOVED = 0.25
# m/s^2: what a road that falls to the side by 1 % asks for is no turn.
STRAIGHT = 0.1
# Hz: where the sweep moves the steering.
FREQUENCIES = np.arange(3, 16) / 10.0
# Order of the difference equation of a frequency response, and its step in s.
ORDER, DELAY = 4, 0.1
# Part of the largest steering around the centre, where on-centre gains are taken; part from which
# on steering has begun.
ON_CENTRE, BEGUN = 0.2, 0.05
# s after the end of the steering, and after its beginning.
RATIO_TIMES = {"early_yaw_rate_ratio": 1.0, "late_yaw_rate_ratio": 1.75}
DISPLACEMENT_TIME = 1.07
# Time (s) after the beginning of the braking at which a turn is compared with what it was.
AFTER = 1.0


@dataclass(frozen=True)
class Motion:
    """Inputs and outputs (samples,) of a run by name, at times (samples,) in s; wheelbase in m.

    Position, speed, sideslip and lateral acceleration are those of the sprung body's centre of
    mass, along chassis axes: the horizontal ones of ISO 8855 differ by the cosine of the roll
    angle, 0.2 % at 0.06 rad.
    """

    times: np.ndarray
    histories: Mapping[str, np.ndarray]
    wheelbase: float = np.nan

    def __post_init__(self) -> None:
        """Refuse what is no run of a vehicle, or one that has not come to its end."""
        if missing := [name for name in NEEDED if name not in self.histories]:
            raise InputError(f"the run is of no vehicle, or without outputs {', '.join(missing)}")
        if len(self.times) < 2:
            raise InputError("the run has one output time, too few for numbers of a maneuver")
        if not np.isfinite([self[name] for name in NEEDED]).all():
            raise InputError("the run has not come to its end: it has no numbers of a maneuver")

    def __getitem__(self, name: str) -> np.ndarray:
        """History (samples,) of an input or output, or of what follows from them."""
        return self.histories[name] if name in self.histories else getattr(self, name)

    def of_wheels(self, quantity: str) -> np.ndarray:
        """Histories (wheels, samples) of a quantity of each wheel; not numbers without any."""
        wheels = [each for name, each in self.histories.items() if name.startswith(f"{quantity}_")]
        return np.array(wheels or [np.full(len(self.times), np.nan)])

    def at(self, name: str, time: float) -> float:
        """Value at a time in s, linear between the samples; not a number after the run."""
        return float(np.interp(time, self.times, self[name], right=np.nan))

    def moved(self, begin: float, end: float) -> complex:
        """Way from one time in s to another: x + 1j y in m."""
        x, y = (self.at(name, end) - self.at(name, begin) for name in NEEDED[:2])
        return complex(x, y)

    @property
    def steering(self) -> np.ndarray:
        """What the driver moves: angle of the front wheels in rad or displacement of the rack."""
        nothing = np.zeros(len(self.times))
        return self.histories.get("delta", self.histories.get("s", nothing))

    @property
    def wheel_angle(self) -> np.ndarray:
        """Mean angle of the front wheels in rad."""
        return (
            self.of_wheels("steer").mean(axis=0) if "steer_FL" in self.histories else self.steering
        )

    @property
    def speed(self) -> np.ndarray:
        """Magnitude of the velocity in m/s."""
        return np.hypot(self["longitudinal_speed"], self["lateral_speed"])

    @property
    def sideslip(self) -> np.ndarray:
        """Angle in rad from the longitudinal axis to the velocity."""
        return np.arctan2(self["lateral_speed"], self["longitudinal_speed"])

    @cached_property
    def lateral_acceleration(self) -> np.ndarray:
        """Rate of the lateral speed, plus yaw rate times longitudinal speed, in m/s^2."""
        from scipy.interpolate import CubicSpline

        rate = CubicSpline(self.times, self["lateral_speed"])(self.times, 1)
        return rate + self["yaw_rate"] * self["longitudinal_speed"]


def first_time(times: np.ndarray, signal: np.ndarray, level: float) -> float:
    """First time in s at which a signal (samples,) has risen to a level, linear between samples.

    Not a number if it never has.
    """
    k = int(np.argmax(signal >= level))
    if signal[k] < level:
        return np.nan
    if k == 0:
        return float(times[0])
    return float(np.interp(level, signal[k - 1 : k + 1], times[k - 1 : k + 1]))


def slope(x: np.ndarray, y: np.ndarray) -> float:
    """Slope of the straight line through points (n,), by least squares; of one there is none."""
    return float(np.polyfit(x, y, 1)[0]) if len(x) > 1 and np.ptp(x) > 0.0 else np.nan


def _require(fits: object, otherwise: str, test: str) -> None:
    """Raise `InputError` if the inputs of a run are not those of a test."""
    if not fits:
        raise InputError(f"{otherwise}: the run has no numbers of a {test}")


def steady_turn(motion: Motion) -> dict[str, float]:
    """Gradients of a slow ramp: straight lines over the lateral acceleration."""
    size = abs(motion.steering)
    changes = np.interp(motion.times + 1.0, motion.times, size) - size
    slow = max(abs(changes).max(), size[0]) <= SLOW * size.max()
    _require(slow, f"the steering changes by more than {SLOW:.0%} in a second", "slow ramp")
    acceleration = motion.lateral_acceleration
    low, high = LINEAR_RANGE
    within = (abs(acceleration) >= low) & (abs(acceleration) <= high)
    ackermann = motion.wheelbase * motion["yaw_rate"] / motion.speed
    over = {
        "understeer": motion.wheel_angle - ackermann,
        "roll": motion["roll"],
        "sideslip": motion.sideslip,
    }
    return {f"{k}_gradient": slope(acceleration[within], v[within]) for k, v in over.items()}


def step(motion: Motion) -> dict[str, float]:
    """Response to a step, whose time counts from half of the steering on."""
    times = motion.times
    last = times >= times[-1] - STEADY
    names = ("steering", "wheel_angle", *RESPONSES)
    steady = {name: float(np.mean(motion[name][last])) for name in names}
    _require(steady["steering"], "the steering is straight at the end", "step")
    ratio = motion.steering / steady["steering"]
    begun, half, risen = (first_time(times, ratio, part) for part in (HELD, 0.5, 1.0 - HELD))
    held = risen - begun < STEADY and abs(ratio[times > risen] - 1.0).max() <= HELD
    missed = f"the steering does not rise within {STEADY:g} s to stay within {HELD:.0%} of its end"
    _require(held, missed, "step")
    yaw_rate, lateral = (motion[name] / steady[name] for name in RESPONSES)
    return {
        "yaw_rate_gain": steady["yaw_rate"] / steady["wheel_angle"],
        "yaw_rate_response_time": first_time(times, yaw_rate, 0.9) - half,
        "yaw_rate_peak_time": float(times[yaw_rate.argmax()]) - half,
        "yaw_rate_overshoot": float(yaw_rate.max()) - 1.0,
        "lateral_acceleration_response_time": first_time(times, lateral, 0.9) - half,
    }


def frequency_response(motion: Motion) -> dict[str, np.ndarray]:
    """Gain and phase at `FREQUENCIES` of yaw rate and lateral acceleration over the wheel angle.

    A difference equation with delays of `DELAY` is fitted to all samples.  Fourier spectra of a
    sweep that ends in motion are wrong by 10 %.  Not a number where the steering does not move.
    """
    spacing = motion.times[1] - motion.times[0]
    delay = max(round(DELAY / spacing), 1)
    rows = np.arange(ORDER * delay, len(motion.times))
    if len(rows) <= 2 * ORDER:
        raise InputError("the run is too short for a frequency response")
    back = np.exp(-2j * np.pi * FREQUENCIES * delay * spacing)
    moved = abs(np.exp(-2j * np.pi * np.outer(FREQUENCIES, motion.times)) @ motion.wheel_angle)
    largest = abs(np.fft.rfft(motion.wheel_angle, 8 * len(motion.times))).max()
    reached = moved > MOVED * largest
    span = f"{FREQUENCIES[0]:g} to {FREQUENCIES[-1]:g} Hz"
    _require(reached.any(), f"the steering does not move at {span}", "sweep")
    numbers: dict[str, np.ndarray] = {}
    for name in RESPONSES:
        response, driven = motion[name], motion.wheel_angle
        past = [response[rows - k * delay] for k in range(1, ORDER + 1)]
        past += [driven[rows - k * delay] for k in range(ORDER + 1)]
        fitted = np.linalg.lstsq(np.column_stack(past), response[rows], rcond=None)[0]
        powers = back[:, None] ** np.arange(ORDER + 1)
        ratio = powers @ fitted[ORDER:] / (1.0 - powers[:, 1:] @ fitted[:ORDER])
        numbers[f"{name}_gain"] = np.where(reached, np.abs(ratio), np.nan)
        numbers[f"{name}_phase"] = np.where(reached, np.unwrap(np.angle(ratio)), np.nan)
    return numbers


def weave(motion: Motion) -> dict[str, float]:
    """On-centre gain and hysteresis of whole periods, without the first, which sets in."""
    begins = _rises(motion.steering)
    _require(len(begins) > 1, "the steering does not go to and fro twice", "weave")
    periods = slice(begins[0], begins[-1] + 1)
    angle = motion.wheel_angle[periods]
    near = abs(angle) <= ON_CENTRE * abs(angle).max(initial=0.0)
    numbers: dict[str, float] = {}
    for name in RESPONSES:
        response = motion[name][periods]
        numbers[f"{name}_gain"] = slope(angle[near], response[near])
        numbers[f"{name}_hysteresis"] = _at_zero(angle, response) - _at_zero(angle, -response)
    return numbers


def _rises(signal: np.ndarray) -> np.ndarray:
    """Samples after which a signal (n,) rises through zero."""
    return np.flatnonzero((signal[:-1] < 0.0) & (signal[1:] >= 0.0))


def _at_zero(steering: np.ndarray, response: np.ndarray) -> float:
    """Mean steering where the response rises through zero, linear between the samples."""
    k = _rises(response)
    part = response[k] / (response[k] - response[k + 1])
    crossed = steering[k] + part * (steering[k + 1] - steering[k])
    return float(crossed.mean()) if len(k) else np.nan


def sine_with_dwell(motion: Motion) -> dict[str, float]:
    """Ratios of the yaw rate after the steering, displacement after its beginning."""
    times, size = motion.times, abs(motion.steering)
    level = BEGUN * size.max()
    begin = first_time(times, size, level)
    end = -first_time(-times[::-1], size[::-1], level)
    parts = motion.steering / (size.max() or 1.0)
    sides = np.sign(parts[abs(parts) > BEGUN])
    once = np.count_nonzero(np.diff(sides)) == 1 and abs(parts[-1]) <= BEGUN
    _require(once, "the steering does not change its side once, and end", "sine with dwell")
    side = np.sign(motion.at("wheel_angle", begin))
    reversed_steering = motion.steering * np.sign(motion.at("steering", begin)) < 0.0
    turned_back = reversed_steering & (times <= end)
    peak = np.max(-side * motion["yaw_rate"], where=turned_back, initial=0.0) or np.nan
    numbers = {
        name: -side * motion.at("yaw_rate", end + after) / peak
        for name, after in RATIO_TIMES.items()
    }
    moved = motion.moved(begin, begin + DISPLACEMENT_TIME)
    aside = (moved * np.exp(-1j * motion.at("yaw", begin))).imag
    return numbers | {"lateral_displacement": side * aside}


# Brakes, drive and roads.


def _begin(motion: Motion) -> int:
    """The last sample before a brake acts; `InputError` of a run without any."""
    braked = (motion.of_wheels("brake_torque") > 0.0).any(axis=0)
    _require(braked.any(), "no brake acts", "braking test")
    return max(int(np.argmax(braked)) - 1, 0)


def straight_braking(motion: Motion) -> dict[str, float]:
    """Distance from the first brake torque until the car stops, or the run ends."""
    x, y, speed = (
        motion[name][_begin(motion) :]
        for name in ("longitudinal_position", "lateral_position", "speed")
    )
    distance = float(np.hypot(np.diff(x), np.diff(y)).sum()) or np.nan
    deceleration = (speed[0] ** 2 - speed[-1] ** 2) / (2.0 * distance)
    return {
        "distance": distance,
        "mean_deceleration": float(deceleration),
        "final_speed": float(speed[-1]),
    }


def braking_in_turn(motion: Motion) -> dict[str, float]:
    """How braking changes a steady turn."""
    begin = float(motion.times[_begin(motion)])
    then = begin + AFTER
    speed, yaw_rate = motion.at("speed", begin), motion.at("yaw_rate", begin)
    turns = abs(speed * yaw_rate) >= STRAIGHT
    _require(turns, "the vehicle drives straight when a brake acts first", "turn")
    # The circle goes on; its centre lies to the left of the course, or at a negative radius right.
    course, radius = motion.at("yaw", begin) + motion.at("sideslip", begin), speed / yaw_rate
    centre = 1j * radius * np.exp(1j * course)
    return {
        "yaw_rate_ratio": motion.at("yaw_rate", then) / yaw_rate,
        "mean_deceleration": (speed - motion.at("speed", then)) / AFTER,
        "path_deviation": float(abs(radius) - abs(motion.moved(begin, then) - centre)),
    }


def split_friction(motion: Motion) -> dict[str, float]:
    """Largest magnitudes while the car brakes."""
    k = _begin(motion)
    return {
        f"largest_{name}": float(abs(motion[name][k:]).max()) for name in ("yaw_rate", "sideslip")
    }


def power_in_turn(motion: Motion) -> dict[str, float]:
    """Largest slip of a wheel."""
    return {"largest_slip": float(abs(motion.of_wheels("slip_ratio")).max())}


def bump(motion: Motion) -> dict[str, float]:
    """Roll, and what is left of the load of a wheel."""
    return {
        "largest_roll": float(abs(motion["roll"]).max()),
        "smallest_load": float(motion.of_wheels("Fz").min()),
    }
