"""Ladder frame of space beams: two nodes, 6 coordinates a node.

Timoshenko's stiffness with St. Venant's torsion, consistent mass of the cubic shape functions
(Przemieniecki, *Theory of Matrix Structural Analysis*, 1968, 5.6 and 11.4).  Axial forces act at
the centroid, transverse ones at the shear centre; the nodes stand on the webs.  Left out: warping,
which stiffens open sections in torsion, the rotary inertia of bending, and half a cross member's
width of the rails at either end.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vehiclemor.multibody.flexible_truck import frame as ladder

# Deflection and slope at the first end, then at the second, of a beam of length 1.
BENDING = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
SHEAR = np.array([[0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1]])
INERTIA = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
# From axes x, y, z to those of a beam along y.
ALONG_Y = np.kron(np.eye(4), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def matrices(
    lengths: np.ndarray, section: ladder.Section, material: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (elements, 12, 12) of beams along x with upright webs, z up.

    Rows: displacements x, y, z and rotations about them at the first end, then at the second.
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
        own = (slice(None), *np.ix_([row, row + 6], [row, row + 6]))
        stiffness[own] = rigidity / length * [[1, -1], [-1, 1]]
        mass[own] = inertia * length / 6.0 * [[2, 1], [1, 2]]
    # A slope about y lowers the far end.
    for rows, second_moment, shear_area, sign in (
        ([2, 4, 8, 10], section.upright, section.shear_areas[0], -1.0),
        ([1, 5, 7, 11], section.sideways, section.shear_areas[1], 1.0),
    ):
        own = (slice(None), *np.ix_(rows, rows))
        rigidity = modulus * second_moment
        shear = 12.0 * rigidity / (shear_modulus * shear_area * length**2)
        slopes = np.where([False, True, False, True], sign * length, 1.0)
        scale = slopes * slopes.swapaxes(1, 2)
        stiffness[own] = rigidity / (length**3 * (1.0 + shear)) * scale * (BENDING + shear * SHEAR)
        mass[own] = density * section.area * length / 420.0 * scale * INERTIA
    return stiffness, mass


def at_nodes(axial: float, across: float) -> np.ndarray:
    """Motion (12, 12) of a beam's line by that of its nodes.

    `axial` and `across` are the places y in m, relative to the nodes, of the points whose
    displacement is along the beam, and across it.
    """
    end, shear = ladder.levers(np.array([[0.0, axial, 0.0], [0.0, across, 0.0]]))
    end[2] = shear[2]
    return np.kron(np.eye(2), end)


def frame(layout: ladder.Layout, elements_per_bay: int) -> ladder.Frame:
    """Ladder frame of beams with so many elements a bay, and as many a cross member."""
    from scipy.sparse import block_diag, csc_array, diags_array, eye_array

    k, rail, height, stations = elements_per_bay, layout.rail, layout.height, layout.stations
    lines = ladder.divided(stations, np.full(len(stations) - 1, k))
    widths = ladder.divided(layout.sides[::-1], np.array([k]))
    # Rails run forward, cross members to the left.
    grids = [np.array([(x, y, height) for x in lines[::-1]]) for y in layout.sides]
    grids += [np.array([(stations[n], y, height) for y in widths]) for n in layout.crossings]
    nodes, numbers = ladder.joined(grids)
    coordinates = eye_array(6 * len(nodes)).tocsr()
    stiffness, mass, ends = [], [], []
    for line, (places, own) in enumerate(zip(grids, numbers, strict=True)):
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        section, bent, moved = layout.cross, ALONG_Y, ALONG_Y
        if line < 2:
            # Flanges point inward.
            inward = -np.sign(layout.sides[line])
            centre, shear = inward * rail.centroid, inward * rail.shear_centre
            section, bent, moved = rail, at_nodes(centre, shear), at_nodes(centre, centre)
        elastic, inertia = matrices(lengths, section, layout.material)
        stiffness += list(bent.T @ elastic @ bent)
        mass += list(moved.T @ inertia @ moved)
        ends += list(pairwise(own))
    chosen = coordinates[np.add.outer(6 * np.ravel(ends), np.arange(6)).ravel()]
    webs = np.stack([own[::-1] for own in numbers[:2]], axis=1)
    along = 6 * np.repeat(webs, 2)
    up = diags_array(np.tile([0.5, -0.5], webs.size) * rail.height)
    return ladder.Frame(
        mass=csc_array(chosen.T @ block_diag(mass) @ chosen),
        stiffness=csc_array(chosen.T @ block_diag(stiffness) @ chosen),
        nodes=nodes,
        sections=csc_array(coordinates[np.add.outer(6 * webs[::k], np.arange(6)).ravel()]),
        strains=ladder.strains(
            lines,
            csc_array(coordinates[along] + up @ coordinates[along + 4]),
            [(stations[n], stations[n + 1]) for n in layout.gauged],
        ),
    )
