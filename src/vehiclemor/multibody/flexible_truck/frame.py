"""The ladder frame, meshed by space beams or by flat shells: 6 coordinates a node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Two stations are no farther apart than this (m).
BAY = 0.7
# Nodes nearer than this (m) are one.
SAME = 1e-6
# Deflection and slope at the first end, then at the second, of a beam of length 1.
BENDING = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
SHEAR = np.array([[0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1]])
INERTIA = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
# From axes x, y, z to those of a beam along y.
ALONG_Y = np.kron(np.eye(4), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


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
        positions = planes(values)
        parts = np.ceil(-np.diff(list(positions.values())) / BAY - 1e-9).astype(int)
        # x in m, from front to rear, and numbers of those of axles, cab mounts, gearbox and ends.
        self.stations = divided(list(positions.values()), parts)
        self.planes = dict(zip(positions, [0, *np.cumsum(parts).tolist()], strict=True))
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
    nodes: np.ndarray  # Positions (nodes, 3) in m.
    # (stations * 2 * 6, n): three displacements and three rotations of the rails at every station,
    # left and right, at the middle of the web.
    sections: csc_array
    # (20, n): axial strains at the corners of web and flange, by bay, left and right, upper and
    # lower; from the displacements along x at the ends of the elements in the bay's middle.
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


def line_of_points(*coordinates: Any) -> np.ndarray:
    """Points (points, dimensions) along one axis: its coordinates are an array, others numbers."""
    return np.stack(np.broadcast_arrays(*coordinates), axis=-1)


def joined(grids: Sequence[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Nodes (nodes, 3) of some grids (..., 3), and their numbers (...): equal points are joined."""
    points = np.concatenate([grid.reshape(-1, 3) for grid in grids])
    keys = np.round(points / SAME).astype(np.int64)
    _, first, numbers = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    ends = np.cumsum([grid.size // 3 for grid in grids])[:-1]
    pieces = np.split(numbers.ravel(), ends)
    return points[first], [n.reshape(g.shape[:-1]) for n, g in zip(pieces, grids, strict=True)]


def levers(arms: np.ndarray) -> np.ndarray:
    """Motion (points, 6, 6) at the ends of rigid arms (points, 3) by that at their beginning."""
    motions = np.tile(np.eye(6), (len(arms), 1, 1))
    motions[:, :3, 3:] = np.cross(np.eye(3), arms[:, None]).swapaxes(1, 2)
    return motions


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


def beam_matrices(
    lengths: np.ndarray, section: Section, material: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (elements, 12, 12) of beams along x with upright webs, z up.

    Rows: displacements x, y, z and rotations about them at the first end, then at the second.
    Timoshenko's stiffness with St. Venant's torsion, consistent mass of the cubic shape functions
    (Przemieniecki, *Theory of Matrix Structural Analysis*, 1968, 5.6 and 11.4).  Left out: warping,
    which stiffens open sections in torsion, and the rotary inertia of bending.
    """
    modulus, poisson_ratio, density = material
    shear_modulus = modulus / (2.0 * (1.0 + poisson_ratio))
    stiffness, mass = np.zeros((2, len(lengths), 12, 12))
    length = lengths[:, None, None]
    polar = section.upright + section.sideways
    for row, rigidity, inertia in (
        (0, modulus * section.area, density * section.area),
        (3, shear_modulus * section.torsion, density * polar),
    ):
        block = (slice(None), *np.ix_([row, row + 6], [row, row + 6]))
        stiffness[block] = rigidity / length * [[1, -1], [-1, 1]]
        mass[block] = inertia * length / 6.0 * [[2, 1], [1, 2]]
    # A slope about y lowers the far end.
    for rows, second_moment, shear_area, sign in (
        ([2, 4, 8, 10], section.upright, section.shear_areas[0], -1.0),
        ([1, 5, 7, 11], section.sideways, section.shear_areas[1], 1.0),
    ):
        block = (slice(None), *np.ix_(rows, rows))
        rigidity = modulus * second_moment
        shear = 12.0 * rigidity / (shear_modulus * shear_area * length**2)
        slopes = np.where([False, True, False, True], sign * length, 1.0)
        scale = slopes * slopes.swapaxes(1, 2)
        bending = BENDING + shear * SHEAR
        stiffness[block] = rigidity / (length**3 * (1.0 + shear)) * scale * bending
        mass[block] = density * section.area * length / 420.0 * scale * INERTIA
    return stiffness, mass


def at_nodes(axial: float, across: float) -> np.ndarray:
    """Motion (12, 12) of a beam's line by that of its nodes.

    `axial` and `across` are y in m, relative to the nodes, of the points whose displacement is
    along the beam, and across it.
    """
    end, shear = levers(np.array([[0.0, axial, 0.0], [0.0, across, 0.0]]))
    end[2] = shear[2]
    return np.kron(np.eye(2), end)


def frame_of_beams(layout: Layout, elements_per_bay: int) -> Frame:
    """Ladder frame of beams with so many elements a bay, and as many a cross member.

    Axial forces act at the centroid, transverse ones at the shear centre; the nodes stand on the
    webs.  Half a cross member's width of the rails at either end is left out.
    """
    from scipy.sparse import block_diag, csc_array, diags_array, eye_array

    k, rail, height, stations = elements_per_bay, layout.rail, layout.height, layout.stations
    lines = divided(stations, np.full(len(stations) - 1, k))
    widths = divided(layout.sides[::-1], np.array([k]))
    # Rails run forward, cross members to the left.
    grids = [line_of_points(lines[::-1], y, height) for y in layout.sides]
    grids += [line_of_points(stations[n], widths, height) for n in layout.crossings]
    nodes, numbers = joined(grids)
    coordinates = eye_array(6 * len(nodes)).tocsr()
    stiffness, mass, ends = [], [], []
    for line, (points, line_nodes) in enumerate(zip(grids, numbers, strict=True)):
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        section, bent, moved = layout.cross, ALONG_Y, ALONG_Y
        if line < 2:
            # Flanges point inward.
            inward = -np.sign(layout.sides[line])
            centre, shear = inward * rail.centroid, inward * rail.shear_centre
            section, bent, moved = rail, at_nodes(centre, shear), at_nodes(centre, centre)
        elastic, inertia = beam_matrices(lengths, section, layout.material)
        stiffness += list(bent.T @ elastic @ bent)
        mass += list(moved.T @ inertia @ moved)
        ends += list(pairwise(line_nodes))
    chosen = coordinates[np.add.outer(6 * np.ravel(ends), np.arange(6)).ravel()]
    webs = np.stack([rail_nodes[::-1] for rail_nodes in numbers[:2]], axis=1)
    along = 6 * np.repeat(webs, 2)
    up = diags_array(np.tile([0.5, -0.5], webs.size) * rail.height)
    return Frame(
        mass=csc_array(chosen.T @ block_diag(mass) @ chosen),
        stiffness=csc_array(chosen.T @ block_diag(stiffness) @ chosen),
        nodes=nodes,
        sections=csc_array(coordinates[np.add.outer(6 * webs[::k], np.arange(6)).ravel()]),
        strains=strains(
            lines,
            csc_array(coordinates[along] + up @ coordinates[along + 4]),
            [(stations[n], stations[n + 1]) for n in layout.gauged],
        ),
    )


def shell_matrices(
    nodes: np.ndarray,
    plates: Sequence[tuple[np.ndarray, float]],
    material: tuple[float, float, float],
) -> tuple[csc_array, csc_array]:
    """Mass and stiffness (n, n) of plates, `Quad4` of pyfe3d; `InputError` where it is missing.

    Turning about a plate's normal is stiff but has no inertia: the mass matrix is singular.

    A plate is the numbers of its nodes (rows, columns) and its thickness in m.
    """
    from scipy.sparse import coo_array, csc_array

    try:
        from pyfe3d import INT, Quad4, Quad4Data, Quad4Probe
        from pyfe3d.shellprop_utils import isotropic_plate
    except ImportError as error:
        raise InputError(
            'shell_size needs pyfe3d; install it by: pip install "vehiclemor[shells]"'
        ) from error
    modulus, poisson_ratio, density = material
    data, probe, flat = Quad4Data(), Quad4Probe(), np.ascontiguousarray(nodes).ravel()
    count = sum((len(grid) - 1) * (grid.shape[1] - 1) for grid, _ in plates)
    sizes = data.KC0_SPARSE_SIZE, data.M_SPARSE_SIZE
    entries = [(np.zeros(n, INT), np.zeros(n, INT), np.zeros(n)) for n in np.multiply(sizes, count)]
    number = 0
    for grid, thickness in plates:
        plate = isotropic_plate(thickness=thickness, E=modulus, nu=poisson_ratio, rho=density)
        around = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        corners = 6 * np.stack(around, axis=-1)
        for four in corners.reshape(-1, 4).tolist():
            element = Quad4(probe)
            element.c1, element.c2, element.c3, element.c4 = four
            element.init_k_KC0, element.init_k_M = number * sizes[0], number * sizes[1]
            element.update_rotation_matrix(flat)
            element.update_probe_xe(flat)
            element.update_KC0(*entries[0], plate)
            element.update_M(*entries[1], plate)
            number += 1
    shape = (6 * len(nodes),) * 2
    stiffness, mass = (csc_array(coo_array((v, (i, j)), shape)) for i, j, v in entries)
    for matrix in (stiffness, mass):
        matrix.eliminate_zeros()
    return csc_array((mass + mass.T) / 2.0), csc_array((stiffness + stiffness.T) / 2.0)


def frame_of_shells(layout: Layout, size: float) -> Frame:
    """Ladder frame of shells with elements of about some size (m).

    Rails and cross members are plates along the middle lines of their sections, joined where these
    meet.
    """
    from scipy.sparse import csc_array, eye_array, vstack

    def meshed(corners: list[float]) -> np.ndarray:
        return divided(corners, np.maximum(1, np.round(np.abs(np.diff(corners)) / size)))

    def drawn(lines: np.ndarray, section: np.ndarray) -> np.ndarray:
        """Nodes (lines, points, 3) of a section (points, 2) drawn along x."""
        nodes = np.empty((len(lines), len(section), 3))
        nodes[:, :, 0] = lines[:, None]
        nodes[:, :, 1:] = section + np.array([0.0, layout.height])
        return nodes

    rail, cross, up = layout.rail, layout.cross, layout.rail.height / 2.0
    # x (stations, 2) of the cross members' webs, twice the same where there is none.
    webs = np.stack([layout.stations, layout.stations], axis=1)
    webs[layout.crossings] += np.array([0.5, -0.5]) * cross.width
    lines = meshed(np.unique(webs)[::-1].tolist())
    outer, tip = layout.sides[0], layout.sides[0] - rail.width
    inward, upward, between = meshed([outer, tip]), meshed([-up, up]), meshed([tip, -tip])
    across = np.concatenate([inward[:-1], between, -inward[-2::-1]])
    lower = line_of_points(inward[:0:-1], -up)
    upper = line_of_points(inward[1:], up)
    section = np.concatenate([lower, line_of_points(outer, upward), upper])
    grids = [drawn(lines, section * [sign, 1.0]) for sign in (1.0, -1.0)]
    for front, rear in webs[layout.crossings]:
        pair = [drawn(across, line_of_points(x, upward)) for x in (front, rear)]
        grids += [web[..., [1, 0, 2]] for web in pair]
        inner = lines[(lines < front + SAME) & (lines > rear - SAME)]
        grids += [drawn(inner, line_of_points(between, z)) for z in (up, -up)]
    nodes, numbers = joined(grids)
    thickness = [rail.thickness] * 2 + [cross.thickness] * (len(grids) - 2)
    mass, stiffness = shell_matrices(
        nodes, list(zip(numbers, thickness, strict=True)), layout.material
    )
    coordinates = eye_array(6 * len(nodes)).tocsr()
    # The motion of a section is that of a rigid one which fits its nodes best, weighted by their
    # share of the middle line; in a cross member's plane the nodes are those of both its webs.
    spans = np.linalg.norm(np.diff(section, axis=0), axis=1)
    shares = np.append(spans, 0.0) + np.append(0.0, spans)
    roots = np.sqrt(np.repeat(np.tile(shares, 2), 3))[:, None]
    sections = []
    for x, pair in zip(layout.stations, webs, strict=True):
        near = np.abs(lines[:, None] - pair).argmin(axis=0)
        for grid, y in zip(numbers, layout.sides, strict=False):
            ring = grid[near].ravel()
            rigid = levers(nodes[ring] - [x, y, layout.height])[:, :3].reshape(-1, 6)
            moved = coordinates[np.add.outer(6 * ring, np.arange(3)).ravel()]
            sections.append(csc_array(np.linalg.pinv(roots * rigid) * roots.T) @ moved)
    # Upper corner, then the lower one.
    columns = [-len(inward), len(inward) - 1]
    corners = np.stack([grid[:, columns] for grid in numbers[:2]], axis=1)
    return Frame(
        mass,
        stiffness,
        nodes,
        csc_array(vstack(sections)),
        strains(
            lines,
            csc_array(coordinates[6 * corners.ravel()]),
            [(webs[n, 1], webs[n + 1, 0]) for n in layout.gauged],
        ),
    )


def meshed(layout: Layout, values: Mapping[str, Any]) -> Frame:
    """Ladder frame of shells of `shell_size`, or of beams where this is 0."""
    size, parts = values["shell_size"], int(values["elements_per_bay"])
    return frame_of_shells(layout, size) if size else frame_of_beams(layout, parts)
