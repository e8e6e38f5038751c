"""Random steering, braking and driving: families of maneuvers, a run for each seed.

Drivers steer by corrections with bell-shaped rates (O. Benderius and G. Markkula, Evidence for a
fundamental property of steering, Proc. Human Factors and Ergonomics Society 58 (2014), 884-888).
Here a correction lasts 0.2 to 2 s and ends at a random angle, every fourth straight ahead.  The
next one begins within a second, also before its end, or after a pause of 1 to 4 s.

`random_drive` adds brakes and drive that come and go, and a road with a friction of 0.4 to 1, by
which steering and torques are multiplied: the tires use the same part of their grip on all roads.
The factors are those of the steering alone.  At an amplitude factor of 1 its angles go up to the
size of the lane change.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vehiclemor.inputs.driving import FRONT_SHARE, MASS, RADIUS
from vehiclemor.inputs.maneuver import Maneuver, family
from vehiclemor.inputs.steering import DURATION, LANE_CHANGE_AMPLITUDE, RACK_AMPLITUDE, RATE, ramp
from vehiclemor.multibody.quantities import WHEELS

# More than begin in a run of four times the frequency.
CORRECTIONS, DEMANDS = 96, 12
# s: shortest and longest correction, shortest one of unit size, time to the next one, and pause
# that may be instead.
LENGTHS, QUICKEST, GAPS, PAUSES = (0.2, 2.0), 0.3, (0.1, 1.0), (1.0, 4.0)
# Share of corrections that a pause follows, and of those that end straight ahead.
PAUSED, STRAIGHT = 0.2, 0.25
# Friction of the road; m/s^2 on a road of friction 1, s: decelerations of the brakes,
# accelerations of the drive, lengths of a torque's ramps, of what is between them, and pauses.
FRICTION, BRAKING, DRIVING = (0.4, 1.0), (0.5, 3.0), (0.5, 2.0)
RAMPS, HOLDS, BETWEEN = (0.2, 1.0), (0.3, 2.0), (0.2, 3.0)
# Share of the drive torque in front, by seed.
DRIVEN_AXLES = (0.0, 0.5, 1.0)
DRIVE_TORQUES, BRAKE_TORQUES, FRICTIONS = (
    tuple(f"{name}_{wheel}" for wheel in WHEELS)
    for name in ("drive_torque", "brake_torque", "friction")
)


class Change(NamedTuple):
    """A smooth change by a size: when it begins, and its length, both in s."""

    begin: float
    length: float
    size: float


class Road(NamedTuple):
    """What a seed draws beside steering: friction, changes of the accelerations in m/s^2."""

    friction: float
    front_share: float
    braking: tuple[Change, ...]
    driving: tuple[Change, ...]


@dataclass(frozen=True)
class RandomSteering:
    """Signal of a seed: steering angle, or displacement of the rack and its derivatives."""

    seed: int
    rack: bool = False

    def __call__(self, times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        """Inputs (n, 1) or (n, 3) at the times (n,) in s."""
        steering = total(corrections(self.seed), times, frequency)
        if self.rack:
            return amplitude * RACK_AMPLITUDE * steering
        return amplitude * LANE_CHANGE_AMPLITUDE * steering[:, :1]

    def corners(self, frequency: float) -> tuple[float, ...]:
        """Times in s at which corrections begin and end."""
        return corners_of(corrections(self.seed), frequency)


@dataclass(frozen=True)
class RandomDriving(RandomSteering):
    """Signal of a seed: steering, torques of drive and brakes, and friction of the wheels."""

    def __call__(self, times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        """Inputs (n, 13) or (n, 15) at the times (n,) in s."""
        road = road_of(self.seed)
        steering = road.friction * super().__call__(times, frequency, amplitude)
        torque = road.friction * MASS * RADIUS / 2.0
        drive = torque * total(road.driving, times)[:, :1]
        brakes = torque * total(road.braking, times)[:, :1]
        driven, braked = (
            [share, share, 1.0 - share, 1.0 - share] for share in (road.front_share, FRONT_SHARE)
        )
        friction = np.full((len(times), len(WHEELS)), road.friction)
        return np.hstack([steering, drive * driven, brakes * braked, friction])

    def corners(self, frequency: float) -> tuple[float, ...]:
        """Times in s at which a correction or a change of torques begins or ends."""
        road = road_of(self.seed)
        torques = corners_of((*road.braking, *road.driving))
        return tuple(sorted({*super().corners(frequency), *torques}))


@lru_cache(maxsize=4096)
def corrections(seed: int) -> tuple[Change, ...]:
    """Corrections of unit steering."""
    random = _random(seed, 0, CORRECTIONS)
    changes, time, angle = [], 0.5 * random[0, 0], 0.0
    for quick, pause, wait, side in random[:, 1:].tolist():
        target = 0.0
        if side >= STRAIGHT:
            target = _within((-1.0, 1.0), (side - STRAIGHT) / (1 - STRAIGHT))
        drawn = LENGTHS[0] * (LENGTHS[1] / LENGTHS[0]) ** quick
        length = max(drawn, QUICKEST * abs(target - angle))
        changes.append(Change(time, length, target - angle))
        angle = target
        time += length + _within(PAUSES, wait) if pause < PAUSED else _within(GAPS, wait)
    return tuple(changes)


@lru_cache(maxsize=4096)
def road_of(seed: int) -> Road:
    """Friction of the road, and what brakes and drive do on it."""
    first, *random = _random(seed, 1, DEMANDS + 1).tolist()
    torques: dict[bool, list[Change]] = {True: [], False: []}
    time = 0.0
    for braked, size, wait, hold, length in random:
        braking, rise = braked < 0.5, _within(RAMPS, length)
        acceleration = _within(BRAKING if braking else DRIVING, size)
        begin = time + _within(BETWEEN, wait)
        end = begin + rise + _within(HOLDS, hold)
        torques[braking] += [Change(begin, rise, acceleration), Change(end, rise, -acceleration)]
        time = end + rise
    share = DRIVEN_AXLES[int(first[1] * len(DRIVEN_AXLES))]
    return Road(_within(FRICTION, first[0]), share, tuple(torques[True]), tuple(torques[False]))


def _random(seed: int, stream: int, rows: int) -> np.ndarray:
    """Numbers (rows, 5) from 0 to 1; NumPy may change how its other functions sample."""
    return np.random.Generator(np.random.PCG64([seed, stream])).random((rows, 5))


def _within(limits: tuple[float, float], part: float) -> float:
    low, high = limits
    return low + (high - low) * part


def total(changes: tuple[Change, ...], times: np.ndarray, frequency: float = 1.0) -> np.ndarray:
    """Sum (n, 3) of changes at times in s, so many times as quick, with two derivatives."""
    values = np.zeros((len(times), 3))
    for change in changes:
        begin, length = change.begin / frequency, change.length / frequency
        if begin < DURATION:
            values += change.size * ramp((times - begin) / length, length)
    return values


def corners_of(changes: tuple[Change, ...], frequency: float = 1.0) -> tuple[float, ...]:
    """Times in s of a run at which changes begin and end."""
    ends = {time for each in changes for time in (each.begin, each.begin + each.length)}
    return tuple(sorted(time / frequency for time in ends if time / frequency < DURATION))


def _family(signal: RandomSteering, name: str, summary: str) -> Maneuver:
    inputs: tuple[str, ...] = ("delta",)
    if signal.rack:
        inputs, summary = ("s", "s_dot", "s_ddot"), f"{summary}, of the rack"
    driven = isinstance(signal, RandomDriving)
    if driven:
        inputs += (*DRIVE_TORQUES, *BRAKE_TORQUES, *FRICTIONS)
    summary = f"{summary}, 10 s; {name}:SEED is another one"
    samples = round(DURATION * RATE) + 1
    first = Maneuver(name, summary, signal, inputs, DURATION, samples, signal.corners)
    return family(replace(first, linear_in_amplitude=not driven))


STEERING = "corrections of the steering to random angles, with pauses"
DRIVING_TOO = "random steering, braking and driving on a road of random friction"
random_steer = _family(RandomSteering(1), "random_steer", STEERING)
rack_random_steer = _family(RandomSteering(1, rack=True), "rack_random_steer", STEERING)
random_drive = _family(RandomDriving(1), "random_drive", DRIVING_TOO)
rack_random_drive = _family(RandomDriving(1, rack=True), "rack_random_drive", DRIVING_TOO)
