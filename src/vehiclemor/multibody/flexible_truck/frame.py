"""The ladder frame as its meshes share it: sections, stations, and what a mesh hands on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Two stations are no farther apart than this (m).
BAY = 0.7
# Nodes nearer than this (m) are one.
SAME = 1e-6


class Section:
    """Thin-walled section of one web, a C, or of two, a box; lengths of its middle line in m.

    Formulas: Young and Budynas, *Roark's Formulas for Stress and Strain* (7th ed.), tables A.1,
    9.2 and 10.2.
    """

    def __init__(self, h: float, b: float, t: float, webs: int) -> None:
        # Of the webs, of the two flanges, of all.
        self.height, self.width, self.thickness = h, b, t
        self.area = t * (webs * h + 2.0 * b)
        # Distances from the (first) web, toward the flanges positive: this and the shear centre.
        self.centroid = t * (b**2 + (webs - 1) * h * b) / self.area
        # Second moments of area in m4 that resist bending along the webs and along the flanges.
        self.upright = t * h**2 * (webs * h / 12.0 + b / 2.0)
        about_web = t * (2.0 * b**3 / 3.0 + (webs - 1) * h * b**2)
        self.sideways = about_web - self.area * self.centroid**2
        # Shear areas in m2, along webs and flanges; torsion in m4, St. Venant's or Bredt's.
        if webs == 1:
            self.shear_centre = -3.0 * b**2 / (6.0 * b + h)
            self.shear_areas = t * h, 5.0 / 3.0 * t * b
            self.torsion = t**2 * self.area / 3.0
        else:
            self.shear_centre = b / 2.0
            self.shear_areas = 2.0 * t * h, 2.0 * t * b
            self.torsion = 2.0 * t * (h * b) ** 2 / (h + b)


class Layout:
    """Geometry and material of the ladder: two rails, a cross member in every plane but one."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        places = planes(values)
        parts = np.ceil(-np.diff(list(places.values())) / BAY - 1e-9).astype(int)
        # x in m, from front to rear, and numbers of those of axles, cab mounts, gearbox and ends.
        self.stations = divided(list(places.values()), parts)
        self.planes = dict(zip(places, [0, *np.cumsum(parts).tolist()], strict=True))
        # Numbers of the stations with a cross member.
        self.crossings = [n for name, n in self.planes.items() if name != "front cab mounts"]
        front, gearbox, rear = (self.planes[n] for n in ("front axle", "gearbox", "rear axle"))
        # Numbers of five bays with strains: next to axles and gearbox, and between.
        self.gauged = [front, gearbox - 1, (gearbox + rear - 1) // 2, rear - 1, rear]
        # y of the left and the right rail's web, and z of its middle; in m.
        self.sides = np.array([0.5, -0.5]) * values["rail_spacing"]
        self.height = values["frame_height"]
        thick, depth = values["rail_thickness"], values["rail_depth"] - values["rail_thickness"]
        # All are as high as the rails, so that their middle lines meet.
        self.rail = Section(depth, values["rail_flange"] - thick / 2.0, thick, webs=1)
        self.cross = Section(depth, values["cross_width"], values["cross_thickness"], webs=2)
        # Modulus in N/m2, Poisson's ratio, density in kg/m3.
        self.material = values["modulus"], values["poisson_ratio"], values["density"]


@dataclass(frozen=True, eq=False)
class Frame:
    """Matrices of a meshed frame with n coordinates, 6 a node."""

    # (n, n), of the frame alone, free.
    mass: csc_array
    stiffness: csc_array
    nodes: np.ndarray  # Places (nodes, 3) in m.
    # (stations * 2 * 6, n): three displacements and three rotations of the rails at every station,
    # left and right, at the middle of the web.
    sections: csc_array
    # (20, n): axial strains at the corners of web and flange, by place, left and right, upper and
    # lower; from the displacements along x at the ends of the elements around the place.
    strains: csc_array


def planes(values: Mapping[str, Any]) -> dict[str, float]:
    """Cross members' planes and cab mounts by x in m, from front to rear."""
    front, reach = values["front_overhang"], values["cab_mount_distance"]
    # The outermost cross members end with the rails.
    half = values["cross_width"] / 2.0
    return {
        "front end": front - half,
        "front cab mounts": values["cab_place"] + reach,
        "front axle": 0.0,
        "rear cab mounts": values["cab_place"] - reach,
        "gearbox": -values["gearbox_distance"],
        "rear axle": -values["wheelbase"],
        "rear end": front - values["frame_length"] + half,
    }


def divided(corners: Sequence[float] | np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Points from corner to corner, with so many parts between them."""
    numbers = np.concatenate([[0], np.cumsum(parts)])
    return np.interp(np.arange(numbers[-1] + 1), numbers, corners)


def joined(grids: Sequence[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Nodes (nodes, 3) of some grids (..., 3), and their numbers (...): equal places are one."""
    places = np.concatenate([grid.reshape(-1, 3) for grid in grids])
    keys = np.round(places / SAME).astype(np.int64)
    _, first, numbers = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    ends = np.cumsum([grid.size // 3 for grid in grids])[:-1]
    pieces = np.split(numbers.ravel(), ends)
    return places[first], [n.reshape(g.shape[:-1]) for n, g in zip(pieces, grids, strict=True)]


def levers(arms: np.ndarray) -> np.ndarray:
    """Motion (points, 6, 6) at the ends of rigid arms (points, 3) by that at their beginning."""
    found = np.tile(np.eye(6), (len(arms), 1, 1))
    found[:, :3, 3:] = np.cross(np.eye(3), arms[:, None]).swapaxes(1, 2)
    return found


def strains(lines: np.ndarray, corners: csc_array, bays: list[tuple[float, float]]) -> csc_array:
    """Strains (20, n) in the middle of five bays by their ends x: means over one or two elements.

    `corners` (lines * 4, n) are displacements along x at the mesh's lines x, see `Frame.strains`.
    """
    from scipy.sparse import csc_array, vstack

    rows, by_line = [], corners.tocsr()
    for x in np.mean(bays, axis=1):
        front, rear = np.flatnonzero(lines > x + SAME)[-1], np.flatnonzero(lines < x - SAME)[0]
        ends = [by_line[4 * line : 4 * line + 4] for line in (front, rear)]
        rows.append((ends[0] - ends[1]) / (lines[front] - lines[rear]))
    return csc_array(vstack(rows))
