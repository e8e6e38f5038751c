"""Numbers of tests with brakes, drive and roads."""

import numpy as np

from vehiclemor.handling.motion import Motion

# Time (s) after the beginning of the braking at which a turn is compared with what it was.
AFTER = 1.0


def straight_braking(motion: Motion) -> dict[str, float]:
    """Distance from the first brake torque until the car stops, or the run ends."""
    k = _begin(motion.braking)
    distance = float(np.hypot(np.diff(motion.x[k:]), np.diff(motion.y[k:])).sum())
    lost = motion.speed[k] ** 2 - motion.speed[-1] ** 2
    return {
        "distance": distance,
        "mean_deceleration": float(lost / (2.0 * distance)) if distance else np.nan,
        "final_speed": float(motion.speed[-1]),
    }


def braking_in_turn(motion: Motion) -> dict[str, float]:
    """How braking changes a steady turn."""
    k = _begin(motion.braking)
    then = motion.times[k] + AFTER

    def at(signal: np.ndarray) -> float:
        return float(np.interp(then, motion.times, signal, right=np.nan))

    # The circle of the turn goes on around its centre.
    course, radius = motion.yaw[k] + motion.sideslip[k], motion.speed[k] / motion.yaw_rate[k]
    centre_x = motion.x[k] - radius * np.sin(course)
    centre_y = motion.y[k] + radius * np.cos(course)
    return {
        "yaw_rate_ratio": at(motion.yaw_rate) / float(motion.yaw_rate[k]),
        "mean_deceleration": (float(motion.speed[k]) - at(motion.speed)) / AFTER,
        "path_deviation": float(
            abs(radius) - np.hypot(at(motion.x) - centre_x, at(motion.y) - centre_y)
        ),
    }


def split_friction(motion: Motion) -> dict[str, float]:
    """Largest magnitudes while the car brakes."""
    k = _begin(motion.braking)
    return {
        "largest_yaw_rate": float(np.abs(motion.yaw_rate[k:]).max()),
        "largest_sideslip": float(np.abs(motion.sideslip[k:]).max()),
    }


def power_in_turn(motion: Motion) -> dict[str, float]:
    """Largest slip of a wheel."""
    return {"largest_slip": float(motion.slip.max())}


def bump(motion: Motion) -> dict[str, float]:
    """Roll, and what is left of the load of a wheel."""
    return {
        "largest_roll": float(np.abs(motion.roll).max()),
        "smallest_load": float(motion.load.min()),
    }


def _begin(torque: np.ndarray) -> int:
    """The last sample before a torque (samples,) acts; the first of a run without any."""
    return max(int(np.argmax(torque > 0.0)) - 1, 0)
