"""Motion of a vehicle in a handling test, by the terms of ISO 8855."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vehiclemor.exceptions import InputError

NEEDED = ("longitudinal_position", "lateral_position", "yaw", "roll")
NEEDED += ("longitudinal_speed", "lateral_speed", "yaw_rate")


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
