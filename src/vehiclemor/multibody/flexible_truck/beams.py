"""Ladder frame of space beams: two nodes, 6 coordinates a node.

Timoshenko's stiffness with St. Venant's torsion, consistent mass of the cubic shape functions
(Przemieniecki, *Theory of Matrix Structural Analysis*, 1968, 5.6 and 11.4).  Axial forces act at
the centroid, transverse ones at the shear centre; the nodes stand on the webs.  Left out: warping,
which stiffens open sections in torsion, the rotary inertia of bending, and
half a cross member's width of the rails at either end.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.multibody.flexible_truck.frame import Box, Channel, Frame, Layout, around

if TYPE_CHECKING:
    from scipy.sparse import csc_array

UP = np.array([0.0, 0.0, 1.0])


def _pair(matrix: np.ndarray, rows: list[int], entries: list[list[np.ndarray]]) -> None:
    """Set a symmetric block from its upper triangle, row by row."""
    for i, row in enumerate(entries):
        for j, value in enumerate(row, start=i):
            matrix[:, rows[i], rows[j]] = matrix[:, rows[j], rows[i]] = value


def _bending(l: np.ndarray, shear: np.ndarray) -> list[list[np.ndarray]]:  # noqa: E741
    """Stiffness over E I / (l^3 (1 + shear)), upper triangle; deflection, its slope, twice."""
    one = np.ones_like(l)
    return [
        [12 * one, 6 * l, -12 * one, 6 * l],
        [(4 + shear) * l**2, -6 * l, (2 - shear) * l**2],
        [12 * one, -6 * l],
        [(4 + shear) * l**2],
    ]


def _inertia(l: np.ndarray) -> list[list[np.ndarray]]:  # noqa: E741
    """Consistent mass over rho A l / 420, upper triangle; deflection, its slope, twice."""
    one = np.ones_like(l)
    return [
        [156 * one, 22 * l, 54 * one, -13 * l],
        [4 * l**2, 13 * l, -3 * l**2],
        [156 * one, -22 * l],
        [4 * l**2],
    ]


def matrices(
    lengths: np.ndarray,
    section: Channel | Box,
    modulus: float,
    poisson_ratio: float,
    density: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (elements, 12, 12) of beams along x with upright webs, z up.

    Rows: displacements x, y, z and rotations about them at the first end, then at the second.
    """
    shear_modulus = modulus / (2.0 * (1.0 + poisson_ratio))
    stiffness, mass = np.zeros((2, len(lengths), 12, 12))
    line = [[1.0 / lengths, -1.0 / lengths], [1.0 / lengths]]
    thirds = [[lengths / 3.0, lengths / 6.0], [lengths / 3.0]]
    polar = section.upright + section.sideways
    for row, rigidity, weight in (
        (0, modulus * section.area, density * section.area),
        (3, shear_modulus * section.torsion, density * polar),
    ):
        _pair(stiffness, [row, row + 6], [[rigidity * v for v in values] for values in line])
        _pair(mass, [row, row + 6], [[weight * v for v in values] for values in thirds])
    web, flanges = section.shear_areas
    # A slope about y lowers the far end: its rows change sign with the length.
    for rows, inertia, area, sign in (
        ([2, 4, 8, 10], section.upright, web, -1.0),
        ([1, 5, 7, 11], section.sideways, flanges, 1.0),
    ):
        rigidity = modulus * inertia
        shear = 12.0 * rigidity / (shear_modulus * area * lengths**2)
        factor = rigidity / (lengths**3 * (1.0 + shear))
        weight = density * section.area * lengths / 420.0
        bent, moved = _bending(sign * lengths, shear), _inertia(sign * lengths)
        _pair(stiffness, rows, [[factor * v for v in values] for values in bent])
        _pair(mass, rows, [[weight * v for v in values] for values in moved])
    return stiffness, mass


def _at_nodes(along: np.ndarray, axial: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Motion (elements, 12, 12) of the beams' lines in their own axes from that of the nodes.

    `along` (elements, 3) are unit vectors; `axial` and `across` the places (3,) relative to the
    nodes whose displacement is along the beam, and across it.
    """
    sideways = np.cross(UP, along)
    axes = np.stack([along, sideways, np.broadcast_to(UP, along.shape)], axis=1)
    node = np.zeros((len(along), 6, 6))
    node[:, :3, :3] = node[:, 3:, 3:] = axes
    node[:, 0, 3:] = -(sideways @ axial)[:, None] * axes[:, 2]
    node[:, 2, 3:] = (sideways @ across)[:, None] * axes[:, 0]
    both = np.zeros((len(along), 12, 12))
    both[:, :6, :6] = both[:, 6:, 6:] = node
    return both


def frame(layout: Layout, elements_per_bay: int) -> Frame:
    """Ladder frame of beams with so many elements a bay, and as many a cross member."""
    from scipy.sparse import coo_array, csc_array

    k = elements_per_bay
    lines = layout.lines([k] * (len(layout.stations) - 1))
    nodes = [np.array([x, y, layout.height]) for x in lines for y in layout.sides]
    numbers = np.arange(len(nodes)).reshape(-1, 2)
    left = np.array([0.0, -1.0, 0.0])
    groups: list[tuple[np.ndarray, Channel | Box, np.ndarray]] = [
        (np.stack([row[:-1], row[1:]], axis=1), layout.rail, sign * left)
        for row, sign in zip(numbers.T, (1.0, -1.0), strict=True)
    ]
    for crossing in layout.crossings:
        first, last = numbers[crossing * k]
        inner = np.arange(len(nodes), len(nodes) + k - 1)
        share = np.arange(1, k)[:, None] / k
        nodes += list(nodes[first] + share * (nodes[last] - nodes[first]))
        row = np.array([first, *inner, last])
        groups.append((np.stack([row[:-1], row[1:]], axis=1), layout.cross, 0.0 * left))
    places = np.array(nodes)
    material = layout.modulus, layout.poisson_ratio, layout.density
    parts = []
    for ends, section, flanges in groups:
        span = places[ends[:, 1]] - places[ends[:, 0]]
        lengths = np.linalg.norm(span, axis=1)
        stiffness, mass = matrices(lengths, section, *material)
        centre, shear = section.centroid * flanges, section.shear_centre * flanges
        along = span / lengths[:, None]
        bent, moved = _at_nodes(along, centre, shear), _at_nodes(along, centre, centre)
        own = (6 * ends[:, :, None] + np.arange(6)).reshape(len(ends), 12)
        parts.append(
            (
                own,
                bent.transpose(0, 2, 1) @ stiffness @ bent,
                moved.transpose(0, 2, 1) @ mass @ moved,
            )
        )
    own = np.concatenate([part[0] for part in parts])
    rows, columns = np.repeat(own, 12, axis=1).ravel(), np.tile(own, 12).ravel()
    size = 6 * len(places)
    found = [
        csc_array(
            coo_array((np.concatenate([p[n] for p in parts]).ravel(), (rows, columns)), (size,) * 2)
        )
        for n in (1, 2)
    ]
    chosen = (6 * numbers[::k, :, None] + np.arange(6)).ravel()
    picked = coo_array(
        (np.ones(len(chosen)), (np.arange(len(chosen)), chosen)), (len(chosen), size)
    )
    return Frame(
        found[1], found[0], places, csc_array(picked), _strains(layout, lines, numbers, size)
    )


def _strains(layout: Layout, lines: np.ndarray, numbers: np.ndarray, size: int) -> csc_array:
    """Axial strains at the corners of web and flange, by the section's forces at the place."""
    from scipy.sparse import csc_array, lil_array

    rail, rows = layout.rail, lil_array((4 * len(layout.gauges), size))
    for number, x in enumerate(layout.gauges):
        front, rear = around(lines, x)
        # Two elements, half of each, where the place is a node.
        for element, side, upper in product(range(front, rear), range(2), range(2)):
            ends = lines[element + 1], lines[element]
            length, along = ends[1] - ends[0], (2.0 * x - sum(ends)) / (ends[1] - ends[0])
            slope = rail.upright / (rail.shear_areas[0] * length**2)
            bend = 3.0 * along / (1.0 + 24.0 * (1.0 + layout.poisson_ratio) * slope)
            z, weight = (upper - 0.5) * -rail.height / length, 1.0 / (rear - front)
            offset = rail.shear_centre * -np.sign(layout.sides[side])
            for end, sign in enumerate((-1.0, 1.0)):
                node, row = 6 * numbers[element + 1 - end, side], 4 * number + 2 * side + upper
                lift = weight * z * bend * 2.0 * sign / length
                rows[row, node] += weight * sign / length
                rows[row, node + 2] += lift
                rows[row, node + 3] += lift * offset
                rows[row, node + 4] += weight * z * (sign + bend)
    return csc_array(rows)
