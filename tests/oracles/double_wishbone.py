"""The double wishbone as its specification writes it, and as points at constant distances.

The first by rotations of SciPy.  In the second unknown are the upper and lower ball joint and the
outer tie-rod joint.  Rigid links keep distances; the wheel centre is a fixed combination of the
carrier's two edges and their vector product.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import optimize
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


JOINTS = ("upper_ball_joint", "lower_ball_joint", "tie_rod_outer")
PIVOTS = (
    (0, "upper_arm_front_pivot"),
    (0, "upper_arm_rear_pivot"),
    (1, "lower_arm_front_pivot"),
    (1, "lower_arm_rear_pivot"),
    (2, "tie_rod_inner"),
)
CARRIER = ((0, 1), (1, 2), (2, 0))


class PointMechanism:
    """Positions (9,) of the three joints, found by continuation from the design position."""

    def __init__(self, points: Mapping[str, np.ndarray]) -> None:
        self.points = points
        self.design = np.concatenate([points[name] for name in JOINTS])
        joints = self.design.reshape(3, 3)
        self._links = [np.sum((joints[i] - points[name]) ** 2) for i, name in PIVOTS]
        self._carrier = [np.sum((joints[a] - joints[b]) ** 2) for a, b in CARRIER]
        lever = points["wheel_centre"] - joints[0]
        self._combination = np.linalg.solve(edges(self.design), lever)

    def wheel_centre(self, x: np.ndarray) -> np.ndarray:
        """Position (3,) of the wheel centre."""
        return x[:3] + edges(x) @ self._combination

    def rotation(self, x: np.ndarray) -> np.ndarray:
        """Rotation matrix of the carrier since the design position."""
        return edges(x) @ np.linalg.inv(edges(self.design))

    def closures(self, x: np.ndarray, rack: float) -> np.ndarray:
        """Differences (8,) of squared distances to those of the design position."""
        joints, moved = x.reshape(3, 3), dict(self.points)
        moved["tie_rod_inner"] = moved["tie_rod_inner"] + [0.0, rack, 0.0]
        links = [np.sum((joints[i] - moved[name]) ** 2) for i, name in PIVOTS]
        carrier = [np.sum((joints[a] - joints[b]) ** 2) for a, b in CARRIER]
        return np.concatenate(
            [np.subtract(links, self._links), np.subtract(carrier, self._carrier)]
        )

    def height(self, x: np.ndarray) -> float:
        """Height of the wheel centre above its design position."""
        return self.wheel_centre(x)[2] - self.points["wheel_centre"][2]

    def solve(self, near: np.ndarray, height: float, rack: float) -> np.ndarray:
        """Joints at a height and rack displacement, near known ones."""
        solution = optimize.root(
            lambda x: np.append(self.closures(x, rack), self.height(x) - height), near, tol=1e-14
        )
        assert np.abs(solution.fun).max() < 1e-12
        return solution.x

    def path(self, heights: np.ndarray, rack: float) -> np.ndarray:
        """Joints (heights, 9): first the rack moves, then the wheel from height to height."""
        x = self.design
        for step in np.linspace(0.0, rack, 5):
            x = self.solve(x, 0.0, step)
        found = []
        for height in heights:
            x = self.solve(x, height, rack)
            found.append(x)
        return np.array(found)


def edges(x: np.ndarray) -> np.ndarray:
    """Two edges of the carrier and their vector product, in columns; its hand never changes."""
    first, second = x[3:6] - x[:3], x[6:] - x[:3]
    return np.column_stack([first, second, np.cross(first, second)])
