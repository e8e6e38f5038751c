"""Motions of joints and of moving frames against differentiated positions."""

from collections.abc import Callable, Sequence

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from tests.unit.motions import (
    DIGITS,
    TENSOR,
    X,
    Y,
    Z,
    assert_moves,
    at_zero,
    column,
    exact,
    floats,
    history,
    moving,
    rate,
    real,
    second,
    spin_of,
    tensor_of,
    turned,
    unit,
)
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.joints import Rate, along, carried, free_rate, successive
from vehiclemor.symbolic.tape import Tape


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(DIGITS):
        yield


# Joints


def carried_axes(tape: Tape, axes: Sequence, q: Sequence[sp.Symbol]) -> list[g.Vector]:
    """Present directions of axes each of which those before it carry."""
    found = []
    for k, axis in enumerate(axes):
        now = exact(axis)
        for earlier in reversed(range(k)):
            now = g.rotate_about_axis(tape, now, exact(axes[earlier]), q[earlier])
        found.append(now)
    return found


def rotation_of(axes: Sequence, histories: Sequence[Callable]) -> Callable:
    def rotation(t):
        product = mp.eye(3)
        for axis, angle in zip(axes, histories, strict=True):
            product *= turned(axis, angle(t))
        return product

    return rotation


AXES = {
    "3-2-1": [Z, Y, X],
    "tie rod": [Z, X],
    "3-1-3": [Z, X, Z],
    "one": [Y],
    "any four": [unit(np.random.default_rng(k)) for k in range(4)],
}


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
def test_successive_rotations_have_the_angular_velocity_of_their_product(axes, rng):
    n = len(axes)
    tape, q = Tape(), [sp.Symbol(f"q{k}", real=True) for k in range(n)]
    rates = [sp.Symbol(f"rate{k}", real=True) for k in range(n)]
    free = [free_rate(k, r) for k, r in enumerate(rates)]
    motion = successive(tape, free, carried_axes(tape, axes, q))
    function = moving(tape, [*q, *rates], motion, n)
    for _ in range(2):
        histories = [history(rng) for _ in range(n)]
        at, first, accelerations = at_zero(histories)
        spin = spin_of(rotation_of(axes, histories))
        found = function(*at, *first)
        assert_moves(found, spin(0), rate(spin)(0), first, accelerations)


def test_a_body_on_an_arm_on_a_slide_moves_as_its_position_changes(rng):
    """Wheel carrier on a ball joint of an arm whose pivot slides."""
    axis, lever, reach, slide = unit(rng), *rng.uniform(-1.0, 1.0, (2, 3)), unit(rng)
    tape, q = Tape(), real("slid theta zeta eta xi")
    rates = real("slid_dot theta_dot zeta_dot eta_dot xi_dot")
    free = [free_rate(k, r) for k, r in enumerate(rates)]
    to_joint = g.rotate_about_axis(tape, exact(lever), exact(axis), q[1])
    to_point = g.rotate(tape, g.euler_321(tape, *q[2:]), exact(reach))
    pivot, arm = along(free[0], exact(slide)), along(free[1], exact(axis))
    carrier = successive(tape, free[2:], carried_axes(tape, [Z, Y, X], q[2:]))
    joint = carried(tape, pivot, arm, to_joint)
    function = moving(tape, [*q, *rates], carried(tape, joint, carrier, to_point), 5)
    for _ in range(3):
        histories = [history(rng) for _ in q]
        at, first, accelerations = at_zero(histories)
        turn = rotation_of([Z, Y, X], histories[2:])

        def place(t, histories=histories, turn=turn):
            joint = histories[0](t) * column(slide)
            joint += turned(axis, histories[1](t)) * column(lever)
            return joint + turn(t) * column(reach)

        found = function(*at, *first)
        assert_moves(found, rate(place)(0), second(place), first, accelerations)


# Angles that follow from two other coordinates.
s, r = real("s r")
BOUND = (0.7 * sp.sin(1.3 * s) * r, s**2 - 0.4 * s + r**3, sp.cos(r - s) + sp.exp(s / 3))
FOLLOW, DEPEND_ON = [sp.lambdify([s, r], e, "mpmath") for e in BOUND], (1, 4)


def test_rates_that_depend_on_others_move_by_the_chain_rule(rng):
    tape, (s_dot, r_dot) = Tape(), real("s_dot r_dot")
    rates, chain = [], ((s, s_dot), (r, r_dot))
    for f in BOUND:
        value = sum(f.diff(a) * a_dot for a, a_dot in chain)
        bias = sum(value.diff(a) * a_dot for a, a_dot in chain)
        columns = {k: tape.let(f.diff(a)) for k, a in zip(DEPEND_ON, (s, r), strict=True)}
        rates.append(Rate(tape.let(value), columns, tape.let(bias)))
    turn = successive(tape, rates, carried_axes(tape, [Z, Y, X], BOUND))
    lever = g.rotate(tape, g.euler_321(tape, *BOUND), exact([0.3, -0.8, 0.5]))
    base = along(rates[1], exact(Y))
    motion = carried(tape, base, turn, lever)
    assert set(motion.columns) == set(DEPEND_ON)
    function = moving(tape, [s, r, s_dot, r_dot], motion, 5)
    for _ in range(3):
        independent = [history(rng), history(rng)]
        at, first, accelerations = at_zero(independent)
        followers = [lambda t, f=f, chosen=independent: f(*[h(t) for h in chosen]) for f in FOLLOW]
        rotation = rotation_of([Z, Y, X], followers)

        def place(t, followers=followers, rotation=rotation):
            return followers[1](t) * column(Y) + rotation(t) * column([0.3, -0.8, 0.5])

        change, speed = np.zeros(5), np.zeros(5)
        change[list(DEPEND_ON)], speed[list(DEPEND_ON)] = accelerations, first
        found = function(*at, *first)
        assert_moves(found, rate(place)(0), second(place), speed, change)


# Moving frames


class Travel:
    """Frame that moves and turns, an arm in it that slides and turns; histories in many digits."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.axis, self.slide, self.lever = unit(rng), unit(rng), rng.uniform(-1.0, 1.0, 3)
        self.joints = [history(rng), history(rng)]
        place, turns = [history(rng) for _ in range(3)], [history(rng) for _ in range(3)]
        self.frame = rotation_of([Z, Y, X], turns)
        self.origin = lambda t: column([f(t) for f in place])

    def arm(self, t) -> mp.matrix:
        """Orientation of the arm in the frame."""
        return turned(self.axis, self.joints[1](t))

    def point(self, t) -> mp.matrix:
        """Point of the arm in space."""
        place = self.joints[0](t) * column(self.slide) + self.arm(t) * column(self.lever)
        return self.origin(t) + self.frame(t) * place

    def velocity(self, t) -> mp.matrix:
        """Velocity of the origin, components in the frame."""
        return self.frame(t).T * rate(self.origin)(t)

    def turning(self, t) -> mp.matrix:
        """Angular velocity of the frame, components in it."""
        return self.frame(t).T * spin_of(self.frame)(t)

    def speeds(self, in_space: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Joint coordinates, speeds (8,) and their derivatives (8,)."""
        at, first, accelerations = at_zero(self.joints)
        change = rate(self.velocity)(0)
        if in_space:
            change = self.frame(0).T * second(self.origin)
        nu = [*self.velocity(0), *self.turning(0), *first]
        return at, floats(nu), floats([*change, *rate(self.turning)(0), *accelerations])

    def seen(self, vector: mp.matrix) -> mp.matrix:
        """Components in the frame of a vector in space."""
        return self.frame(0).T * vector


NU = real("u v w p q_y r slid_rate arm_rate")
JOINTS = real("slid angle")


def motions(tape: Tape, travel: Travel, acceleration: g.Vector | None = None):
    """Moving frame, and the arm's point and rotation in it."""
    frame = m.MovingFrame(g.vector(NU[:3]), g.vector(NU[3:6]), first=0, acceleration=acceleration)
    lever = g.rotate_about_axis(tape, exact(travel.lever), exact(travel.axis), JOINTS[1])
    turn = along(free_rate(7, NU[7]), exact(travel.axis))
    relative = carried(tape, along(free_rate(6, NU[6]), exact(travel.slide)), turn, lever)
    place = exact(travel.slide) * JOINTS[0] + lever
    return frame, frame.point(tape, place, relative), turn


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("in_space", [False, True])
def test_a_point_that_moves_in_a_moving_frame_has_coriolis_acceleration(seed, in_space):
    """Of velocities in space, the frame can count gravity as acceleration."""
    travel, tape = Travel(np.random.default_rng(seed)), Tape()
    upwards = travel.seen(column([0, 0, mp.mpf("9.81") if in_space else 0]))
    _, point, _ = motions(tape, travel, exact(upwards) if in_space else None)
    at, nu, change = travel.speeds(in_space)
    found = moving(tape, [*JOINTS, *NU], point, 8)(*at, *nu)
    velocity = travel.seen(rate(travel.point)(0))
    acceleration = travel.seen(second(travel.point)) + upwards
    assert_moves(found, velocity, acceleration, nu, change)


def test_a_point_at_rest_in_the_frame_needs_no_relative_motion(rng):
    travel, tape = Travel(rng), Tape()
    frame = m.MovingFrame(g.vector(NU[:3]), g.vector(NU[3:6]), first=0)
    place = exact(travel.lever)
    still = frame.point(tape, place, m.Motion(m.ZERO, {}, m.ZERO))
    plain = frame.point(tape, place)
    _, nu, change = travel.speeds()

    def position(t):
        return travel.origin(t) + travel.frame(t) * column(travel.lever)

    velocity, acceleration = travel.seen(rate(position)(0)), travel.seen(second(position))
    for motion in (still, plain):
        found = moving(tape, NU[:6], motion, 6)(*nu[:6])
        assert_moves(found, velocity, acceleration, nu[:6], change[:6])


@pytest.mark.parametrize("seed", range(2))
def test_with_inertia_gives_the_rate_of_the_angular_momentum(seed):
    travel, tape = Travel(np.random.default_rng(seed)), Tape()
    frame, _, turn = motions(tape, travel)
    tensor = m.turned_tensor(tape, tensor_of(TENSOR), exact(travel.axis), JOINTS[1])
    rotation = m.with_inertia(tape, tensor, frame.turning(tape, turn))
    at, nu, change = travel.speeds()
    value, columns, bias = moving(tape, [*JOINTS, *NU], rotation, 8)(*at, *nu)

    def attitude(t):
        return travel.frame(t) * travel.arm(t)

    def momentum(t):
        turn = attitude(t)
        return turn * mp.matrix(TENSOR.tolist()) * turn.T * spin_of(attitude)(t)

    arm = np.array(travel.arm(0).tolist(), dtype=float)
    now = arm @ TENSOR @ arm.T
    np.testing.assert_allclose(now @ value, floats(travel.seen(momentum(0))), atol=1e-13)
    reached = now @ (columns @ change) + bias
    np.testing.assert_allclose(reached, floats(travel.seen(rate(momentum)(0))), atol=1e-12)
