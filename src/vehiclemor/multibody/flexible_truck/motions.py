"""Motion of places of the truck as rows over s, which both meshes have.

s (N,) are three displacements and three rotations of the rails at every station, left and right,
then heave, pitch and roll of the cab, then heave and roll of the front and of the rear axle.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from vehiclemor.multibody.flexible_truck.frame import Layout

# Coordinates of cab and axles.
OTHERS = 7


class Motions:
    """Rows over s (N,)."""

    def __init__(self, ladder: Layout) -> None:
        self.ladder = ladder
        size = 12 * len(ladder.stations) + OTHERS
        rows = np.eye(size)
        # Motion (stations, 2, 6, N) of the left and the right rail.
        self.rails = rows[:-OTHERS].reshape(-1, 2, 6, size)
        # Heave, pitch and roll (3, N); heave and roll (2, N) of each axle.
        self.cab, self.axles = rows[-OTHERS:-4], {"front": rows[-4:-2], "rear": rows[-2:]}
        left, right = self.rails[:, 0], self.rails[:, 1]
        # Displacements along, across and upward and roll (stations, 4, N) of both rails together.
        self.middles = (left + right)[:, :4] / 2.0
        self.middles[:, 3] = (left[:, 2] - right[:, 2]) / (ladder.sides[0] - ladder.sides[1])
        at = [ladder.planes["front axle"], ladder.planes["rear axle"]]
        self.front, self.rear = self.middles[at]
        self.ahead, self.behind = ladder.stations[at]
        change, length = self.front - self.rear, self.ahead - self.behind
        # Angles (N,) of the frame between the axles; roll is the mean, twist front less rear.
        self.pitch, self.yaw = -change[2] / length, change[1] / length
        self.roll, self.twist = (self.front[3] + self.rear[3]) / 2.0, change[3]

    def rail(self, plane: str, y: float) -> np.ndarray:
        """Height (N,) of the rail in a plane, at the end of a rigid arm that reaches y (m)."""
        side = int(y < 0.0)
        motion = self.rails[self.ladder.planes[plane], side]
        return motion[2] + (y - self.ladder.sides[side]) * motion[3]

    def axle(self, end: str, y: float) -> np.ndarray:
        """Height (N,) of an axle at y (m)."""
        heave, roll = self.axles[end]
        return heave + y * roll

    def in_cab(self, x: float, y: float) -> np.ndarray:
        """Height (N,) of the cab at x and y (m) from its centre."""
        heave, pitch, roll = self.cab
        return heave + y * roll - x * pitch

    def body(self, places: np.ndarray) -> np.ndarray:
        """Displacements (points, 3, N) of points (points, 3) of what rests on the frame.

        Bodies and platform are rigid in their plane: along, across and in pitch and yaw they follow
        the frame at the axles.  Their heights follow the rails under them.
        """
        from scipy.interpolate import make_interp_spline

        x, y, z = places.T[:, :, None]
        stations = self.ladder.stations[::-1]
        share, up = (self.ahead - x) / (self.ahead - self.behind), z - self.ladder.height
        rails = make_interp_spline(stations, self.middles[::-1, 2:], k=1)(places[:, 0])
        along = (self.front[0] + self.rear[0]) / 2.0 + up * self.pitch - y * self.yaw
        ends = self.front[1] - up * self.front[3], self.rear[1] - up * self.rear[3]
        across = (1.0 - share) * ends[0] + share * ends[1]
        return np.stack([along, across, rails[:, 0] + y * rails[:, 1]], axis=1)


def block(half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares (points,) and places (points, 3) of points that have a homogeneous block's moments.

    The block has its sides along the axes; `half` (3,) are half its lengths in m.
    """
    points, weights = np.polynomial.legendre.leggauss(8)
    shares = np.array(list(product(weights / 2.0, repeat=3))).prod(axis=1)
    return shares, np.array(list(product(points, repeat=3))) * half
