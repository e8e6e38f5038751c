"""Motions of joints, moving frames and rotors against differentiated positions and plain bodies."""

from collections.abc import Callable, Sequence

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.unit.programs import function_of
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.joints import STILL, Rate, along, carried, free_rate, successive
from vehiclemor.symbolic.tape import Tape

# Central differences at this step and as many digits are exact to 28 digits.
STEP, DIGITS = mp.mpf("1e-15"), 60
X, Y, Z = np.eye(3)
numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
angles = st.floats(-3.0, 3.0)


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(DIGITS):
        yield


# Positions, rotations and their histories, in many digits


def history(rng: np.random.Generator) -> Callable:
    """A smooth function of time."""
    size, rate, phase, rest = rng.uniform(0.3, 1.5, 4)
    return lambda t: rest - 1 + size * mp.sin(rate * t + phase)


def column(vector: Sequence) -> mp.matrix:
    return mp.matrix(list(vector))


def skew(a) -> mp.matrix:
    return mp.matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turned(axis, angle) -> mp.matrix:
    """Rotation about a unit axis."""
    k = skew(axis)
    return mp.eye(3) + mp.sin(angle) * k + (1 - mp.cos(angle)) * (k * k)


def rate(f: Callable) -> Callable:
    """Derivative of a function of time."""
    return lambda t: (f(t + STEP) - f(t - STEP)) / (2 * STEP)


def second(f: Callable):
    """Second derivative at time zero."""
    return (f(STEP) - 2 * f(mp.mpf(0)) + f(-STEP)) / STEP**2


def spin_of(rotation: Callable) -> Callable:
    """Angular velocity of a rotation that is a function of time, in the axes that stand still."""

    def value(t):
        tensor = rate(rotation)(t) * rotation(t).T
        return column([tensor[2, 1], tensor[0, 2], tensor[1, 0]])

    return value


def floats(a) -> np.ndarray:
    return np.array([float(e) for e in a])


def unit(rng: np.random.Generator) -> np.ndarray:
    a = rng.standard_normal(3)
    return a / np.linalg.norm(a)


# Motions as numbers


def exact(a) -> g.Vector:
    return g.vector([sp.Float(float(e), 17) for e in a])


def real(names: str) -> tuple[sp.Symbol, ...]:
    return sp.symbols(names, real=True)


def moving(tape: Tape, symbols: Sequence, motion: m.Motion, speeds: int) -> Callable:
    """Values of the symbols -> velocity (3,), its columns (3, speeds), its bias (3,)."""
    assert set(motion.columns) <= set(range(speeds))
    rows = [[motion.columns.get(k, m.ZERO)[i] for k in range(speeds)] for i in range(3)]
    function = function_of(tape, symbols, [list(motion.value), rows, list(motion.bias)])

    def values(*given) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        value, columns, bias = function(*given)
        return np.array(value), np.array(columns), np.array(bias)

    return values


def assert_moves(found, velocity, acceleration, rates, accelerations) -> None:
    """Velocity and acceleration that follow from speeds and their derivatives are those given."""
    value, columns, bias = found
    np.testing.assert_allclose(value, floats(velocity), rtol=0, atol=1e-13)
    np.testing.assert_allclose(columns @ floats(rates), value, rtol=0, atol=1e-13)
    reached = columns @ floats(accelerations) + bias
    np.testing.assert_allclose(reached, floats(acceleration), rtol=0, atol=1e-12)


def at_zero(histories: Sequence[Callable]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Histories, their first and their second derivatives at time zero."""
    now = mp.mpf(0)
    return (
        floats([h(now) for h in histories]),
        floats([rate(h)(now) for h in histories]),
        floats([second(h) for h in histories]),
    )


# Joints


@pytest.mark.parametrize("seed", range(2))
def test_a_slide_moves_along_its_direction(seed):
    rng = np.random.default_rng(seed)
    direction, slid = unit(rng), history(rng)
    _, rates, accelerations = at_zero([slid])
    speed = real("speed")
    motion = along(free_rate(0, speed), exact(direction))
    found = moving(Tape(), [speed], motion, 1)(*rates)

    def place(t):
        return slid(t) * column(direction)

    assert_moves(found, rate(place)(0), second(place), rates, accelerations)


@pytest.mark.parametrize("seed", range(2))
def test_a_turning_arm_carries_its_points_on_circles(seed):
    rng = np.random.default_rng(seed)
    axis, lever, angle = unit(rng), rng.uniform(-1.0, 1.0, 3), history(rng)
    q, rates, accelerations = at_zero([angle])
    tape, (theta, theta_dot) = Tape(), real("theta theta_dot")
    now = g.rotate_about_axis(tape, exact(lever), exact(axis), theta)
    motion = carried(tape, STILL, along(free_rate(0, theta_dot), exact(axis)), now)
    found = moving(tape, [theta, theta_dot], motion, 1)(*q, *rates)

    def place(t):
        return turned(axis, angle(t)) * column(lever)

    assert_moves(found, rate(place)(0), second(place), rates, accelerations)


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


def test_a_prescribed_slide_adds_to_velocity_and_acceleration_alone(rng):
    """Rack: its motion is no speed of its own, it is in value and bias."""
    tape, (angle, speed, moved, accelerated) = Tape(), real("angle speed moved accelerated")
    lever = g.rotate_about_axis(tape, exact([0.2, 0.7, -0.1]), exact(Z), angle)
    base = m.Motion(g.vector((0, moved, 0)), {}, g.vector((0, accelerated, 0)))
    motion = carried(tape, base, along(free_rate(3, speed), exact(Z)), lever)
    assert set(motion.columns) == {3}
    turn, rack = history(rng), history(rng)
    at, first, accelerations = at_zero([turn, rack])
    value, columns, bias = moving(tape, [angle, speed, moved, accelerated], motion, 4)(
        at[0], first[0], first[1], accelerations[1]
    )

    def place(t):
        return column([0, rack(t), 0]) + turned(Z, turn(t)) * column([0.2, 0.7, -0.1])

    np.testing.assert_allclose(value, floats(rate(place)(0)), atol=1e-14)
    reached = columns[:, 3] * accelerations[0] + bias
    np.testing.assert_allclose(reached, floats(second(place)), atol=1e-13)


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
    frame = m.MovingFrame(NU[:3], NU[3:6], first=0, acceleration=acceleration)
    lever = g.rotate_about_axis(tape, exact(travel.lever), exact(travel.axis), JOINTS[1])
    turn = along(free_rate(7, NU[7]), exact(travel.axis))
    relative = carried(tape, along(free_rate(6, NU[6]), exact(travel.slide)), turn, lever)
    place = g.add(g.scale(JOINTS[0], exact(travel.slide)), lever)
    return frame, frame.point(tape, place, relative), turn


@pytest.mark.parametrize("seed", range(2))
def test_a_point_that_moves_in_a_moving_frame_has_coriolis_acceleration(seed):
    travel, tape = Travel(np.random.default_rng(seed)), Tape()
    _, point, _ = motions(tape, travel)
    at, nu, change = travel.speeds()
    found = moving(tape, [*JOINTS, *NU], point, 8)(*at, *nu)
    velocity, acceleration = travel.seen(rate(travel.point)(0)), travel.seen(second(travel.point))
    assert_moves(found, velocity, acceleration, nu, change)


@pytest.mark.parametrize("seed", range(2))
def test_a_frame_of_velocities_in_space_can_count_gravity_as_acceleration(seed):
    travel, tape = Travel(np.random.default_rng(seed)), Tape()
    upwards = travel.seen(column([0, 0, mp.mpf("9.81")]))
    _, point, _ = motions(tape, travel, exact(upwards))
    at, nu, change = travel.speeds(in_space=True)
    found = moving(tape, [*JOINTS, *NU], point, 8)(*at, *nu)
    velocity = travel.seen(rate(travel.point)(0))
    acceleration = travel.seen(second(travel.point)) + upwards
    assert_moves(found, velocity, acceleration, nu, change)


def test_a_point_at_rest_in_the_frame_needs_no_relative_motion(rng):
    travel, tape = Travel(rng), Tape()
    frame = m.MovingFrame(NU[:3], NU[3:6], first=0)
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
def test_a_body_that_turns_in_a_turning_frame(seed):
    travel, tape = Travel(np.random.default_rng(seed)), Tape()
    frame, _, turn = motions(tape, travel)
    at, nu, change = travel.speeds()
    found = moving(tape, [*JOINTS, *NU], frame.turning(tape, turn), 8)(*at, *nu)
    spin = spin_of(lambda t: travel.frame(t) * travel.arm(t))
    assert_moves(found, travel.seen(spin(0)), travel.seen(rate(spin)(0)), nu, change)


TENSOR = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 4.5]])


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


# Tensors


def tensor_of(tensor: np.ndarray) -> m.Tensor:
    rows = [exact(row) for row in tensor]
    return rows[0], rows[1], rows[2]


six = st.tuples(*[numbers] * 6)


def symmetric(e) -> np.ndarray:
    return np.array([[e[0], e[1], e[2]], [e[1], e[3], e[4]], [e[2], e[4], e[5]]])


def compiled_tensors() -> tuple[Callable, Callable, Callable]:
    entries, axis, angle = real("xx xy xz yy yz zz"), real("ax ay az"), real("angle")
    rows = [list(row) for row in sp.Matrix(3, 3, lambda i, j: real(f"r{i}{j}")).tolist()]
    mass, lever = real("mass"), real("lx ly lz")
    xx, xy, xz, yy, yz, zz = entries
    tensor, tape = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), Tape()
    by_axis = [list(row) for row in m.turned_tensor(tape, tensor, axis, angle)]
    rotation = tuple(g.vector(row) for row in rows)
    by_matrix = [list(row) for row in m.rotated_tensor(tape, tensor, rotation)]
    of_point = [list(row) for row in m.point_mass_tensor(mass, lever)]
    return (
        function_of(tape, [entries, axis, angle], by_axis),
        function_of(tape, [entries, rows], by_matrix),
        function_of(tape, [mass, lever], of_point),
    )


by_axis, by_matrix, of_point = compiled_tensors()


@settings(max_examples=20)
@given(entries=six, axis=vectors.filter(lambda a: np.linalg.norm(a) > 0.1), angle=angles)
def test_a_turned_tensor_is_the_tensor_between_rotations(entries, axis, angle):
    axis = axis / np.linalg.norm(axis)
    turn = Rotation.from_rotvec(angle * axis).as_matrix()
    found = np.array(by_axis(entries, axis, angle))
    np.testing.assert_allclose(found, turn @ symmetric(entries) @ turn.T, rtol=0, atol=1e-13)


@settings(max_examples=20)
@given(entries=six, turn=vectors)
def test_a_rotated_tensor_is_the_tensor_between_rotations(entries, turn):
    rotation = Rotation.from_rotvec(turn).as_matrix()
    found = np.array(by_matrix(entries, rotation))
    expected = rotation @ symmetric(entries) @ rotation.T
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
    frame = m.MovingFrame(speeds[:3], speeds[3:6], first=0)
    turn = along(free_rate(6, speeds[6]), hinge)

    def lever(design: np.ndarray) -> g.Vector:
        return g.rotate_about_axis(tape, exact(design), hinge, angle)

    def centre(design: np.ndarray) -> m.Motion:
        now = lever(design)
        return frame.point(tape, g.add(exact(PIVOT), now), carried(tape, STILL, turn, now))

    axle, force, moment = lever(AXLE), loads[:3], loads[3:6]
    on_arm, moment_on_arm = loads[6:9], loads[9:]
    turning = frame.turning(tape, turn)
    if as_rotor:
        total = ARM_MASS + WHEEL_MASS
        middle = (ARM_MASS * ARM_CENTRE + WHEEL_MASS * WHEEL_CENTRE) / total
        design = TENSOR + ACROSS * np.eye(3) + (ABOUT - ACROSS) * np.outer(AXLE, AXLE)
        design += point_tensor(ARM_MASS, ARM_CENTRE - middle)
        design += point_tensor(WHEEL_MASS, WHEEL_CENTRE - middle)
        tensor = m.turned_tensor(tape, tensor_of(design), hinge, angle)
        about = g.add(moment, moment_on_arm)
        about = g.add(about, g.cross(lever(WHEEL_CENTRE - middle), force))
        about = g.add(about, g.cross(lever(ARM_CENTRE - middle), on_arm))
        rotor = m.Rotor(7, speeds[7], axle, sp.Float(ABOUT), g.dot(moment, axle))
        rotation = m.with_inertia(tape, tensor, turning)
        bodies = [
            m.Body(
                sp.Float(total),
                centre(middle),
                g.add(force, on_arm),
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
    frame = m.MovingFrame(speeds[:3], speeds[3:6], first=0)
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
