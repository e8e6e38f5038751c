"""Motion of a vehicle in a handling test, by the terms of ISO 8855."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.multibody.quantities import SLIP_RATIOS, TIRE_LOADS, WHEELS

# Outputs that a vehicle needs.
NEEDED = ("longitudinal_position", "lateral_position", "yaw", "roll")
NEEDED += ("longitudinal_speed", "lateral_speed", "yaw_rate")
STEERED = tuple(f"steer_{wheel}" for wheel in WHEELS[:2])
BRAKES = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)


@dataclass(frozen=True)
class Motion:
    """Histories (samples,) of a run, SI units.

    Position, speed, sideslip and lateral acceleration are those of the sprung body's centre of
    mass.  They are along the chassis axes: the horizontal ones of ISO 8855 differ by the cosine of
    the roll angle, which is 0.2 % at 0.06 rad.

    Attributes
    ----------
    times
        Output times in s.
    steering
        First input: angle of the front wheels, or displacement of the rack.
    wheel_angle
        Mean angle of the front wheels in rad.
    braking
        Sum of the brake torques in N m.
    speed, sideslip
        Magnitude of the velocity in m/s, and angle from the x axis to it in rad.
    lateral_acceleration
        dv/dt + r u of the lateral speed v, yaw rate r and longitudinal speed u, in m/s^2.
    slip, load
        Largest magnitude of the slip ratios, and smallest load in N, of all wheels.
    x, y, yaw, roll, yaw_rate
        Outputs in m, rad and rad/s.
    wheelbase
        In m; not a number if the model declares none.
    """

    times: np.ndarray
    steering: np.ndarray
    wheel_angle: np.ndarray
    braking: np.ndarray
    slip: np.ndarray
    load: np.ndarray
    speed: np.ndarray
    sideslip: np.ndarray
    lateral_acceleration: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray
    roll: np.ndarray
    yaw_rate: np.ndarray
    wheelbase: float

    @classmethod
    def of(
        cls,
        times: np.ndarray,
        names: tuple[str, ...],
        inputs: np.ndarray,
        outputs: tuple[str, ...],
        history: Callable[[str], np.ndarray],
        wheelbase: float,
    ) -> Motion:
        """Motion of a run with named inputs (samples, names) and outputs, which `history` gives."""
        from scipy.interpolate import CubicSpline

        if missing := [name for name in NEEDED if name not in outputs]:
            raise InputError(f"the run is of no vehicle, or without outputs {', '.join(missing)}")
        if len(times) < 2:
            raise InputError("the run has one output time, too few for numbers of a maneuver")
        x, y, yaw, roll, ahead, aside, yaw_rate = map(history, NEEDED)
        if not np.isfinite([x, y, yaw, roll, ahead, aside, yaw_rate]).all():
            raise InputError("the run has not come to its end: it has no numbers of a maneuver")
        columns = dict(zip(names, inputs.T, strict=True))
        steering = columns.get("delta", columns.get("s", np.zeros(len(times))))
        nothing = np.full(len(times), np.nan)

        def of_wheels(wanted: tuple[str, ...]) -> list[np.ndarray]:
            return [history(name) for name in wanted if name in outputs] or [nothing]

        steered = of_wheels(STEERED) if STEERED[0] in outputs else [steering]
        return cls(
            times=times,
            steering=steering,
            wheel_angle=np.mean(steered, axis=0),
            braking=sum((columns.get(name, 0.0) for name in BRAKES), np.zeros(len(times))),
            slip=np.max([np.abs(each) for each in of_wheels(SLIP_RATIOS)], axis=0),
            load=np.min(of_wheels(TIRE_LOADS), axis=0),
            speed=np.hypot(ahead, aside),
            sideslip=np.arctan2(aside, ahead),
            lateral_acceleration=CubicSpline(times, aside)(times, 1) + yaw_rate * ahead,
            x=x,
            y=y,
            yaw=yaw,
            roll=roll,
            yaw_rate=yaw_rate,
            wheelbase=wheelbase,
        )


def first_time(times: np.ndarray, signal: np.ndarray, level: float) -> float:
    """First time at which a signal (samples,) has risen to a level; not a number if it never has.

    Linear between the samples.
    """
    k = int(np.argmax(signal >= level))
    if signal[k] < level:
        return np.nan
    if k == 0:
        return float(times[0])
    return float(np.interp(level, signal[k - 1 : k + 1], times[k - 1 : k + 1]))


def slope(x: np.ndarray, y: np.ndarray) -> float:
    """Slope of the straight line through points (n,), by least squares; of one there is none."""
    if len(x) < 2 or np.ptp(x) == 0.0:
        return np.nan
    return float(np.polyfit(x, y, 1)[0])
