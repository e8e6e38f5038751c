"""Matrices of the truck: frame, cab, what else is sprung, payload and axles.

Coordinates are those of the frame's nodes, then heave, pitch and roll of the cab, heave and roll of
the front and of the rear axle.  All of them are zero where springs and tires carry nothing.

The sprung mass that is neither frame nor cab is spread along the frame, and so is the payload, as
point masses on rigid brackets across both rails, see `Motions.body`.  Springs and dampers act on
one rail, at the end of a rigid arm.  Nothing on the road holds the truck along, across and in yaw:
soft springs at the sprung centre do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import GeometryError, InputError
from vehiclemor.multibody.flexible_truck.frame import Frame, Layout, layout, planes
from vehiclemor.multibody.flexible_truck.motions import (
    AXLES,
    CAB,
    Motions,
    moved,
    points_of_the_rest,
)
from vehiclemor.multibody.structure import Structure

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Finest mesh of shells (m): there are no more elements than a bay of beams can have.
FINEST = 0.02
# Gauss points of the payload along and across the platform: exact for its moments of inertia.
ALONG, ACROSS = 8, 4
AXES = ("roll", "pitch", "yaw")


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
    places = planes(values)
    for (name, x), (behind, further) in pairwise(places.items()):
        if not x > further:
            raise GeometryError(f"the frame's {name} ({x:g} m) is not ahead of its {behind}")
    end = values["frame_length"] - values["front_overhang"]
    time = values["frame_damping_ratio"] / (np.pi * values["frame_damping_frequency"])
    if values["cab_mount_damping"] < time * values["cab_mount_stiffness"]:
        raise GeometryError(
            "the cab's mounts must damp at least as much as the frame for their stiffness"
        )
    if not values["platform_front"] < values["platform_rear"] <= end + 1e-9:
        raise GeometryError("the platform must end behind its front, and not behind the frame")


def structure(values: Mapping[str, Any]) -> Structure:
    """Matrices of the truck; another payload needs no new frame."""
    given = [(name, np.ravel(value)) for name, value in values.items() if name != "payload"]
    truck = _unladen(tuple((name, tuple(map(float, value))) for name, value in given))
    payload = float(values["payload"])
    return Structure(
        truck.structure.mass + payload * truck.payload,
        truck.structure.stiffness,
        truck.structure.damping_time,
        truck.structure.dampers,
        truck.structure.ports,
        truck.structure.load + payload * truck.payload_load,
        truck.structure.outputs,
    )


@dataclass(frozen=True, eq=False)
class _Truck:
    """A truck without payload, and what a kilogram of payload adds."""

    structure: Structure
    payload: csc_array
    payload_load: np.ndarray


@lru_cache(maxsize=8)
def _unladen(given: tuple[tuple[str, tuple[float, ...]], ...]) -> _Truck:
    from scipy.sparse import block_diag, csc_array, eye_array

    v: dict[str, Any] = {n: np.array(x) if len(x) > 1 else sum(x) for n, x in given}
    check(v)
    ladder = layout(v)
    meshed = _meshed(ladder, v)
    free = eye_array(CAB + AXLES)
    # s = spread q, as `Motions` has it.
    spread = csc_array(block_diag([meshed.sections, free]))
    none = csc_array((CAB + AXLES,) * 2)
    motions = Motions(ladder, (0.0, -v["wheelbase"]))
    mass, load = _cab_and_axles(motions, v)
    brackets, bracket_load = _brackets(motions, v, meshed, mass)
    payload, payload_load = _payload(motions, v)
    mounts = _mounts(motions, v)
    time = v["frame_damping_ratio"] / (np.pi * v["frame_damping_frequency"])
    held = v["cab_mount_stiffness"] * mounts.T @ mounts + _held(motions, v)
    damped = v["cab_mount_damping"] - time * v["cab_mount_stiffness"]
    ports = _ports(motions, v)
    outputs = _outputs(motions, v, meshed.strains, spread, ports)
    frame_load = meshed.mass @ np.tile([0.0, 0.0, -v["gravity"], 0.0, 0.0, 0.0], len(meshed.nodes))

    def on_nodes(matrix: np.ndarray) -> csc_array:
        return csc_array(spread.T @ csc_array(matrix) @ spread)

    structure = Structure(
        mass=csc_array(block_diag([meshed.mass, none])) + on_nodes(mass + brackets),
        stiffness=csc_array(block_diag([meshed.stiffness, none])) + on_nodes(held),
        damping_time=time,
        dampers=csc_array(spread.T @ csc_array(np.sqrt(damped) * mounts.T)),
        ports=csc_array(spread.T @ csc_array(ports.T)),
        load=np.append(frame_load, np.zeros(CAB + AXLES)) + spread.T @ (load + bracket_load),
        outputs=outputs,
    )
    return _Truck(structure, on_nodes(payload), spread.T @ payload_load)


def _meshed(ladder: Layout, v: Mapping[str, Any]) -> Frame:
    from vehiclemor.multibody.flexible_truck import beams, shells

    if v["shell_size"]:
        return shells.frame(ladder, v["shell_size"])

    return beams.frame(ladder, int(v["elements_per_bay"]))


def _cab_place(v: Mapping[str, Any]) -> np.ndarray:
    return np.array([v["cab_place"], 0.0, v["cab_height"]])


def _mount_motions(motions: Motions, v: Mapping[str, Any]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Motion (6, N) of the rails under the cab's four mounts, and their places."""
    ladder = motions.ladder
    found = []
    for x in (planes(v)["front cab mounts"], planes(v)["rear cab mounts"]):
        station = int(np.argmin(np.abs(ladder.stations - x)))
        for side, y in enumerate(ladder.sides):
            found.append((motions.rail(station, side), np.array([x, y, ladder.height])))
    return found


def _mounts(motions: Motions, v: Mapping[str, Any]) -> np.ndarray:
    """Lengthening (4, N) of the cab's mounts, which stand on the rails."""
    heave, pitch, roll = motions.cab
    return np.array(
        [
            heave + place[1] * roll - (place[0] - v["cab_place"]) * pitch - rail[2]
            for rail, place in _mount_motions(motions, v)
        ]
    )


def _cab_and_axles(motions: Motions, v: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Mass (N, N) and weight (N,) of cab and axles.

    The cab follows the four mounts along, across and in yaw.
    """
    heave, pitch, roll = motions.cab
    rails = [rail for rail, _ in _mount_motions(motions, v)]
    mean = np.mean(rails, axis=0)
    yaw = (rails[0][1] + rails[1][1] - rails[2][1] - rails[3][1]) / (4.0 * v["cab_mount_distance"])
    above = v["cab_height"] - motions.ladder.height
    cab = np.array([mean[0] + above * pitch, mean[1] - above * roll, heave, roll, pitch, yaw])
    inertias = [v[f"cab_{axis}_inertia"] for axis in AXES]
    mass = cab.T @ np.diag([v["cab_mass"]] * 3 + inertias) @ cab
    weight = -v["gravity"] * v["cab_mass"] * heave
    for rear, end in enumerate(("front", "rear")):
        axle = motions.axle(bool(rear))
        mass += axle.T @ np.diag([v[f"{end}_axle_mass"], v[f"{end}_axle_inertia"]]) @ axle
        weight = weight - v["gravity"] * v[f"{end}_axle_mass"] * axle[0]
    return mass, weight


def _centre(v: Mapping[str, Any]) -> np.ndarray:
    return np.array([-v["sprung_distance"], 0.0, v["sprung_height"]])


def _brackets(
    motions: Motions, v: Mapping[str, Any], meshed: Frame, others: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mass (N, N) and weight (N,) of what is sprung beside frame and cab."""
    centre = _centre(v)
    moving = np.concatenate([moved(np.eye(6), place - centre) for place in meshed.nodes])
    rigid = motions.rigid(centre, _cab_place(v))
    sprung = np.diag([v["sprung_mass"]] * 3 + [v[f"{axis}_inertia"] for axis in AXES])
    body = sprung - moving.T @ meshed.mass @ moving - rigid.T @ others @ rigid
    masses, places = points_of_the_rest(motions.ladder.stations - centre[0], body)
    return _points(motions, v["gravity"], masses, places + centre)


def _payload(motions: Motions, v: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Mass (N, N) and weight (N,) of one kilogram, uniform over the platform's area."""
    (along, shares), (across, parts) = (np.polynomial.legendre.leggauss(k) for k in (ALONG, ACROSS))
    front, rear = v["platform_front"], v["platform_rear"]
    x = -(front + rear + (rear - front) * along) / 2.0
    y = v["platform_width"] / 2.0 * across
    places = np.array([(a, b, v["platform_height"]) for a in x for b in y])
    return _points(motions, v["gravity"], np.outer(shares, parts).ravel() / 4.0, places)


def _points(
    motions: Motions, gravity: float, masses: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mass (N, N) and weight (N,) of point masses (points,) at places (points, 3)."""
    rows = np.array([motions.body(place) for place in places])
    mass = np.einsum("p,pki,pkj->ij", masses, rows, rows, optimize=True)
    return mass, -gravity * masses @ rows[:, 2]


def _held(motions: Motions, v: Mapping[str, Any]) -> np.ndarray:
    """Stiffness (N, N) of the soft springs at the sprung centre: along, across and in yaw."""
    centre, ahead = _centre(v), np.array([1.0, 0.0, 0.0])
    along, across, _ = motions.body(centre)
    rows = np.array([along, across, motions.body(centre + ahead)[1] - across])
    inertias = np.array([v["sprung_mass"], v["sprung_mass"], v["yaw_inertia"]])
    return (rows.T * (inertias * (2.0 * np.pi * v["hold_frequency"]) ** 2)) @ rows


def _ports(motions: Motions, v: Mapping[str, Any]) -> np.ndarray:
    """Deflections (12, N) of the ports: compressions of springs and dampers, wheels' heights."""
    ladder = motions.ladder
    rows = []
    for kind in ("spring", "damper", "wheel"):
        for rear, end in enumerate(("front", "rear")):
            heave, roll = motions.axle(bool(rear))
            station = int(np.argmin(np.abs(ladder.stations + rear * v["wheelbase"])))
            for side, y in enumerate(ladder.sides):
                if kind == "wheel":
                    rows.append(heave + np.sign(y) * v["wheel_offset"] * roll)
                    continue
                place = np.sign(y) * v[f"{end}_{kind}_offset"]
                rail = moved(motions.rail(station, side), np.array([0.0, place - y, 0.0]))
                rows.append(heave + place * roll - rail[2])
    return np.array(rows)


def _outputs(
    motions: Motions, v: Mapping[str, Any], strains: csc_array, spread: csc_array, ports: np.ndarray
) -> tuple[csc_array, csc_array, csc_array, csc_array]:
    """Cq, Cv, Ca and Cf in the order of `OUTPUTS`."""
    from scipy.sparse import csc_array, hstack, vstack

    size, gauged = spread.shape[1], strains.shape[0]  # pyright: ignore[reportOptionalSubscript]
    x, y, _ = v["driver"]
    heave, pitch, roll = motions.cab
    half = v["platform_width"] / 2.0
    corners = [
        motions.body(np.array([-v[f"platform_{end}"], side * half, v["platform_height"]]))[2]
        for end in ("front", "rear")
        for side in (1.0, -1.0)
    ]
    heights = np.array([heave + y * roll - (x - v["cab_place"]) * pitch, *corners])
    front, rear = motions.plane(0.0), motions.plane(-v["wheelbase"])
    angles = [
        (rear[2] - front[2]) / v["wheelbase"],
        (front[3] + rear[3]) / 2.0,
        front[3] - rear[3],
    ]
    count, own = len(heights), 3 + 4
    before, after = csc_array((3 * count + own, 12)), csc_array((gauged, 12))
    moving = csc_array(heights) @ spread
    still = csc_array(moving.shape)
    others = csc_array(np.array([*angles, *ports[:4]])) @ spread
    strained = hstack([strains, csc_array((gauged, CAB + AXLES))])
    lower = csc_array((own + 4 + gauged, size))
    loads = csc_array((4, size))
    forces = np.zeros((4, 12))
    forces[:, 8:] = np.eye(4)
    return (
        csc_array(vstack([moving, still, still, others, loads, strained])),
        csc_array(vstack([still, moving, still, lower])),
        csc_array(vstack([still, still, moving, lower])),
        csc_array(vstack([before, csc_array(forces), after])),
    )
