"""The double wishbone's equations as its specification writes them, rotations by SciPy."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

Points = Mapping[str, np.ndarray]


def arm_end(points: Points, arm: str, angle: float) -> np.ndarray:
    """Ball joint of an arm turned by an angle about the axis from its rear to its front pivot."""
    rear, front = points[f"{arm}_arm_rear_pivot"], points[f"{arm}_arm_front_pivot"]
    axis = (front - rear) / np.linalg.norm(front - rear)
    return rear + Rotation.from_rotvec(angle * axis).apply(points[f"{arm}_ball_joint"] - rear)


def carrier_point(points: Points, q: np.ndarray, name: str) -> np.ndarray:
    """Point of the wheel carrier, turned by 3-2-1 Euler angles about the upper ball joint."""
    lever = points[name] - points["upper_ball_joint"]
    return arm_end(points, "upper", q[3]) + Rotation.from_euler("ZYX", q[:3]).apply(lever)


def rod_end(points: Points, q: np.ndarray) -> np.ndarray:
    """Outer end of the tie rod, which a universal joint carries on the rack."""
    inner, outer = points["tie_rod_inner"], points["tie_rod_outer"]
    direction = Rotation.from_euler("ZX", q[5:7]).apply([0.0, 1.0, 0.0])
    return inner + [0.0, q[7], 0.0] + np.linalg.norm(outer - inner) * direction


def residual(points: Points, q: np.ndarray, u: Sequence[float]) -> np.ndarray:
    """Phi(q; z, s0) in the specification's order."""
    height = carrier_point(points, q, "wheel_centre")[2] - points["wheel_centre"][2]
    return np.concatenate(
        [
            carrier_point(points, q, "lower_ball_joint") - arm_end(points, "lower", q[4]),
            carrier_point(points, q, "tie_rod_outer") - rod_end(points, q),
            [height - u[0], q[7] - u[1]],
        ]
    )


def outputs(points: Points, q: np.ndarray) -> dict[str, float]:
    """Outputs by name."""
    moved = carrier_point(points, q, "wheel_centre") - points["wheel_centre"]
    axle = Rotation.from_euler("ZYX", q[:3]).apply([0.0, 1.0, 0.0])
    return {
        "spindle_x": moved[0],
        "spindle_y": moved[1],
        "second_euler_angle": q[1],
        "toe": np.arctan2(-axle[0], axle[1]),
        "camber": np.arcsin(axle[2]),
        "rack": q[7],
    }
