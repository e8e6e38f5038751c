"""The double wishbone's equations as its specification writes them, without the package's symbols.

`residual` and `outputs` take their rotations from SciPy; `precise_residual` writes them out in
mpmath, at as many digits as the caller works with.
"""

from collections.abc import Mapping, Sequence

import mpmath as mp
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


def precise_residual(points: Points, q: Sequence, u: Sequence) -> list:
    """Phi(q; z, s0) in mpmath numbers, with Rodrigues' formula and rotation matrices in full."""
    p = {name: mp.matrix([mp.mpf(float(c)) for c in point]) for name, point in points.items()}
    zeta, eta, xi, theta_u, theta_l, alpha, beta, s = q
    upper = _turned(p, "upper", theta_u)
    carrier = _about_z(zeta) * _about_y(eta) * _about_x(xi)

    def on_carrier(name: str):
        return upper + carrier * (p[name] - p["upper_ball_joint"])

    rod = p["tie_rod_outer"] - p["tie_rod_inner"]
    along = _about_z(alpha) * _about_x(beta) * mp.matrix([0, 1, 0])
    rod_end = p["tie_rod_inner"] + mp.matrix([0, s, 0]) + mp.norm(rod) * along
    lower = on_carrier("lower_ball_joint") - _turned(p, "lower", theta_l)
    steer = on_carrier("tie_rod_outer") - rod_end
    height = on_carrier("wheel_centre")[2] - p["wheel_centre"][2]
    return [*lower, *steer, height - u[0], s - u[1]]


def precise_jacobian(points: Points, q: Sequence, u: Sequence) -> list[list]:
    """Derivatives of `precise_residual` by central differences, exact to 15 digits and more."""
    with mp.workdps(50):
        step, q = mp.mpf(10) ** -16, [mp.mpf(float(c)) for c in q]
        columns = []
        for k in range(len(q)):
            above, below = list(q), list(q)
            above[k], below[k] = q[k] + step, q[k] - step
            upper, lower = precise_residual(points, above, u), precise_residual(points, below, u)
            columns.append([(a - b) / (2 * step) for a, b in zip(upper, lower, strict=True)])
        return [list(row) for row in zip(*columns, strict=True)]


def _turned(p: dict, arm: str, angle):
    rear = p[f"{arm}_arm_rear_pivot"]
    axis = p[f"{arm}_arm_front_pivot"] - rear
    axis = axis / mp.norm(axis)
    lever = p[f"{arm}_ball_joint"] - rear
    along = (axis.T * lever)[0]
    across = mp.matrix(
        [
            axis[1] * lever[2] - axis[2] * lever[1],
            axis[2] * lever[0] - axis[0] * lever[2],
            axis[0] * lever[1] - axis[1] * lever[0],
        ]
    )
    return (
        rear + mp.cos(angle) * lever + mp.sin(angle) * across + (1 - mp.cos(angle)) * along * axis
    )


def _about_x(angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])
