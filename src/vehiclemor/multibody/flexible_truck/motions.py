"""Motion of places of the truck as rows over s, and the point masses of what is sprung.

s (N,) are three displacements and three rotations of the rails at every station, left and right,
then heave, pitch and roll of the cab, then heave and roll of the front and of the rear axle.
"""

from __future__ import annotations

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.flexible_truck.frame import Layout

CAB, AXLES = 3, 4


class Motions:
    """Motion of points as rows over s (N,): sections of the rails, cab, axles."""

    def __init__(self, ladder: Layout, held: tuple[float, float]) -> None:
        self.ladder = ladder
        # Planes x at which the frame holds what rests on it, see `body`.
        self.held = held
        self.size = 12 * len(ladder.stations) + CAB + AXLES
        self.identity = np.eye(self.size)

    def rail(self, station: int, side: int) -> np.ndarray:
        """Motion (6, N) of a rail at a station; side 0 is left."""
        first = 6 * (2 * station + side)
        return self.identity[first : first + 6]

    def plane(self, x: float) -> np.ndarray:
        """Motion (6, N) of both rails at a place between them, linear between stations."""
        stations = self.ladder.stations
        behind = int(np.clip(np.searchsorted(-stations, -x), 1, len(stations) - 1))
        share = (stations[behind - 1] - x) / (stations[behind - 1] - stations[behind])
        motion = np.zeros((6, self.size))
        for station, weight in ((behind - 1, 1.0 - share), (behind, share)):
            left, right = self.rail(station, 0), self.rail(station, 1)
            mean = (left + right) / 2.0
            mean[3] = (left[2] - right[2]) / self.ladder.spacing
            motion += weight * moved(mean, np.array([x - stations[station], 0.0, 0.0]))
        return motion

    def body(self, place: np.ndarray) -> np.ndarray:
        """Displacement (3, N) of a point of what rests on the frame.

        Bodies and platform are rigid in their plane: along, across and in yaw they follow the
        frame at the axles, whose roll and pitch move them by their height.  Their heights follow
        the rails under them.
        """
        x, y, z = place
        front, rear = self.held
        up = np.array([0.0, 0.0, z - self.ladder.height])
        ahead, behind = (moved(self.plane(plane), up) for plane in (front, rear))
        share = (front - x) / (front - rear)
        yaw = (ahead[1] - behind[1]) / (front - rear)
        return np.array(
            [
                (ahead[0] + behind[0]) / 2.0 - y * yaw,
                (1.0 - share) * ahead[1] + share * behind[1],
                moved(self.plane(x), np.array([0.0, y, 0.0]))[2],
            ]
        )

    @property
    def cab(self) -> np.ndarray:
        """Heave, pitch and roll (3, N) of the cab."""
        return self.identity[-CAB - AXLES : -AXLES]

    def axle(self, rear: bool) -> np.ndarray:
        """Heave and roll (2, N) of an axle."""
        return self.identity[-2:] if rear else self.identity[-AXLES:-2]

    def rigid(self, centre: np.ndarray, cab: np.ndarray) -> np.ndarray:
        """Rows s (N, 6) where all that is sprung moves as one body; the axles rest."""
        found = np.zeros((self.size, 6))
        places = [
            np.array([x, y, self.ladder.height])
            for x in self.ladder.stations
            for y in self.ladder.sides
        ]
        found[: -CAB - AXLES] = np.concatenate([moved(np.eye(6), p - centre) for p in places])
        found[-CAB - AXLES : -AXLES] = moved(np.eye(6), cab - centre)[[2, 4, 3]]
        return found


def moved(motion: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Motion (6, N) at the end of a rigid arm (3,)."""
    x, y, z = arm
    far = motion.copy()
    far[0] += motion[4] * z - motion[5] * y
    far[1] += motion[5] * x - motion[3] * z
    far[2] += motion[3] * y - motion[4] * x
    return far


def points_of_the_rest(x: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Point masses (points,) in kg and places (points, 3) relative to the sprung centre.

    Four points a station, upper and lower, left and right.  Their masses are quadratic in x, their
    heights linear but for one distance.  Their mass, centre and inertia are those of `body` (6, 6):
    the inertia matrix about the sprung centre of what is neither frame nor cab.  `x` (stations,) is
    relative to that centre.
    """
    ends = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2.0, x[-1:]])
    length = ends[:-1] - ends[1:]
    mass, along, upward = body[0, 0], body[1, 5], body[0, 4]
    roll, pitch, yaw, product = body[3, 3], body[4, 4], body[5, 5], -body[3, 5]
    lengthwise, across, height = (
        s / 2.0 for s in (pitch + yaw - roll, roll + yaw - pitch, roll + pitch - yaw)
    )
    powers = x ** np.arange(3)[:, None]
    masses = length * (
        np.linalg.solve(powers * length @ powers.T, [mass, along, lengthwise]) @ powers
    )
    line = np.linalg.solve([[mass, along], [along, lengthwise]], [upward, product])
    middle = line[0] + line[1] * x
    width, spread = across / mass, (height - masses @ middle**2) / mass
    if min(mass, masses.min(), width, spread) <= 0.0:
        raise GeometryError(
            "the sprung mass beside frame and cab can't be spread along the frame: its mass, "
            "centre and moments of inertia need negative masses or distances"
        )
    places = [
        (along, side * np.sqrt(width), height + up * np.sqrt(spread))
        for along, height in zip(x, middle, strict=True)
        for side in (1.0, -1.0)
        for up in (1.0, -1.0)
    ]
    return np.repeat(masses / 4.0, 4), np.array(places)
