"""Inertia tensors that turn, and bodies with rotors against plain rigid bodies."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.unit.motions import TENSOR, angles, exact, numbers, real, tensor_of, vectors
from tests.unit.programs import function_of
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.joints import STILL, along, carried, free_rate, successive
from vehiclemor.symbolic.tape import Tape

# Tensors


six = st.tuples(*[numbers] * 6)


def symmetric(e) -> np.ndarray:
    return np.array([[e[0], e[1], e[2]], [e[1], e[3], e[4]], [e[2], e[4], e[5]]])


def compiled_tensors() -> tuple[Callable, Callable, Callable]:
    entries, axis, angle = real("xx xy xz yy yz zz"), real("ax ay az"), real("angle")
    rows = [list(row) for row in sp.Matrix(3, 3, lambda i, j: real(f"r{i}{j}")).tolist()]
    mass, lever = real("mass"), real("lx ly lz")
    xx, xy, xz, yy, yz, zz = entries
    tensor, tape = tuple(map(g.vector, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))), Tape()
    by_axis = [list(row) for row in m.turned_tensor(tape, tensor, g.vector(axis), angle)]
    rotation = tuple(g.vector(row) for row in rows)
    by_matrix = [list(row) for row in m.rotated_tensor(tape, tensor, rotation)]
    of_point = [list(row) for row in m.point_mass_tensor(mass, g.vector(lever))]
    return (
        function_of(tape, [entries, axis, angle], by_axis),
        function_of(tape, [entries, rows], by_matrix),
        function_of(tape, [mass, lever], of_point),
    )


by_axis, by_matrix, of_point = compiled_tensors()


@settings(max_examples=20)
@given(entries=six, axis=vectors.filter(lambda a: np.linalg.norm(a) > 0.1), angle=angles)
def test_a_tensor_that_turns_is_the_tensor_between_rotations(entries, axis, angle):
    axis = axis / np.linalg.norm(axis)
    turn = Rotation.from_rotvec(angle * axis).as_matrix()
    expected = turn @ symmetric(entries) @ turn.T
    for found in (by_axis(entries, axis, angle), by_matrix(entries, turn)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


@settings(max_examples=20)
@given(mass=st.floats(0.1, 9.0), lever=vectors, turning=vectors)
def test_a_point_mass_has_the_energy_of_its_turning(mass, lever, turning):
    tensor = np.array(of_point(mass, lever))
    np.testing.assert_array_equal(tensor, tensor.T)
    speed = np.cross(turning, lever)
    assert turning @ tensor @ turning == pytest.approx(mass * speed @ speed, abs=1e-12)
    # Angular momentum r x m v.
    momentum = mass * np.cross(lever, speed)
    np.testing.assert_allclose(tensor @ turning, momentum, rtol=0, atol=1e-12)


# Rotors


ARM_MASS, WHEEL_MASS, ABOUT, ACROSS = 3.1, 1.7, 0.9, 0.5
ARM_CENTRE, WHEEL_CENTRE = np.array([0.3, -0.5, 0.2]), np.array([-0.4, 0.6, 0.1])
PIVOT = np.array([0.7, 0.2, -0.3])
HINGE, AXLE = np.array([0.6, 0.8, 0.0]), np.array([2.0, 3.0, 6.0]) / 7.0
RIG = real("angle vx vy vz wx wy wz hinge_rate spin fx fy fz mx my mz ax ay az bx by bz")


def point_tensor(mass: float, lever: np.ndarray) -> np.ndarray:
    return mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))


def arm_with_wheel(as_rotor: bool) -> Callable:
    """Mass matrix and forces of an arm with a spinning wheel, on a hinge in a moving frame.

    Loads act on the wheel (f, m) and on the arm (a, b).
    """
    tape, angle, speeds, loads = Tape(), RIG[0], RIG[1:9], RIG[9:]
    hinge = exact(HINGE)
    frame = m.MovingFrame(g.vector(speeds[:3]), g.vector(speeds[3:6]), first=0)
    turn = along(free_rate(6, speeds[6]), hinge)

    def lever(design: np.ndarray) -> g.Vector:
        return g.rotate_about_axis(tape, exact(design), hinge, angle)

    def centre(design: np.ndarray) -> m.Motion:
        now = lever(design)
        return frame.point(tape, exact(PIVOT) + now, carried(tape, STILL, turn, now))

    axle = lever(AXLE)
    force, moment, on_arm, moment_on_arm = (g.vector(loads[k : k + 3]) for k in (0, 3, 6, 9))
    turning = frame.turning(tape, turn)
    if as_rotor:
        total = ARM_MASS + WHEEL_MASS
        middle = (ARM_MASS * ARM_CENTRE + WHEEL_MASS * WHEEL_CENTRE) / total
        design = TENSOR + ACROSS * np.eye(3) + (ABOUT - ACROSS) * np.outer(AXLE, AXLE)
        design += point_tensor(ARM_MASS, ARM_CENTRE - middle)
        design += point_tensor(WHEEL_MASS, WHEEL_CENTRE - middle)
        tensor = m.turned_tensor(tape, tensor_of(design), hinge, angle)
        about = moment + moment_on_arm
        about = about + lever(WHEEL_CENTRE - middle).cross(force)
        about = about + lever(ARM_CENTRE - middle).cross(on_arm)
        rotor = m.Rotor(7, speeds[7], axle, sp.Float(ABOUT), moment @ axle)
        rotation = m.with_inertia(tape, tensor, turning)
        bodies = [
            m.Body(
                sp.Float(total),
                centre(middle),
                force + on_arm,
                rotation,
                tensor,
                about,
                rotor,
                turning.bias,
            )
        ]
    else:
        tensor = m.turned_tensor(tape, tensor_of(TENSOR), hinge, angle)
        both = successive(tape, [free_rate(6, speeds[6]), free_rate(7, speeds[7])], [hinge, axle])
        of_wheel = m.axisymmetric_inertia(sp.Float(ABOUT), sp.Float(ACROSS), axle)
        bodies = [
            m.Body(
                sp.Float(ARM_MASS),
                centre(ARM_CENTRE),
                on_arm,
                m.with_inertia(tape, tensor, turning),
                tensor,
                moment_on_arm,
            ),
            m.Body(
                sp.Float(WHEEL_MASS),
                centre(WHEEL_CENTRE),
                force,
                m.with_inertia(tape, of_wheel, frame.turning(tape, both)),
                of_wheel,
                moment,
            ),
        ]
    mass, right = m.kane(tape, 8, bodies)
    return function_of(tape, RIG, [mass, right])


def test_a_body_with_a_rotor_is_a_carrier_and_a_wheel(rng):
    together, apart = arm_with_wheel(as_rotor=True), arm_with_wheel(as_rotor=False)
    for _ in range(8):
        values = rng.uniform(-4.0, 4.0, len(RIG))
        (mass, force), (expected_mass, expected_force) = together(*values), apart(*values)
        np.testing.assert_allclose(mass, expected_mass, rtol=0, atol=1e-12)
        np.testing.assert_allclose(force, expected_force, rtol=0, atol=1e-10)


def free_body_with_rotor() -> Callable:
    """Rates of the speeds of a free body whose rotor a motor in it drives."""
    speeds, torque = real("u v w p q_y r spin"), real("torque")
    tape, tensor = Tape(), tensor_of(TENSOR)
    frame = m.MovingFrame(g.vector(speeds[:3]), g.vector(speeds[3:6]), first=0)
    turning = frame.turning(tape, STILL)
    rotor = m.Rotor(6, speeds[6], exact(AXLE), sp.Float(ABOUT), torque)
    body = m.Body(
        sp.Float(ARM_MASS),
        frame.origin(tape),
        m.ZERO,
        m.with_inertia(tape, tensor, turning),
        tensor,
        m.ZERO,
        rotor,
        turning.bias,
    )
    function = function_of(tape, [*speeds, torque], list(m.kane(tape, 7, [body])))

    def accelerations(values: np.ndarray) -> np.ndarray:
        mass, force = function(*values)
        return np.linalg.solve(np.array(mass, dtype=float), np.array(force, dtype=float))

    return accelerations


@settings(max_examples=20)
@given(turn=vectors, spin=st.floats(-90.0, 90.0), torque=st.floats(-30.0, 30.0))
def test_a_free_body_with_a_rotor_keeps_its_angular_momentum(turn, spin, torque):
    change = free(np.array([0.0, 0.0, 0.0, *turn, spin, torque]))
    np.testing.assert_allclose(change[:3], 0.0, atol=1e-12)
    momentum = TENSOR @ turn + ABOUT * spin * AXLE
    rates = TENSOR @ change[3:6] + ABOUT * change[6] * AXLE
    scale = 1.0 + np.abs(momentum).max() * np.abs(turn).max() + abs(torque)
    np.testing.assert_allclose(rates + np.cross(turn, momentum), 0.0, atol=1e-13 * scale)
    # The motor alone changes what the rotor turns about its axis.
    assert ABOUT * (change[6] + AXLE @ change[3:6]) == pytest.approx(torque, abs=1e-12 * scale)
    # The motor's power becomes kinetic energy.
    power = turn @ rates + spin * ABOUT * (change[6] + AXLE @ change[3:6])
    assert power == pytest.approx(torque * spin, abs=1e-11 * scale * (1 + abs(spin)))


free = free_body_with_rotor()
