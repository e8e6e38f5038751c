"""The flexible truck against closed forms, a ride model by hand, and itself on other meshes."""

import sys
from functools import lru_cache
from importlib.util import find_spec

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import eigsh, splu

from vehiclemor.exceptions import GeometryError, InputError
from vehiclemor.multibody.flexible_truck import frame
from vehiclemor.multibody.flexible_truck.definition import DEFINITION
from vehiclemor.parameters import load_parameters
from vehiclemor.simulation.build import compiled
from vehiclemor.simulation.evaluation import hoisted_constants, values_of

# Frame and cab mounts ten thousand times as stiff.
RIGID = {"payload": 0.0, "modulus": 210e13, "cab_mount_stiffness": 6e8, "cab_mount_damping": 3e5}
STEEL = (210e9, 0.3, 7850.0)
with_shells = pytest.mark.skipif(find_spec("pyfe3d") is None, reason="needs pyfe3d")


def shelled(size, *others):
    return pytest.param({"shell_size": size}, *others, marks=with_shells)


def parameters(**overrides):
    return load_parameters("flexible_truck", DEFINITION.parameters, overrides=overrides)


def values(**overrides):
    return values_of(DEFINITION, parameters(**overrides).flat())


def truck(**overrides):
    DEFINITION.check(values(**overrides))
    return DEFINITION.structure(values(**overrides))


@lru_cache
def ported(overrides):
    equations, _ = compiled(DEFINITION)
    return equations, hoisted_constants(equations, parameters(**dict(overrides)).flat(), [])


def law(w, rates=0.0, u=0.0, **overrides):
    equations, constants = ported(tuple(overrides.items()))
    x, inputs, result = np.zeros((2, 12)), np.zeros(8) + u, np.empty((12, 3))
    x[0], x[1] = w, rates
    equations.call("port_forces", x.ravel(), inputs, constants, result)
    return result


def tangent(structure, f):
    between = structure.ports @ diags_array(f[:, 1]) @ structure.ports.T
    return csc_array(structure.stiffness - between)


def static(structure):
    """Coordinates and forces (12, 3) of the static state."""
    w = np.array([0.14] * 2 + [0.08] * 2 + [0.0] * 4 + [-0.09] * 4)
    for _ in range(8):
        f = law(w)
        load = structure.load + structure.ports @ (f[:, 0] - f[:, 1] * w)
        q = splu(tangent(structure, f)).solve(load)
        w = structure.ports.T @ q
    return q, law(w)


def frequencies(stiffness, mass, count):
    squares = eigsh(stiffness, count, M=mass, sigma=-1.0, return_eigenvectors=False)
    return np.sqrt(np.sort(squares).clip(0.0)) / (2.0 * np.pi)


@pytest.mark.parametrize(
    ("held", "roots"),
    [
        (0, [4.730041, 7.853205, 10.995608, 14.137165, 17.278760]),
        (2, [1.875104, 4.694091, 7.854757, 10.995541, 14.137168]),
    ],
)
@pytest.mark.parametrize("rows", [[1, 5], [2, 4]])
def test_slender_beams_have_the_frequencies_of_euler_and_bernoulli(held, roots, rows):
    section, length, count = frame.Section(0.01, 0.02, 0.001, webs=2), 10.0, 32
    both = frame.beam_matrices(np.full(count, length / count), section, STEEL)
    whole = np.zeros((2, 2 * count + 2, 2 * count + 2))
    own = np.ix_([0, 1], [*rows, *(row + 6 for row in rows)], [*rows, *(row + 6 for row in rows)])
    for k in range(count):
        place = slice(2 * k, 2 * k + 4)
        whole[:, place, place] += np.array([both[0][k], both[1][k]])[own]
    found = scipy.linalg.eigh(*whole[:, held:, held:], eigvals_only=True)[2 - held :][:5]
    inertia = section.sideways if rows[0] == 1 else section.upright
    wave = np.sqrt(STEEL[0] * inertia / (STEEL[2] * section.area)) / length**2
    np.testing.assert_allclose(np.sqrt(found), np.square(roots) * wave, rtol=1e-3)


def test_a_short_beam_bends_and_shears_and_a_shaft_twists_as_in_closed_form():
    section, length, load = frame.Section(0.2, 0.07, 0.006, webs=1), 0.8, 1e3
    stiff = frame.beam_matrices(np.array([length]), section, STEEL)[0][0, 6:, 6:]
    moved = np.linalg.solve(stiff, np.array([0, load, load, load, 0, 0.0]))
    shear_modulus, second_moments = STEEL[0] / 2.6, (section.upright, section.sideways)
    for row, inertia, area in zip((2, 1), second_moments, section.shear_areas, strict=True):
        bent = load * length**3 / (3 * STEEL[0] * inertia)
        assert moved[row] == pytest.approx(bent + load * length / (shear_modulus * area))
    assert moved[3] == pytest.approx(load * length / (shear_modulus * section.torsion))


def test_a_rail_stays_straight_under_a_load_at_its_centroid_and_its_shear_centre():
    section = frame.Section(0.243, 0.0765, 0.007, webs=1)
    moves = frame.at_nodes(section.centroid, section.shear_centre)
    stiff = frame.beam_matrices(np.array([2.0]), section, STEEL)[0][0]
    flexibility = np.linalg.inv((moves.T @ stiff @ moves)[6:, 6:])
    arms = frame.levers(np.array([[0, section.centroid, 0], [0, section.shear_centre, 0]]))
    axial, lifting = arms[0].T @ [1e5, 0, 0, 0, 0, 0], arms[1].T @ [0, 0, 1e3, 0, 0, 0]
    np.testing.assert_allclose((flexibility @ axial)[[1, 2, 3, 4, 5]], 0.0, atol=1e-12)
    np.testing.assert_allclose((flexibility @ lifting)[[0, 1, 3, 5]], 0.0, atol=1e-12)


@with_shells
def test_a_simply_supported_plate_of_shells_has_the_frequencies_of_kirchhoff():
    a, b, thin, count = 1.0, 0.7, 0.004, 40
    x, y = np.meshgrid(np.linspace(0, a, count + 1), np.linspace(0, b, count + 1), indexing="ij")
    nodes, (own,) = frame.joined([np.stack([x, y, 0 * x], axis=-1)])
    mass, stiffness = frame.shell_matrices(nodes, [(own, thin)], STEEL)
    assert mass[2::6, 2::6].sum() == pytest.approx(STEEL[2] * a * b * thin)
    x, y, _ = nodes.T
    at_x, at_y = (x < 1e-9) | (x > a - 1e-9), (y < 1e-9) | (y > b - 1e-9)
    free = np.zeros((len(nodes), 6), bool)
    free[:, 2], free[:, 3], free[:, 4] = ~(at_x | at_y), ~at_x, ~at_y
    own = np.flatnonzero(free)
    found = frequencies(stiffness[own][:, own], mass[own][:, own], 4)
    waves = sorted((m / a) ** 2 + (n / b) ** 2 for m in range(1, 5) for n in range(1, 5))
    bending = np.sqrt(STEEL[0] * thin**2 / (12 * 0.91 * STEEL[2]))
    np.testing.assert_allclose(found, np.pi / 2 * bending * np.array(waves[:4]), rtol=0.01)


def test_static_loads_are_those_of_the_rigid_truck():
    _, f = static(truck(payload=0.0))
    expected = [-21252.7] * 2 + [-13499.2] * 2 + [0.0] * 4 + [26462.8] * 2 + [18772.1] * 2
    np.testing.assert_allclose(f[:, 0], expected, atol=0.1)
    np.testing.assert_allclose(-f[[0, 2], 1], [222275.5, 256061.9], atol=2.0)


def ride_model(v, f):
    """Frequencies of 7 coordinates: heave, pitch, roll, both axles' heave and roll."""
    mass = np.diag(
        [
            *(v["sprung_mass"], v["pitch_inertia"], v["roll_inertia"]),
            *(v["front_axle_mass"], v["front_axle_inertia"]),
            *(v["rear_axle_mass"], v["rear_axle_inertia"]),
        ]
    )
    stiffness = np.zeros((7, 7))
    for rear, end in enumerate(("front", "rear")):
        x = v["sprung_distance"] - rear * v["wheelbase"]
        for sign in (1.0, -1.0):
            axle = np.zeros(7)
            y = sign * v[f"{end}_spring_offset"]
            axle[[3 + 2 * rear, 4 + 2 * rear]] = 1.0, y
            spring = axle - np.array([1.0, -x, y, 0, 0, 0, 0])
            axle[4 + 2 * rear] = sign * v["wheel_offset"]
            stiffness -= f[2 * rear, 1] * np.outer(spring, spring)
            stiffness -= f[8 + 2 * rear, 1] * np.outer(axle, axle)
    return np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)


@pytest.mark.parametrize("mesh", [{}, shelled(0.35)])
def test_a_rigid_frame_gives_the_frequencies_of_seven_coordinates(mesh):
    structure, (_, f) = truck(**RIGID, **mesh), static(truck(payload=0.0))
    found = frequencies(tangent(structure, f), structure.mass, 10)
    stated = [1.19334, 1.41835, 1.56374, 4.97579, 5.11282, 5.21420, 5.25380]
    assert found[:3].max() < 0.0501
    np.testing.assert_allclose(found[3:], ride_model(values(), f), rtol=1e-4)
    np.testing.assert_allclose(found[3:], stated, rtol=1e-4)


def rigid_motions(v):
    """Motions (n, 6) of all that is sprung about its centre, from the mesh's nodes."""
    centre = np.array([-v["sprung_distance"], 0.0, v["sprung_height"]])
    nodes = frame.meshed(frame.Layout(v), v).nodes
    cab = np.array([[v["cab_place"], 0.0, v["cab_height"]]])
    of_nodes, of_cab = frame.levers(nodes - centre), frame.levers(cab - centre)
    return np.concatenate([*of_nodes, of_cab[0, [2, 4, 3]], np.zeros((4, 6))])


@pytest.mark.parametrize("mesh", [{"elements_per_bay": 2.0}, shelled(0.25)])
def test_mass_centre_and_inertia_are_chronos(mesh):
    structure, u = truck(payload=0.0, **mesh), rigid_motions(values(**mesh))
    expected = np.diag([7085.0] * 3 + [3441.0, 28485.0, 29395.0])
    np.testing.assert_allclose(u.T @ structure.mass @ u, expected, atol=1e-3)
    np.testing.assert_allclose(u.T @ structure.load, [0, 0, -7085 * 9.81, 0, 0, 0], atol=1e-2)
    # Rigid motions meet the soft springs alone.
    soft = (2 * np.pi * 0.05) ** 2 * np.diag([7085, 7085, 0, 0, 0, 29395])
    np.testing.assert_allclose(u.T @ structure.stiffness @ u, soft, atol=1e-2)
    laden = truck(payload=3000.0, **mesh)
    added = u.T @ (laden.mass - structure.mass) @ u
    x, z = -3.7 + 1.748, 0.95 - 0.744
    roll, pitch = 2.4**2 / 12 + z**2, 5.0**2 / 12 + x**2 + z**2
    moments = [1, 1, 1, roll, pitch, (2.4**2 + 5.0**2) / 12 + x**2]
    np.testing.assert_allclose(np.diag(added), 3000 * np.array(moments))
    np.testing.assert_allclose([added[0, 4], added[1, 5]], [3000 * z, 3000 * x])
    np.testing.assert_allclose(u.T @ (laden.load - structure.load), -9.81 * added[2], atol=1e-6)


@pytest.mark.parametrize("mesh", [{}, shelled(0.35)])
def test_a_rigid_motion_gives_outputs_and_deflections_by_geometry(mesh):
    v, structure = values(**mesh), truck(**mesh)
    _, _, heave, roll, pitch, _ = move = np.array([0.1, 0.2, 0.3, 0.01, 0.02, 0.03])
    q = rigid_motions(v) @ move

    def height(x, y):
        return heave + roll * y - pitch * (x + v["sprung_distance"])

    q[-4:] = height(0.0, 0.0), roll, height(-v["wheelbase"], 0.0), roll
    corners = [(x, y) for x in (-1.2, -6.2) for y in (1.2, -1.2)]
    heights = [height(0.0, 0.5), *(height(*corner) for corner in corners)]
    expected = [*heights, *[0] * 10, pitch, roll, *[0] * 29]
    np.testing.assert_allclose(structure.outputs[0] @ q, expected, atol=1e-9)
    for first, matrix in zip((5, 10), structure.outputs[1:3], strict=True):
        expected = np.concatenate([np.zeros(first), heights, np.zeros(46 - first - 5)])
        np.testing.assert_allclose(matrix @ q, expected, atol=1e-9)
    wheels = [height(x, y) for x in (0.0, -4.5) for y in (1.035, -1.035)]
    np.testing.assert_allclose(structure.ports.T @ q, [*[0] * 8, *wheels], atol=1e-9)


def test_payload_changes_mass_and_load_alone_and_all_is_damped_as_stated():
    empty, laden = truck(payload=0.0), truck(payload=5000.0)
    for name in ("stiffness", "damping_time", "dampers", "ports", "outputs"):
        assert getattr(empty, name) is getattr(laden, name)
    damping = laden.dampers @ laden.dampers.T + laden.damping_time * laden.stiffness
    assert damping[-7, -7] == pytest.approx(4 * 2500.0)
    assert laden.damping_time * np.pi * 20.0 == pytest.approx(0.02)


@with_shells
def test_shells_and_beams_agree():
    meshes = {}, {"elements_per_bay": 4.0}, {"shell_size": 0.125}
    results = []
    for structure in (truck(**mesh) for mesh in meshes):
        q, f = static(structure)
        found = frequencies(tangent(structure, f), structure.mass, 16)[3:]
        results.append((found, (structure.outputs[0] @ q)[-20:]))
    (beam, beam_strains), (fine, _), (shell, shell_strains) = results
    assert truck().size == 175
    np.testing.assert_allclose(beam, fine, rtol=1e-3)
    # Ride, then torsion, bending, torsion with the rails' warping (which beams leave out), sway.
    np.testing.assert_allclose(beam, shell, rtol=0.2)
    ride = [0, 1, 2, 3, 4, 5, 7, 8, 9, 10]
    np.testing.assert_allclose(beam[ride], shell[ride], rtol=0.01)
    np.testing.assert_allclose(beam[[6, 11]], shell[[6, 11]], rtol=0.05)
    largest = np.abs(shell_strains).max()
    np.testing.assert_allclose(beam_strains, shell_strains, atol=0.1 * largest)


@pytest.mark.parametrize(
    ("mesh", "tolerance"), [({}, 1e-4), ({"elements_per_bay": 4.0}, 1e-4), shelled(0.0625, 0.04)]
)
def test_strains_are_those_of_a_bent_ladder(mesh, tolerance):
    """Both rails under opposite moments at two stations: strain = moment z / (E I)."""
    v = values(**mesh)
    ladder = frame.Layout(v)
    meshed = frame.meshed(ladder, v)
    pitch = meshed.sections[4::6]
    load = pitch[[4, 5, 22, 23]].T @ np.array([1e4, 1e4, -1e4, -1e4])
    # Soft springs take away rigid motions.
    hold = 1e-2 * diags_array(np.ones(len(load)))
    strains = meshed.strains @ splu(csc_array(meshed.stiffness + hold)).solve(load)
    fibre = 1e4 * ladder.rail.height / 2 / (v["modulus"] * ladder.rail.upright)
    expected = np.tile([fibre, -fibre], 10)
    np.testing.assert_allclose(strains, expected, atol=tolerance * fibre)


def test_springs_stops_and_dampers_have_the_published_forces():
    none = {f"stop_force_{k}_mm": 0.0 for k in (10, 20, 30, 40, 50)}
    np.testing.assert_allclose(law(0.1, **none)[:2, 0], -13501.1, atol=0.1)
    np.testing.assert_allclose(law(0.5, **none)[:2, 0], -166547.0, atol=1.0)
    excess = np.array([0.0, 2, 4, 6, 8, 10, 20, 30, 40, 50, 60]) / 1000
    forces = [0.0, 200, 400, 600, 800, 1000, 2500, 4500, 7500, 12500, 17500]
    for side, start in ((1.0, 0.667 - 0.380), (-1.0, 0.667 - 0.650)):
        found = [law(start + side * e)[0, 0] - law(start + side * e, **none)[0, 0] for e in excess]
        np.testing.assert_allclose(-side * np.array(found), forces, atol=1e-6)
    dampers = slice(4, 8)
    np.testing.assert_allclose(law(0.0, 0.1)[dampers, 0], -4040.5, atol=0.1)
    np.testing.assert_allclose(law(0.0, -0.1)[dampers, 0], 6680.0, atol=0.1)


def test_tires_press_and_never_pull():
    assert not law(1e-9)[8:].any()
    assert not law(-0.001, 10.0)[8:].any()
    np.testing.assert_allclose(law(-0.1)[8:, 0], 26876.8)
    road = np.repeat([0.1, 1.0], 4)
    np.testing.assert_allclose(law(0.0, u=road)[8:], [[26876.8 + 264.3, -268768.0, -264.3]] * 4)


def test_derivatives_of_the_ports_are_those_of_their_forces():
    random, h = np.random.default_rng(1), 1e-7
    for _ in range(200):
        w, rates = random.uniform(-0.1, 0.35, 12), random.uniform(-2.0, 2.0, 12)
        w[8:] = random.uniform(-0.2, 0.1, 4)
        u = np.append(random.uniform(-0.05, 0.05, 4), random.uniform(-2.0, 2.0, 4))
        by_w = (law(w + h, rates, u) - law(w - h, rates, u))[:, 0] / (2 * h)
        by_rate = (law(w, rates + h, u) - law(w, rates - h, u))[:, 0] / (2 * h)
        expected = np.column_stack([by_w, by_rate])
        np.testing.assert_allclose(law(w, rates, u)[:, 1:], expected, rtol=1e-3, atol=1.0)


@pytest.mark.parametrize(
    ("overrides", "error", "text"),
    [
        ({"elements_per_bay": 1.5}, InputError, "a whole number from 1 to 64"),
        ({"shell_size": 0.01}, InputError, "or from 0.02 m on"),
        ({"gearbox_distance": 5.0}, GeometryError, "gearbox .* is not ahead of its rear axle"),
        ({"sprung_mass": 1200.0}, GeometryError, "can't be spread"),
        ({"rail_thickness": 0.09}, GeometryError, "rail_thickness is not below"),
        ({"cab_mount_damping": 10.0}, GeometryError, "must damp at least as much"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(overrides, error, text):
    with pytest.raises(error, match=text):
        truck(**overrides)


def test_shells_without_pyfe3d_name_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyfe3d", None)
    with pytest.raises(InputError, match=r'pip install "vehiclemor\[shells\]"'):
        truck(shell_size=0.31)
