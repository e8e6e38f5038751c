"""Motions of joints in a moving frame, by Taylor polynomials, and momenta of free bodies."""

import numpy as np
import pytest
import sympy as sp

from tests.oracles.taylor import axial, euler_321, times, turned
from tests.unit.programs import function_of
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.mechanics import STILL, along, carried, free_rate, successive
from vehiclemor.symbolic.tape import Tape

TENSOR = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 4.5]])


def real(names: str) -> tuple[sp.Symbol, ...]:
    return sp.symbols(names, real=True)


def exact(a) -> g.Vector:
    return g.vector([sp.Float(float(e), 17) for e in a])


def tensor_of(a: np.ndarray) -> m.Tensor:
    return tuple(exact(row) for row in a)


def unit(rng: np.random.Generator) -> np.ndarray:
    a = rng.standard_normal(3)
    return a / np.linalg.norm(a)


# A carrier on a ball joint of an arm whose pivot slides, all of it in a moving frame.
NU = real("u v w p q_y r slid_rate arm_rate zeta_rate eta_rate xi_rate")
JOINTS = real("slid arm zeta eta xi")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("in_space", [False, True])
def test_motions_are_the_derivatives_of_positions(seed, in_space):
    """Where velocities are those in space, the frame can count gravity as acceleration."""
    rng, tape = np.random.default_rng(seed), Tape()
    axis, slide, (lever, reach) = unit(rng), unit(rng), rng.uniform(-1.0, 1.0, (2, 3))
    origin, attitude, q = (rng.uniform(-1.0, 1.0, (3, n)) for n in (3, 3, 5))
    frame = euler_321(attitude)
    back = frame[0].T
    upwards = back @ [0.0, 0.0, 9.81] * in_space

    # By the package.
    free = [free_rate(6 + k, rate) for k, rate in enumerate(NU[6:])]
    moving = m.MovingFrame(
        g.vector(NU[:3]), g.vector(NU[3:6]), exact(upwards) if in_space else None
    )
    on_arm = g.rotate_about_axis(tape, exact(lever), exact(axis), JOINTS[1])
    carrier = g.euler_321(tape, *JOINTS[2:])
    on_carrier = g.rotate(tape, carrier, exact(reach))
    axes = m.UNIT[2], g.vector((-sp.sin(JOINTS[2]), sp.cos(JOINTS[2]), 0)), g.column(carrier, 0)
    turn = successive(tape, free[2:], axes)
    joint = carried(tape, along(free[0], exact(slide)), along(free[1], exact(axis)), on_arm)
    relative = carried(tape, joint, turn, on_carrier)
    place = exact(slide) * JOINTS[0] + on_arm + on_carrier
    turning = moving.turning(tape, turn)
    tensor = m.rotated_tensor(tape, tensor_of(TENSOR), carrier)
    motions = (
        moving.point(tape, place, relative),
        turning,
        m.with_inertia(tape, tensor, turning),
        moving.point(tape, exact(reach)),
    )
    results = [
        [list(e.value), [list(e.columns.get(k, m.ZERO)) for k in range(11)], list(e.bias)]
        for e in motions
    ]
    arm_tensor = m.turned_tensor(tape, tensor_of(TENSOR), exact(axis), JOINTS[1])
    results.append([list(row) for row in arm_tensor])

    # By positions and rotations.
    arm, turned_carrier = turned(axis, q[:, 1]), euler_321(q[:, 2:])
    in_frame = q[:, :1] * slide + arm @ lever + turned_carrier @ reach
    point = origin + times(frame, in_frame[..., None])[..., 0]
    fixed = origin + frame @ reach
    whole = times(frame, turned_carrier)
    spin, spin_rate = axial(whole[1] @ whole[0].T), 2 * axial(whole[2] @ whole[0].T)
    inertia = whole[0] @ TENSOR @ whole[0].T
    changing = whole[1] @ TENSOR @ whole[0].T
    momentum_rate = (changing + changing.T) @ spin + inertia @ spin_rate
    u, w = back @ origin[1], back @ axial(frame[1] @ back)
    rate = back @ (2 * origin[2]) - (0.0 if in_space else np.cross(w, u))
    nu = [*u, *w, *q[1]]
    nu_rate = np.array([*rate, *(back @ (2 * axial(frame[2] @ back))), *(2 * q[2])])
    *found, of_arm = function_of(tape, [*JOINTS, *NU], results)(*q[0], *nu)
    expected = (
        (point[1], 2 * point[2]),
        (spin, spin_rate),
        (spin, momentum_rate),
        (fixed[1], 2 * fixed[2]),
    )
    for k, ((value, columns, bias), (velocity, change)) in enumerate(
        zip(found, expected, strict=True)
    ):
        np.testing.assert_allclose(value, back @ velocity, rtol=0, atol=1e-13)
        np.testing.assert_allclose(nu @ np.array(columns), value, rtol=0, atol=1e-13)
        by_speeds = nu_rate @ np.array(columns)
        if k == 2:
            by_speeds = back @ inertia @ back.T @ by_speeds
        counted = upwards if k in (0, 3) else 0.0
        np.testing.assert_allclose(by_speeds + bias, back @ change + counted, rtol=0, atol=1e-12)
    np.testing.assert_allclose(of_arm, arm[0] @ TENSOR @ arm[0].T, rtol=0, atol=1e-13)


MASS, SLIDER, ABOUT, ACROSS = 1.7, 0.9, 1.9, 1.1
AXLE, PLACE = np.array([0.6, 0.0, 0.8]), np.array([0.5, -0.3, 0.2])
SPEEDS = real("u v w p q r rate spin")


@pytest.mark.parametrize("as_rotor", [False, True])
def test_a_free_body_with_a_slider_and_a_rotor_keeps_its_momenta(as_rotor, rng):
    """The motor that drives the rotor changes the energy and nothing else."""
    (slid, torque), tape = real("slid torque"), Tape()
    frame = m.MovingFrame(g.vector(SPEEDS[:3]), g.vector(SPEEDS[3:6]))
    of_rotor = ACROSS * np.eye(3) + (ABOUT - ACROSS) * np.outer(AXLE, AXLE)
    motor = exact(AXLE) * torque
    turning = frame.turning(tape, STILL)
    if as_rotor:
        tensor = tensor_of(TENSOR + of_rotor)
        own = m.Rotor(7, SPEEDS[7], exact(AXLE), sp.Float(ABOUT), torque, turning.bias)
        further = {"rotor": own}
        rotation, bodies = m.with_inertia(tape, tensor, turning), []
    else:
        tensor, further = tensor_of(TENSOR), {"moment": motor * -1}
        about = m.axisymmetric_inertia(sp.Float(ABOUT), sp.Float(ACROSS), exact(AXLE))
        spun = frame.rotation(tape, about, spin=(7, SPEEDS[7], exact(AXLE)))
        rotation = frame.rotation(tape, tensor)
        bodies = [
            m.Body(sp.Integer(0), frame.origin(tape), m.ZERO, spun, about, moment=motor),
        ]
    bodies.append(m.Body(sp.Float(MASS), frame.origin(tape), m.ZERO, rotation, tensor, **further))
    now = exact(PLACE) + m.UNIT[2] * slid
    moved = frame.point(tape, now, along(free_rate(6, SPEEDS[6]), m.UNIT[2]))
    point = tensor_of(np.zeros((3, 3)))
    bodies.append(m.Body(sp.Float(SLIDER), moved, m.ZERO, frame.rotation(tape, point), point))
    equations = function_of(tape, [*SPEEDS, slid, torque], list(m.kane(tape, 8, bodies)))

    def momenta(nu: np.ndarray, slid: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Momentum, angular momentum about the frame's origin and energy, by their definitions."""
        v, w, place = nu[:3], nu[3:6], PLACE + slid * np.eye(3)[2]
        speed = v + np.cross(w, place) + [0.0, 0.0, nu[6]]
        whole = w + nu[7] * AXLE
        energy = MASS * v @ v + SLIDER * speed @ speed + w @ TENSOR @ w + whole @ of_rotor @ whole
        turning = TENSOR @ w + np.cross(place, SLIDER * speed) + of_rotor @ whole
        return MASS * v + SLIDER * speed, turning, energy / 2.0

    for _ in range(10):
        nu, (slid_now, motor_now) = rng.uniform(-2.0, 2.0, 8), rng.uniform(-1.0, 1.0, 2)
        mass, force = (np.array(e, float) for e in equations(*nu, slid_now, motor_now))
        np.testing.assert_array_equal(mass, mass.T)
        change = np.linalg.solve(mass, force)
        ends = [momenta(nu + h * change, slid_now + h * nu[6]) for h in (1e-5, -1e-5)]
        rates = [(a - b) / 2e-5 for a, b in zip(*ends, strict=True)]
        momentum, turning_now, _ = momenta(nu, slid_now)
        v, w = nu[:3], nu[3:6]
        # Rates in the inertial frame, the second about a moving origin.
        np.testing.assert_allclose(rates[0] + np.cross(w, momentum), 0.0, atol=1e-8)
        about_origin = rates[1] + np.cross(w, turning_now) + np.cross(v, momentum)
        np.testing.assert_allclose(about_origin, 0.0, atol=1e-8)
        assert rates[2] == pytest.approx(motor_now * nu[7], abs=1e-8)


def test_a_point_mass_has_the_energy_of_its_turning(rng):
    lever, turning = rng.uniform(-2.0, 2.0, (2, 3))
    tensor = np.array(
        [list(row) for row in m.point_mass_tensor(sp.Float(1.3), exact(lever))], float
    )
    momentum = 1.3 * np.cross(lever, np.cross(turning, lever))
    np.testing.assert_allclose(tensor @ turning, momentum, rtol=0, atol=1e-14)


def test_a_rotor_is_spun_by_its_moment_less_what_its_carrier_turns_it():
    tape, torque, turned = Tape(), sp.Symbol("torque", real=True), [2, -3, 5]
    frame = m.MovingFrame(g.vector(SPEEDS[:3]), g.vector(SPEEDS[3:6]))
    own = m.Rotor(6, SPEEDS[7], exact(AXLE), sp.Float(ABOUT), torque, exact(turned))
    tensor = tensor_of(TENSOR)
    rotation = m.with_inertia(tape, tensor, frame.turning(tape, STILL))
    body = m.Body(sp.Float(MASS), frame.origin(tape), m.ZERO, rotation, tensor, rotor=own)
    _, force = m.kane(tape, 7, [body])
    (found,) = function_of(tape, [*SPEEDS, torque], force[6:])(*[0.7] * 9)
    assert found == pytest.approx(0.7 - ABOUT * AXLE @ turned, rel=1e-14)
