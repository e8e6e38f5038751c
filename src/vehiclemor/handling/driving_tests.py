"""Numbers of tests with brakes, drive and roads."""

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.handling.motion import Motion

# Time (s) after the beginning of the braking at which a turn is compared with what it was.
AFTER = 1.0


def _begin(motion: Motion) -> int:
    """The last sample before a brake acts; `InputError` of a run without any."""
    braked = (motion.of_wheels("brake_torque") > 0.0).any(axis=0)
    if not braked.any():
        raise InputError("no brake acts in the run: it has no numbers of a braking test")
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
