"""Ladder frame of flat shells: `Quad4` of pyfe3d, 6 coordinates a node.

Rails and cross members are plates along the middle lines of their sections, joined where these
meet.  Turning about a plate's normal is stiff but has no inertia: the mass matrix is singular.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.multibody.flexible_truck.frame import Frame, Layout, around

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Nodes nearer than this (m) are one.
SAME = 1e-6


def divided(corners: list[float], size: float) -> np.ndarray:
    """Points from corner to corner, divided into parts of about some size."""
    parts = [max(1, round(abs(b - a) / size)) for a, b in pairwise(corners)]
    between = [
        np.linspace(a, b, k, endpoint=False)
        for (a, b), k in zip(pairwise(corners), parts, strict=True)
    ]
    return np.append(np.concatenate(between), corners[-1])


class Plates:
    """Plates of rectangles: nodes at the same place are one."""

    def __init__(self) -> None:
        self._grids: list[tuple[np.ndarray, float]] = []

    def add(self, grid: np.ndarray, thickness: float) -> None:
        """Add a plate by its nodes (rows, columns, 3) in m."""
        self._grids.append((grid, thickness))

    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes (nodes, 3), corners (elements, 4) and thickness (elements,)."""
        places = np.concatenate([grid.reshape(-1, 3) for grid, _ in self._grids])
        _, first, numbers = np.unique(
            np.round(places / SAME).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        corners, thickness, start = [], [], 0
        for grid, thin in self._grids:
            rows, columns = grid.shape[:2]
            own = numbers[start : start + rows * columns].reshape(rows, columns)
            quads = [own[:-1, :-1], own[1:, :-1], own[1:, 1:], own[:-1, 1:]]
            corners.append(np.stack(quads, axis=-1).reshape(-1, 4))
            thickness.append(np.full(len(corners[-1]), thin))
            start += rows * columns
        return places[first], np.concatenate(corners), np.concatenate(thickness)


def assembled(
    mesh: tuple[np.ndarray, np.ndarray, np.ndarray],
    modulus: float,
    poisson_ratio: float,
    density: float,
) -> tuple[csc_array, csc_array]:
    """Mass and stiffness (n, n) of a mesh, see `Plates`; `InputError` where pyfe3d is missing."""
    from scipy.sparse import coo_array, csc_array

    try:
        from pyfe3d import INT, Quad4, Quad4Data, Quad4Probe
        from pyfe3d.shellprop_utils import isotropic_plate
    except ImportError as error:
        raise InputError(
            'shell_size needs pyfe3d; install it by: pip install "vehiclemor[shells]"'
        ) from error
    nodes, corners, thickness = mesh
    plates: dict[float, Any] = {
        float(thin): isotropic_plate(thickness=thin, E=modulus, nu=poisson_ratio, rho=density)
        for thin in np.unique(thickness)
    }
    data, probe, flat = Quad4Data(), Quad4Probe(), np.ascontiguousarray(nodes).ravel()
    sizes = data.KC0_SPARSE_SIZE, data.M_SPARSE_SIZE
    entries = [
        (np.zeros(n, INT), np.zeros(n, INT), np.zeros(n)) for n in np.multiply(sizes, len(corners))
    ]
    for number, (own, thin) in enumerate(zip(6 * corners, thickness.tolist(), strict=True)):
        element = Quad4(probe)
        element.c1, element.c2, element.c3, element.c4 = own.tolist()
        element.init_k_KC0, element.init_k_M = number * sizes[0], number * sizes[1]
        element.update_rotation_matrix(flat)
        element.update_probe_xe(flat)
        element.update_KC0(*entries[0], plates[thin])
        element.update_M(*entries[1], plates[thin])
    shape = (6 * len(nodes),) * 2
    stiffness, mass = (csc_array(coo_array((v, (i, j)), shape)) for i, j, v in entries)
    for matrix in (stiffness, mass):
        matrix.eliminate_zeros()
    return csc_array((mass + mass.T) / 2.0), csc_array((stiffness + stiffness.T) / 2.0)


def frame(layout: Layout, size: float) -> Frame:
    """Ladder frame of shells with elements of about some size (m)."""
    rail, cross, half = layout.rail, layout.cross, layout.cross.width / 2.0
    places = {float(x) for n, x in enumerate(layout.stations) if n not in layout.crossings}
    boxes = layout.stations[list(layout.crossings)]
    places |= {float(x) + sign * half for x in boxes for sign in (1.0, -1.0)}
    lines = divided(sorted(places, reverse=True), size)
    up = 0.5 * rail.height
    outer, tip = layout.spacing / 2.0, layout.spacing / 2.0 - rail.flange
    inward, upward = divided([outer, tip], size), divided([-up, up], size)
    section = [(y, -up) for y in inward[:0:-1]] + [(outer, z) for z in upward]
    section += [(y, up) for y in inward[1:]]
    plates = Plates()
    for side in (1.0, -1.0):
        plates.add(_grid(lines, np.array(section) * [side, 1.0], layout.height), rail.thickness)
    between = divided([tip, -tip], size)
    whole = np.concatenate([inward[:-1], between, -inward[-2::-1]])
    for x in boxes:
        web = np.array([(y, z) for y in whole for z in upward])
        for edge in (x + half, x - half):
            grid = _grid(np.array([edge]), web, layout.height)
            plates.add(grid.reshape(len(whole), len(upward), 3), cross.thickness)
        inner = lines[(lines < x + half + SAME) & (lines > x - half - SAME)]
        for z in (up, -up):
            flange = np.stack([between, np.full(len(between), z)], axis=1)
            plates.add(_grid(inner, flange, layout.height), cross.thickness)
    mesh = plates.mesh()
    mass, stiffness = assembled(mesh, layout.modulus, layout.poisson_ratio, layout.density)
    sections, strains = _observed(layout, mesh[0], lines, np.array(section))
    return Frame(mass, stiffness, mesh[0], sections, strains)


def _grid(lines: np.ndarray, section: np.ndarray, height: float) -> np.ndarray:
    """Nodes (lines, points, 3) of a section (points, 2) drawn along x."""
    grid = np.empty((len(lines), len(section), 3))
    grid[..., 0], grid[..., 1], grid[..., 2] = lines[:, None], section[:, 0], section[:, 1] + height
    return grid


def _observed(
    layout: Layout, nodes: np.ndarray, lines: np.ndarray, section: np.ndarray
) -> tuple[csc_array, csc_array]:
    """Sections and strains, see `Frame`.

    The motion of a section is that of a rigid one which fits its nodes best, weighted by their
    share of the middle line; in a cross member's plane the nodes are those of both its webs.
    """
    from scipy.sparse import csc_array, lil_array

    size, numbers = (
        6 * len(nodes),
        {tuple(np.round(p / SAME).astype(int)): n for n, p in enumerate(nodes)},
    )

    def node(x: float, y: float, z: float) -> int:
        return numbers[tuple(np.round(np.array([x, y, z + layout.height]) / SAME).astype(int))]

    spans = np.linalg.norm(np.diff(section, axis=0), axis=1)
    shares = (np.append(spans, 0.0) + np.append(0.0, spans)) / 2.0
    sections = lil_array((12 * len(layout.stations), size))
    for station, x in enumerate(layout.stations):
        half = layout.cross.width / 2.0 if station in layout.crossings else 0.0
        for side, sign in enumerate((1.0, -1.0)):
            web = np.array([x, layout.sides[side], layout.height])
            own = [node(e, sign * y, z) for e in (x + half, x - half) for y, z in section]
            rigid = np.concatenate([_moved(p - web) for p in nodes[own]])
            weighted = rigid.T * np.repeat(np.tile(shares, 2), 3)
            fit = np.linalg.solve(weighted @ rigid, weighted)
            columns = (6 * np.array(own)[:, None] + np.arange(3)).ravel()
            for row, values in enumerate(fit, start=6 * (2 * station + side)):
                for column, value in zip(columns, values, strict=True):
                    sections[row, column] += value
    strains = lil_array((4 * len(layout.gauges), size))
    for number, x in enumerate(layout.gauges):
        front, rear = around(lines, x)
        for side, y in enumerate(layout.sides):
            for flange, z in enumerate((0.5 * layout.rail.height, -0.5 * layout.rail.height)):
                row = 4 * number + 2 * side + flange
                for line, sign in ((front, 1.0), (rear, -1.0)):
                    strains[row, 6 * node(lines[line], y, z)] = sign / (lines[front] - lines[rear])
    return csc_array(sections), csc_array(strains)


def _moved(arm: np.ndarray) -> np.ndarray:
    """Displacement (3, 6) at the end of a rigid arm."""
    x, y, z = arm
    return np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
