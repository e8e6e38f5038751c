"""Ride of a two-axle truck on a flexible ladder frame: sparse matrices and twelve ports.

M q'' + (W W' + d K) q' + K q = load + B f(w, w', u), w = B' q: small motion about the upright truck
at constant speed, gravity along z.  Masses, springs, dampers and stops are those of Project
Chrono's MAN KAT1 5 t, which has a rigid frame; frame, cab, platform and tires' rates are ours.  The
real frame is closed and stiffer.  Axes: ISO 8855.

Coordinates are those of the frame's nodes, then heave, pitch and roll of the cab, heave and roll of
the front and of the rear axle.  All of them are zero where springs and tires carry nothing.

The sprung mass that is neither frame nor cab is a homogeneous block on rigid brackets across both
rails, and so is the payload, a flat one, see `Motions.body`.  Springs and dampers act on one rail,
at the end of a rigid arm.  Nothing on the road holds the truck along, across and in yaw: soft
springs at the sprung centre do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import GeometryError, InputError
from vehiclemor.multibody.definition import ModelDefinition, Structure
from vehiclemor.multibody.flexible_truck.frame import Layout, levers, meshed, planes
from vehiclemor.multibody.quantities import TIRE_LOADS, WHEELS, declared, equations_of

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Travel of the springs in m from end to end of the stops' table: nothing is known beyond.
TRAVEL = 0.37
SMALL_ANGLE = 0.2
# In N: the tire is pressed by its section height, 0.375 m.
LARGEST_LOAD = 100_788.0
# Coordinates of cab and axles.
OTHERS = 7
# Finest mesh of shells (m): there are no more elements than a bay of beams can have.
FINEST = 0.02
AXES = ("roll", "pitch", "yaw")
# Left and right.
SIDES = (1.0, -1.0)
ENDS = ("front", "rear")
# Two rails, two flanges, five bays.
STRAINS = 20
DECLARED = declared("flexible_truck")


def check(values: Mapping[str, Any]) -> None:
    """Raise `InputError` or `GeometryError` where there is no such truck or mesh of it."""
    parts, size = values["elements_per_bay"], values["shell_size"]
    if parts != int(parts):
        raise InputError(f"elements_per_bay is {parts:g}; a whole number from 1 to 64 is allowed")
    if 0.0 < size < FINEST:
        raise InputError(f"shell_size is {size:g} m; allowed: 0 for beams, or from {FINEST} m on")
    if not values["shortest_length"] < values["longest_length"]:
        raise GeometryError("the springs' shortest_length is not below their longest_length")
    if not values["rail_thickness"] < min(values["rail_flange"], values["rail_depth"]):
        raise GeometryError("rail_thickness is not below rail_flange and rail_depth")
    if not 2.0 * values["rail_flange"] < values["rail_spacing"]:
        raise GeometryError("the rails' flanges overlap: rail_flange is above half rail_spacing")
    for (name, x), (behind, further) in pairwise(planes(values).items()):
        if not x > further:
            raise GeometryError(f"the frame's {name} ({x:g} m) is not ahead of its {behind}")
    if values["cab_mount_damping"] < damping_time(values) * values["cab_mount_stiffness"]:
        raise GeometryError(
            "the cab's mounts must damp at least as much as the frame for their stiffness"
        )
    end = values["frame_length"] - values["front_overhang"]
    if not values["platform_front"] < values["platform_rear"] <= end + 1e-9:
        raise GeometryError("the platform must end behind its front, and not behind the frame")


def damping_time(values: Mapping[str, Any]) -> float:
    """Damping of the frame over its stiffness in s, from the ratio at a frequency."""
    return values["frame_damping_ratio"] / (np.pi * values["frame_damping_frequency"])


def structure(values: Mapping[str, Any]) -> Structure:
    """Matrices of the truck; another payload needs no new frame."""
    given: dict[str, Any] = {n: tuple(x) if np.ndim(x) else float(x) for n, x in values.items()}
    payload = given.pop("payload")
    truck, added, upward = _unladen(tuple(given.items()))
    mass = truck.mass + payload * added
    return replace(truck, mass=mass, load=-given["gravity"] * (mass @ upward))


@lru_cache(maxsize=8)
def _unladen(given: tuple[tuple[str, Any], ...]) -> tuple[Structure, csc_array, np.ndarray]:
    """A truck without payload, the mass of a kilogram of payload, and a heave (n,) of all."""
    from scipy.sparse import block_diag, csc_array, eye_array

    v = dict(given)
    ladder = Layout(v)
    frame = meshed(ladder, v)
    # s = spread q, as `Motions` has it.
    spread = csc_array(block_diag([frame.sections, eye_array(OTHERS)]))
    size = 6 * len(frame.nodes) + OTHERS
    for matrix, rows in ((frame.mass, size), (frame.stiffness, size), (frame.strains, STRAINS)):
        matrix.resize(rows, size)

    def on_nodes(rows: list[np.ndarray]) -> csc_array:
        """Motions (k, n) by the coordinates from those by s."""
        return csc_array(csc_array(np.array(rows)) @ spread)

    def weighted(rows: np.ndarray, weights: Any) -> csc_array:
        """Matrix (n, n) of masses or springs by the motions (k, N) they take part in."""
        return csc_array(spread.T @ csc_array((rows.T * weights) @ rows) @ spread)

    def points(masses: np.ndarray, positions: np.ndarray) -> csc_array:
        """Matrix (n, n) of point masses."""
        return weighted(np.concatenate(moving.body(positions)), np.repeat(masses, 3))

    moving = Motions(ladder)
    centre = np.array([-v["sprung_distance"], 0.0, v["sprung_height"]])
    cab = np.array([v["cab_place"], 0.0, v["cab_height"]])
    # Motion of all that is sprung as one body, about its centre.
    rigid = np.zeros((size, 6))
    rigid[:-OTHERS] = np.concatenate(levers(frame.nodes - centre))
    rigid[-OTHERS:-4] = levers((cab - centre)[None])[0, [2, 4, 3]]
    upward = rigid[:, 2].copy()
    upward[[-4, -2]] = 1.0
    sprung = [v["sprung_mass"]] * 3 + [v[f"{axis}_inertia"] for axis in AXES]
    axles = [v[f"{end}_axle_{kind}"] for end in ENDS for kind in ("mass", "inertia")]
    mass = frame.mass + weighted(*_cab(moving, v))
    mass += points(*_rest(np.diag(sprung) - rigid.T @ mass @ rigid, centre))
    mass += weighted(np.concatenate(list(moving.axles.values())), axles)
    along, across, _ = moving.body(centre[None])[0]
    hold = np.array([sprung[0], sprung[0], sprung[-1]]) * (2.0 * np.pi * v["hold_frequency"]) ** 2
    reach = v["cab_mount_distance"]
    feet = [(end, x, y) for end, x in zip(ENDS, (reach, -reach), strict=True) for y in ladder.sides]
    mounts = [moving.in_cab(x, y) - moving.rail(f"{end} cab mounts", y) for end, x, y in feet]
    stiffness = frame.stiffness + weighted(np.array(mounts), [v["cab_mount_stiffness"]] * 4)
    stiffness += weighted(np.array([along, across, moving.yaw]), hold)
    time = damping_time(v)
    damped = v["cab_mount_damping"] - time * v["cab_mount_stiffness"]
    ports = on_nodes(_ports(moving, v))
    heights, angles = _heights(moving, v), [moving.pitch, moving.roll, moving.twist]
    truck = Structure(
        mass=mass,
        stiffness=stiffness,
        damping_time=time,
        dampers=csc_array(np.sqrt(damped) * on_nodes(mounts).T),
        ports=csc_array(ports.T),
        load=np.zeros(size),
        outputs=_outputs(on_nodes(heights), on_nodes(angles), ports, frame.strains),
    )
    front, rear = v["platform_front"], v["platform_rear"]
    shares, positions = block(np.array([rear - front, v["platform_width"], 0.0]) / 2.0)
    middle = [-(front + rear) / 2.0, 0.0, v["platform_height"]]
    return truck, points(shares, positions + middle), upward


def _cab(moving: Motions, v: Mapping[str, Any]) -> tuple[np.ndarray, list[float]]:
    """Motion (6, N) and inertia of the cab; along, across and in yaw it follows its mounts."""
    heave, pitch, roll = moving.cab
    above = v["cab_height"] - moving.ladder.height
    front, rear = (moving.middles[moving.ladder.planes[f"{end} cab mounts"]] for end in ENDS)
    along, across = (front + rear)[:2] / 2.0 + above * np.array([pitch, -roll])
    yaw = (front[1] - rear[1]) / (2.0 * v["cab_mount_distance"])
    inertias = [v[f"cab_{axis}_inertia"] for axis in AXES]
    return np.array([along, across, heave, roll, pitch, yaw]), [v["cab_mass"]] * 3 + inertias


def _rest(body: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Point masses (points,) in kg and their positions: a block with a body's inertia (6, 6)."""
    mass, first = body[0, 0], np.array([body[1, 5], body[2, 3], body[0, 4]])
    second = np.eye(3) * np.trace(body[3:, 3:]) / 2.0 - body[3:, 3:]
    squares, axes = np.linalg.eigh(mass * second - np.outer(first, first))
    if min(mass, *squares) <= 0.0:
        raise GeometryError(
            "the sprung mass beside frame and cab can't be spread along the frame: its mass, "
            "centre and moments of inertia need negative masses or distances"
        )
    shares, positions = block(np.sqrt(3.0 * squares) / mass)
    return mass * shares, centre + first / mass + positions @ axes.T


def _ports(moving: Motions, v: Mapping[str, Any]) -> list[np.ndarray]:
    """Deflections (12, N) of the ports: compressions of springs and dampers, wheels' heights."""
    kinds = [(kind, end, side) for kind in ("spring", "damper") for end in ENDS for side in SIDES]
    ports = [(end, side * v[f"{end}_{kind}_offset"]) for kind, end, side in kinds]
    pressed = [moving.axle(end, y) - moving.rail(f"{end} axle", y) for end, y in ports]
    return pressed + [moving.axle(e, side * v["wheel_offset"]) for e in ENDS for side in SIDES]


def _heights(moving: Motions, v: Mapping[str, Any]) -> list[np.ndarray]:
    """Heights (5, N) of the driver's seat and of the platform's corners."""
    (x, y, _), half, level = v["driver"], v["platform_width"] / 2.0, v["platform_height"]
    corners = [(-v[f"platform_{end}"], side * half, level) for end in ENDS for side in SIDES]
    return [moving.in_cab(x - v["cab_place"], y), *moving.body(np.array(corners))[:, 2]]


def _outputs(
    heights: csc_array, angles: csc_array, ports: csc_array, strains: csc_array
) -> tuple[csc_array, csc_array, csc_array, csc_array]:
    """Cq, Cv, Ca and Cf in the order of the outputs."""
    from scipy.sparse import csc_array, eye_array

    names = [quantity.name for quantity in DECLARED["outputs"]]

    def placed(rows: Any, first: str) -> csc_array:
        """Rows of some outputs, from the first of them on, among those of all."""
        return csc_array(eye_array(len(names), rows.shape[0], k=-names.index(first)) @ rows)

    return (
        placed(heights, "driver_height")
        + placed(angles, "pitch")
        + placed(ports[:4], "deflection_FL")
        + placed(strains, "strain_1"),
        placed(heights, "driver_speed"),
        placed(heights, "driver_acceleration"),
        placed(eye_array(4, 12, k=8), "Fz_FL"),
    )


class Motions:
    """Motion of points of the truck as rows over s (N,), which both meshes have.

    s are three displacements and three rotations of the rails at every station, left and right,
    then heave, pitch and roll of the cab, then heave and roll of the front and of the rear axle.
    """

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

    def body(self, positions: np.ndarray) -> np.ndarray:
        """Displacements (points, 3, N) of points (points, 3) of what rests on the frame.

        Bodies and platform are rigid in their plane: along, across and in pitch and yaw they follow
        the frame at the axles.  Their heights follow the rails under them.
        """
        from scipy.interpolate import make_interp_spline

        x, y, z = positions.T[:, :, None]
        stations = self.ladder.stations[::-1]
        share, up = (self.ahead - x) / (self.ahead - self.behind), z - self.ladder.height
        rails = make_interp_spline(stations, self.middles[::-1, 2:], k=1)(positions[:, 0])
        along = (self.front[0] + self.rear[0]) / 2.0 + up * self.pitch - y * self.yaw
        ends = self.front[1] - up * self.front[3], self.rear[1] - up * self.rear[3]
        across = (1.0 - share) * ends[0] + share * ends[1]
        return np.stack([along, across, rails[:, 0] + y * rails[:, 1]], axis=1)


def block(half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares (points,) and positions (points, 3) of points that have a homogeneous block's moments.

    The block has its sides along the axes; `half` (3,) are half its lengths in m.
    """
    points, weights = np.polynomial.legendre.leggauss(8)
    shares = np.array(list(product(weights / 2.0, repeat=3))).prod(axis=1)
    return shares, np.array(list(product(points, repeat=3))) * half


DEFINITION = ModelDefinition(
    name="flexible_truck",
    kind="structural",
    summary="truck on a flexible ladder frame, beams or shells, ride over rough roads (structural)",
    maneuver="road",
    coordinates=(),
    **DECLARED,
    structure=structure,
    online=("payload",),
    derive=equations_of("flexible_truck"),
    check=check,
    validity={
        **{f"road_{wheel}": (-0.5, 0.5) for wheel in WHEELS},
        **{f"road_{wheel}_dot": (-10.0, 10.0) for wheel in WHEELS},
        **{f"deflection_{wheel}": (-TRAVEL, TRAVEL) for wheel in WHEELS},
        **dict.fromkeys(TIRE_LOADS, (0.0, LARGEST_LOAD)),
        **dict.fromkeys(("pitch", "roll"), (-SMALL_ANGLE, SMALL_ANGLE)),
    },
    loads=TIRE_LOADS,
    tabled_outputs=("driver_acceleration", "pitch", "roll", "twist", *TIRE_LOADS, "strain_1"),
    main_outputs=("driver_acceleration", "twist", "Fz_FL"),
)
