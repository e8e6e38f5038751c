"""The ladder frame as its meshes share it: sections, stations, and what a mesh hands on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Farther apart than this (m) two stations have another one between them.
BAY = 0.7
# Bays in whose middle the strains are: four places each, see `Frame.strains`.
GAUGED = (3, 5, 7, 9, 10)


@dataclass(frozen=True)
class Channel:
    """Thin-walled C section by its middle line; lengths in m.

    Formulas: Young and Budynas, *Roark's Formulas for Stress and Strain* (7th ed.), tables A.1,
    9.2 and 10.2.  Distances along the flanges are from the web, toward the flanges positive.
    """

    height: float
    flange: float
    thickness: float

    @property
    def area(self) -> float:
        """Area in m2."""
        return self.thickness * (self.height + 2.0 * self.flange)

    @property
    def centroid(self) -> float:
        """Distance of the centroid."""
        return self.flange**2 / (2.0 * self.flange + self.height)

    @property
    def shear_centre(self) -> float:
        """Distance of the shear centre, which lies on the other side of the web."""
        return -3.0 * self.flange**2 / (6.0 * self.flange + self.height)

    @property
    def upright(self) -> float:
        """Second moment of area in m4 that resists bending along the web."""
        return self.thickness * self.height**2 * (self.height / 12.0 + self.flange / 2.0)

    @property
    def sideways(self) -> float:
        """Second moment of area in m4 that resists bending along the flanges."""
        flanges = 2.0 * self.thickness * self.flange**3 / 3.0
        return flanges - self.area * self.centroid**2

    @property
    def torsion(self) -> float:
        """St. Venant's torsion constant in m4."""
        return self.thickness**2 * self.area / 3.0

    @property
    def shear_areas(self) -> tuple[float, float]:
        """Areas in m2 that carry shear along the web and along the flanges."""
        return self.thickness * self.height, 5.0 / 3.0 * self.thickness * self.flange


@dataclass(frozen=True)
class Box:
    """Thin-walled closed section by its middle line; lengths in m.  Formulas as for `Channel`."""

    height: float
    width: float
    thickness: float
    # Double symmetry: both centres are in the middle.
    centroid = shear_centre = 0.0

    @property
    def area(self) -> float:
        """Area in m2."""
        return 2.0 * self.thickness * (self.height + self.width)

    @property
    def upright(self) -> float:
        """Second moment of area in m4 that resists bending along the height."""
        return self.thickness * self.height**2 * (self.height / 6.0 + self.width / 2.0)

    @property
    def sideways(self) -> float:
        """Second moment of area in m4 that resists bending along the width."""
        return self.thickness * self.width**2 * (self.width / 6.0 + self.height / 2.0)

    @property
    def torsion(self) -> float:
        """Bredt's torsion constant in m4."""
        enclosed = self.height * self.width
        return 2.0 * self.thickness * enclosed**2 / (self.height + self.width)

    @property
    def shear_areas(self) -> tuple[float, float]:
        """Areas in m2 that carry shear along the height and along the width."""
        return 2.0 * self.thickness * self.height, 2.0 * self.thickness * self.width


@dataclass(frozen=True)
class Layout:
    """Geometry and material of the ladder: two rails, cross members at some of the stations.

    Attributes
    ----------
    stations
        x (stations,) in m, from front to rear.
    crossings
        Numbers of the stations with a cross member.
    spacing, height
        Distance of the rails' webs, height of their middle; in m.
    modulus, poisson_ratio, density
        In N/m2, 1, kg/m3.
    """

    stations: np.ndarray
    crossings: tuple[int, ...]
    spacing: float
    height: float
    rail: Channel
    cross: Box
    modulus: float
    poisson_ratio: float
    density: float

    @cached_property
    def sides(self) -> np.ndarray:
        """Places y (2,) of the left and the right web in m."""
        return np.array([0.5, -0.5]) * self.spacing

    @cached_property
    def gauges(self) -> np.ndarray:
        """Places x of the strains in m: in the middle between cross members' webs and stations."""
        half = np.zeros(len(self.stations))
        half[list(self.crossings)] = self.cross.width / 2.0
        clear = np.array([self.stations - half, self.stations + half])
        return np.array([(clear[0, k] + clear[1, k + 1]) / 2.0 for k in GAUGED])

    def lines(self, parts: list[int]) -> np.ndarray:
        """Places x of a mesh that divides every bay into some parts."""
        ends = zip(self.stations[:-1], self.stations[1:], parts, strict=True)
        inner = [np.linspace(a, b, k, endpoint=False) for a, b, k in ends]
        return np.concatenate([*inner, self.stations[-1:]])


@dataclass(frozen=True, eq=False)
class Frame:
    """Matrices of a meshed frame with n coordinates, 6 a node.

    Attributes
    ----------
    mass, stiffness
        (n, n), of the frame alone, free.
    nodes
        Places (nodes, 3) in m.
    sections
        (stations * 2 * 6, n): three displacements and three rotations of the rails at every
        station, left and right, at the middle of the web.
    strains
        (20, n): axial strains at the corners of web and flange, by place, left and right, upper
        and lower; shells have that of the element, or the two, around the place.
    """

    mass: csc_array
    stiffness: csc_array
    nodes: np.ndarray
    sections: csc_array
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


def layout(values: Mapping[str, Any]) -> Layout:
    """Layout from the parameters; every plane but the front mounts' has a cross member.

    All sections are as high as the rails: their middle lines meet.
    """
    places = list(planes(values).values())
    parts = [int(np.ceil((a - b) / BAY - 1e-9)) for a, b in pairwise(places)]
    numbers = np.concatenate([[0], np.cumsum(parts)])
    between = [
        np.linspace(a, b, k, endpoint=False)
        for (a, b), k in zip(pairwise(places), parts, strict=True)
    ]
    thickness, depth = values["rail_thickness"], values["rail_depth"] - values["rail_thickness"]
    rail = Channel(depth, values["rail_flange"] - thickness / 2.0, thickness)
    return Layout(
        stations=np.concatenate([*between, places[-1:]]),
        crossings=tuple(int(n) for n in np.delete(numbers, 1)),
        spacing=values["rail_spacing"],
        height=values["frame_height"],
        rail=rail,
        cross=Box(depth, values["cross_width"], values["cross_thickness"]),
        modulus=values["modulus"],
        poisson_ratio=values["poisson_ratio"],
        density=values["density"],
    )


def around(lines: np.ndarray, x: float) -> tuple[int, int]:
    """Numbers of the mesh lines next to a place, in front of it and behind it."""
    return int(np.nonzero(lines > x + 1e-6)[0][-1]), int(np.nonzero(lines < x - 1e-6)[0][0])
