"""Ladder frame of flat shells: `Quad4` of pyfe3d, 6 coordinates a node.

Rails and cross members are plates along the middle lines of their sections, joined where these
meet.  Turning about a plate's normal is stiff but has no inertia: the mass matrix is singular.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.multibody.flexible_truck import frame as ladder

if TYPE_CHECKING:
    from scipy.sparse import csc_array


def assembled(
    nodes: np.ndarray,
    plates: Sequence[tuple[np.ndarray, float]],
    material: tuple[float, float, float],
) -> tuple[csc_array, csc_array]:
    """Mass and stiffness (n, n) of plates; `InputError` where pyfe3d is missing.

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
    count = sum((len(own) - 1) * (own.shape[1] - 1) for own, _ in plates)
    sizes = data.KC0_SPARSE_SIZE, data.M_SPARSE_SIZE
    entries = [(np.zeros(n, INT), np.zeros(n, INT), np.zeros(n)) for n in np.multiply(sizes, count)]
    number = 0
    for own, thickness in plates:
        plate = isotropic_plate(thickness=thickness, E=modulus, nu=poisson_ratio, rho=density)
        corners = 6 * np.stack([own[:-1, :-1], own[1:, :-1], own[1:, 1:], own[:-1, 1:]], axis=-1)
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


def frame(layout: ladder.Layout, size: float) -> ladder.Frame:
    """Ladder frame of shells with elements of about some size (m)."""
    from scipy.sparse import csc_array, eye_array, vstack

    def meshed(corners: list[float]) -> np.ndarray:
        return ladder.divided(corners, np.maximum(1, np.round(np.abs(np.diff(corners)) / size)))

    def drawn(lines: np.ndarray, section: np.ndarray) -> np.ndarray:
        """Nodes (lines, points, 3) of a section (points, 2) drawn along x."""
        return np.array([[(x, y, z + layout.height) for y, z in section] for x in lines])

    rail, cross, up = layout.rail, layout.cross, layout.rail.height / 2.0
    # Places x (stations, 2) of the cross members' webs, twice the same where there is none.
    webs = np.stack([layout.stations, layout.stations], axis=1)
    webs[layout.crossings] += np.array([0.5, -0.5]) * cross.width
    lines = meshed(np.unique(webs)[::-1].tolist())
    outer, tip = layout.sides[0], layout.sides[0] - rail.width
    inward, upward, between = meshed([outer, tip]), meshed([-up, up]), meshed([tip, -tip])
    whole = np.concatenate([inward[:-1], between, -inward[-2::-1]])
    flanges = [[(y, z) for y in inward[1:]] for z in (-up, up)]
    section = np.array([*flanges[0][::-1], *((outer, z) for z in upward), *flanges[1]])
    grids = [drawn(lines, section * [sign, 1.0]) for sign in (1.0, -1.0)]
    for front, rear in webs[layout.crossings]:
        pair = [drawn(whole, np.array([(x, z) for z in upward])) for x in (front, rear)]
        grids += [web[..., [1, 0, 2]] for web in pair]
        inner = lines[(lines < front + ladder.SAME) & (lines > rear - ladder.SAME)]
        grids += [drawn(inner, np.array([(y, z) for y in between])) for z in (up, -up)]
    nodes, numbers = ladder.joined(grids)
    thickness = [rail.thickness] * 2 + [cross.thickness] * (len(grids) - 2)
    mass, stiffness = assembled(nodes, list(zip(numbers, thickness, strict=True)), layout.material)
    coordinates = eye_array(6 * len(nodes)).tocsr()
    # The motion of a section is that of a rigid one which fits its nodes best, weighted by their
    # share of the middle line; in a cross member's plane the nodes are those of both its webs.
    spans = np.linalg.norm(np.diff(section, axis=0), axis=1)
    shares = np.append(spans, 0.0) + np.append(0.0, spans)
    roots = np.sqrt(np.repeat(np.tile(shares, 2), 3))[:, None]
    sections = []
    for x, pair in zip(layout.stations, webs, strict=True):
        near = np.abs(lines[:, None] - pair).argmin(axis=0)
        for own, y in zip(numbers, layout.sides, strict=False):
            ring = own[near].ravel()
            rigid = ladder.levers(nodes[ring] - [x, y, layout.height])[:, :3].reshape(-1, 6)
            moved = coordinates[np.add.outer(6 * ring, np.arange(3)).ravel()]
            sections.append(csc_array(np.linalg.pinv(roots * rigid) * roots.T) @ moved)
    # Upper corner, then the lower one.
    corners = np.stack([own[:, [-len(inward), len(inward) - 1]] for own in numbers[:2]], axis=1)
    return ladder.Frame(
        mass,
        stiffness,
        nodes,
        csc_array(vstack(sections)),
        ladder.strains(
            lines,
            csc_array(coordinates[6 * corners.ravel()]),
            [(webs[n, 1], webs[n + 1, 0]) for n in layout.gauged],
        ),
    )
