"""Lines in space of a car, a truck and a suspension, as the outputs of a run place them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

# Histories (frames,) and parameters by name.
Values = Mapping[str, Any]
# For the drawing only: sizes of a car whose parameters have other names, and of bodies (m).
CAR = {"front_axle_distance": 1.2, "rear_axle_distance": 1.4, "front_track": 1.5}
CAR |= {"tire_radius": 0.32, "tire_stiffness": 2e5}
SECTION = ((-0.8, 0.3), (0.8, 0.3), (0.8, 0.8), (0.6, 1.4), (-0.6, 1.4), (-0.8, 0.8), (-0.8, 0.3))
CAB = ((-0.8, 1.2), (1.0, 1.2), (1.0, 2.9), (-0.8, 2.9), (-0.8, 1.2))
OVERHANG, RIM, TRUCK_RADIUS, SPRING, PLATFORM = 0.8, 0.1, 0.6, 0.4, 1.4
SIDES = (1.0, -1.0)


def line(*points: Sequence[Any] | np.ndarray) -> np.ndarray:
    """Lines (frames, points, 3) through points, whose coordinates are numbers or (frames,)."""
    columns = np.broadcast_arrays(*(np.atleast_1d(c) for point in points for c in point))
    return np.stack(columns, -1).reshape(len(columns[0]), -1, 3)


def turned(lines: np.ndarray, axes: str, *angles: Any) -> np.ndarray:
    """Lines turned about axes by angles (frames,) in rad."""
    by = np.stack(np.broadcast_arrays(*(np.atleast_1d(angle) for angle in angles)), -1)
    return lines @ Rotation.from_euler(axes, by).as_matrix().swapaxes(1, 2)


def chained(*pieces: np.ndarray) -> np.ndarray:
    """One line of several."""
    frames = max(len(piece) for piece in pieces)
    return np.concatenate([np.broadcast_to(p, (frames, *p.shape[1:])) for p in pieces], 1)


def joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """All lines as one, with gaps between them."""
    gap = np.full((1, 1, 3), np.nan)
    return chained(*(piece for part in parts for piece in (part, gap)))


def wheel(radius: float) -> np.ndarray:
    """Both rims of a wheel about the y axis, and four lines across its tread."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    x, z = radius * np.cos(angle), radius * np.sin(angle)
    rims = [line(*np.stack([x, 0.0 * x + y, z], -1)) for y in (-RIM, RIM)]
    across = [line((x[k], -RIM, z[k]), (x[k], RIM, z[k])) for k in (0, 10, 20, 30)]
    return joined([*rims, *across])


def car(h: Values, p: Values, magnify: float) -> np.ndarray:
    """Body, wheels on the road, and springs between them."""
    p = CAR | {name: p[name] for name in CAR if name in p}
    still, radius = 0.0 * h["yaw"], p["tire_radius"]
    height = h.get("Z", h.get("z", still))
    front, rear = p["front_axle_distance"], -p["rear_axle_distance"]
    corners = [(x, *c) for x in (front + OVERHANG, rear - OVERHANG) for c in SECTION]
    body = turned(line(*corners), "YX", magnify * h["pitch"], magnify * h["roll"])
    body = body + line((0.0, 0.0, magnify * (height - height[0])))
    # The right sill closes what is seen from above.
    parts = [body, body[:, [1, 8]]]
    for x, axle, first in ((front, "F", 0), (rear, "R", 7)):
        for side, sign, corner in (("L", 0.5, 2), ("R", -0.5, 5)):
            steer = h.get(f"steer_{axle}{side}", h.get("delta", still)) if axle == "F" else still
            load = h.get(f"Fz_{axle}{side}", still)
            rise = magnify * (load[0] - load) / p["tire_stiffness"]
            hub = line((x, sign * p["front_track"], radius + rise))
            parts += [hub + turned(wheel(radius), "Z", steer)]
            parts += [chained(hub, body[:, [first + corner]])]
    place = line((h["longitudinal_position"], h["lateral_position"], 0.0))
    return turned(joined(parts), "Z", h["yaw"]) + place


def truck(h: Values, p: Values, magnify: float) -> np.ndarray:
    """Cab, platform and frame above axles and wheels, and the road below each wheel."""
    parts, rails, plates = [], {}, {}
    for y in (-0.9, 0.9):
        parts += [line(*((x, y, z + magnify * h["driver_height"]) for x, z in CAB))]
    for end, x in (("front", 0.0), ("rear", -p["wheelbase"])):
        names = [f"{end[0].upper()}{side}" for side in "LR"]
        texts = ("Fz_{}", "road_{}", "deflection_{}", "platform_{}_height")
        load, road, bent, plate = (
            magnify * np.array([h[text.format(name)] for name in names]) for text in texts
        )
        axle = road - (load - load[:, :1]) / p["tire_stiffness"]
        # Springs stand on the axle inside of the wheels.
        inside = p[f"{end}_spring_offset"] / p["wheel_offset"]
        rail = TRUCK_RADIUS + axle.mean(0) + inside * (axle - axle.mean(0)) - bent + SPRING
        hubs = [(x, s * p["wheel_offset"], TRUCK_RADIUS + axle[k]) for k, s in enumerate(SIDES)]
        parts += [line(*hubs), *(line(hub) + wheel(TRUCK_RADIUS) for hub in hubs)]
        for k, side in enumerate(SIDES):
            y, z = side * p["wheel_offset"], road[k]
            parts += [line((x - 0.5, y, z), (x + 0.5, y, z))]
            parts += [line((x, y - 0.3, z), (x, y + 0.3, z))]
            rails[end, k] = x, side * p["rail_spacing"] / 2.0, rail[k]
            along, y = -p[f"platform_{end}"], side * p["platform_width"] / 2.0
            plates[end, k] = along, y, PLATFORM + plate[k]
    around = (("front", 0), ("front", 1), ("rear", 1), ("rear", 0), ("front", 0))
    return joined([*parts, *(line(*(c[key] for key in around)) for c in (rails, plates))])


def suspension(h: Values, p: Values, magnify: float) -> np.ndarray:
    """Arms, carrier, tie rod and wheel: outputs say how the carrier stands."""
    eta, tilt = h["second_euler_angle"], np.sin(h["camber"]) / np.cos(h["second_euler_angle"])
    xi = np.arcsin(np.clip(tilt, -1.0, 1.0))
    zeta, centre = h["toe"] + np.arctan2(np.sin(eta) * tilt, np.cos(xi)), p["wheel_centre"]
    moved = line(centre) + magnify * line((h["spindle_x"], h["spindle_y"], h["z"]))

    def carried(part: np.ndarray) -> np.ndarray:
        return turned(part, "ZYX", zeta, eta, xi) + moved

    names = ("upper_ball_joint", "wheel_centre", "lower_ball_joint", "tie_rod_outer")
    joints = [carried(line(p[name] - centre)) for name in names]
    parts = [carried(wheel(CAR["tire_radius"])), chained(*joints)]
    for arm, joint in (("upper", joints[0]), ("lower", joints[2])):
        front, rear = (line(p[f"{arm}_arm_{end}_pivot"]) for end in ("front", "rear"))
        parts += [chained(front, joint, rear)]
    inner = line(p["tie_rod_inner"]) + line((0.0 * eta, h["rack"], 0.0 * eta))
    return joined([*parts, chained(joints[3], inner)])
