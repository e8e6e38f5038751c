"""Kane's equations of rigid bodies, assembled from geometric partial velocities on a tape.

Every velocity is linear in the speeds; its columns (partial velocities) follow from geometry, so
nothing is differentiated.  All vectors are components in one moving frame, the chassis.  What moves
in the frame, by joints that turn or slide, has motions relative to it.

T. R. Kane, D. A. Levinson, Dynamics: Theory and Applications (McGraw-Hill 1985), chapters 4 to 6.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.tape import Tape

Tensor = g.Rotation
Matrix = Sequence[Sequence[sp.Expr]]

ZERO = g.vector((0, 0, 0))
UNIT = g.vector((1, 0, 0)), g.vector((0, 1, 0)), g.vector((0, 0, 1))


@dataclass(frozen=True)
class Motion:
    """A velocity that is linear in the speeds."""

    value: Vector  # The velocity.
    # Number of a speed -> partial velocity; speeds without influence are left out.
    columns: Mapping[int, Vector]
    # Its rate of change in the inertial frame where the derivatives of all speeds are zero.
    bias: Vector


STILL = Motion(ZERO, {}, ZERO)


@dataclass(frozen=True)
class Rotor:
    """A body of revolution that spins in another body, to which its mass and tensor are counted."""

    # Number of its speed, and the speed: the spin relative to the body in rad/s.
    number: int
    speed: sp.Expr
    axis: Vector  # Unit axis, fixed in the body.
    inertia: sp.Expr  # Moment of inertia about the axis in kg m^2.
    moment: sp.Expr  # Applied moment about the axis in N m.
    # Angular acceleration of the other body where the derivatives of all speeds are zero.
    acceleration: Vector


@dataclass(frozen=True)
class Body:
    """A rigid body with its resultant loads."""

    mass: sp.Expr  # Mass in kg.
    centre: Motion  # Motion of the centre of mass.
    force: Vector  # Resultant applied force, gravity included, in N.
    # Angular velocity; its `bias` is the rate of the angular momentum about the centre of mass
    # where the derivatives of all speeds are zero.
    rotation: Motion
    inertia: Tensor  # Tensor about the centre of mass (three rows) in kg m^2.
    # Resultant applied moment about the centre of mass in N m; that on a rotor included.
    moment: Vector = ZERO
    rotor: Rotor | None = None  # What spins in it.


@dataclass(frozen=True)
class MovingFrame:
    """A body-fixed frame; its origin's velocity and angular velocity are the first six speeds."""

    # Components in the frame.
    velocity: Vector
    angular_velocity: Vector
    # Acceleration of the origin where the derivatives of all speeds are zero; None where the first
    # three speeds are the components of its velocity in this frame.  Gravity can be counted here,
    # as an acceleration upwards.
    acceleration: Vector | None = None

    def origin(self, tape: Tape) -> Motion:
        """Motion of the origin."""
        bias = self.acceleration
        if bias is None:
            bias = g.named(tape, self.angular_velocity.cross(self.velocity))
        return Motion(self.velocity, dict(enumerate(UNIT)), bias)

    def point(self, tape: Tape, position: Vector, relative: Motion) -> Motion:
        """Motion of a point at a position in the frame, with its motion relative to the frame."""
        origin, turn = self.origin(tape), self.angular_velocity
        velocity = self.velocity + turn.cross(position) + relative.value
        columns = dict(origin.columns)
        columns |= {3 + i: UNIT[i].cross(position) for i in range(3)}
        columns |= relative.columns
        lever = g.named(tape, turn.cross(position))
        coriolis = turn.cross(relative.value) * sp.Integer(2)
        bias = origin.bias + turn.cross(lever) + coriolis + relative.bias
        return Motion(g.named(tape, velocity), columns, g.named(tape, bias))

    def angular_velocity_of(self, tape: Tape, relative: Motion) -> Motion:
        """Angular velocity of a body that turns relative to the frame; biases are accelerations."""
        turn = self.angular_velocity
        columns = {3 + i: UNIT[i] for i in range(3)} | dict(relative.columns)
        bias = turn.cross(relative.value) + relative.bias
        return Motion(g.named(tape, turn + relative.value), columns, g.named(tape, bias))

    def rotation(
        self, tape: Tape, inertia: Tensor, spin: tuple[int, sp.Expr, Vector] | None = None
    ) -> Motion:
        """Rotation of a body whose inertia tensor is constant in the frame.

        It may spin about an axis of symmetry: (number of the speed, the speed, axis).
        """
        turn = self.angular_velocity
        value, columns = turn, {3 + i: UNIT[i] for i in range(3)}
        if spin is not None:
            number, speed, axis = spin
            value = g.named(tape, turn + axis * speed)
            columns[number] = axis
        momentum = g.named(tape, product(inertia, value))
        return Motion(value, columns, g.named(tape, turn.cross(momentum)))


@dataclass(frozen=True)
class Rate:
    """Rate of a joint coordinate, and its derivative as a linear function of others."""

    value: sp.Expr  # The rate.
    # Number of a speed -> factor of its derivative in the derivative of this rate.
    columns: Mapping[int, sp.Expr]
    bias: sp.Expr  # Derivative of this rate where those of all speeds are zero.


def free_rate(number: int, speed: sp.Expr) -> Rate:
    """Rate that is a speed itself."""
    return Rate(speed, {number: sp.Integer(1)}, sp.Integer(0))


def along(rate: Rate, direction: Vector) -> Motion:
    """Translation along, or rotation about, a direction that is fixed in the frame."""
    columns = {k: direction * factor for k, factor in rate.columns.items()}
    return Motion(direction * rate.value, columns, direction * rate.bias)


def successive(tape: Tape, rates: Sequence[Rate], axes: Sequence[Vector]) -> Motion:
    """Rotation about several axes, each carried by those before it, such as Euler angles.

    Unit axes stand in their present directions, as components in the frame.
    """
    value, bias = ZERO, ZERO
    columns: dict[int, Vector] = {}
    for rate, axis in zip(rates, axes, strict=True):
        part = along(rate, axis)
        swept = value.cross(part.value)
        bias = g.named(tape, bias + part.bias + swept)
        value = g.named(tape, value + part.value)
        for k, column in part.columns.items():
            columns[k] = columns.get(k, ZERO) + column
    return Motion(value, {k: g.named(tape, c) for k, c in columns.items()}, bias)


def carried(tape: Tape, base: Motion, rotation: Motion, lever: Vector) -> Motion:
    """Motion of a point of a body, from that of another of its points and from its rotation.

    The lever leads from the other point to this one.
    """
    turn = rotation.value
    swept = g.named(tape, turn.cross(lever))
    value = g.named(tape, base.value + swept)
    bias = base.bias + rotation.bias.cross(lever) + turn.cross(swept)
    columns = dict(base.columns)
    for k, column in rotation.columns.items():
        columns[k] = columns.get(k, ZERO) + column.cross(lever)
    columns = {k: g.named(tape, column) for k, column in columns.items()}
    return Motion(value, columns, g.named(tape, bias))


def with_inertia(tape: Tape, inertia: Tensor, turning: Motion) -> Motion:
    """Rotation of a `Body` from its angular velocity, see `MovingFrame.angular_velocity_of`.

    The tensor is about the centre of mass, in components of the frame at this moment.
    """
    momentum = g.named(tape, product(inertia, turning.value))
    bias = product(inertia, turning.bias) + turning.value.cross(momentum)
    return Motion(turning.value, turning.columns, g.named(tape, bias))


def product(tensor: Tensor, a: Vector) -> Vector:
    """Product of a tensor and a vector."""
    return Vector(tensor[0] @ a, tensor[1] @ a, tensor[2] @ a)


def axisymmetric_inertia(about_axis: sp.Expr, across: sp.Expr, axis: Vector) -> Tensor:
    """Inertia tensor of a body of revolution about a unit axis."""
    excess = about_axis - across
    return g.matrix(lambda i, j: excess * axis[i] * axis[j] + (across if i == j else 0))


def kane(
    tape: Tape, speeds: int, bodies: Sequence[Body]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix (n x n) and forces (n) such that M d(speeds)/dt = F, named on the tape."""
    mass: list[list[sp.Expr]] = [[sp.Integer(0)] * speeds for _ in range(speeds)]
    force: list[sp.Expr] = [sp.Integer(0)] * speeds
    for body in bodies:
        velocities, turns = body.centre.columns, body.rotation.columns
        free = g.named(tape, body.force - body.centre.bias * body.mass)
        turning = body.moment - body.rotation.bias
        if body.rotor is not None:
            turning = turning - _add_rotor(tape, body.rotor, body.rotation, mass, force)
        loads = [(velocities, free), (turns, g.named(tape, turning))]
        # Columns of the momenta: mass times velocity, inertia times angular velocity.
        momenta = {k: column * body.mass for k, column in velocities.items()}
        spins = {k: product(body.inertia, column) for k, column in turns.items()}
        for columns, weighted in [(velocities, momenta), (turns, spins)]:
            for k, image in weighted.items():
                for j, other in columns.items():
                    if j >= k:
                        mass[j][k] += other @ image
        for columns, load in loads:
            for j, column in columns.items():
                force[j] += column @ load
    lower = [[tape.let(mass[j][k]) for k in range(j + 1)] for j in range(speeds)]
    full = [[lower[max(j, k)][min(j, k)] for k in range(speeds)] for j in range(speeds)]
    return full, [tape.let(f) for f in force]


def _add_rotor(
    tape: Tape, rotor: Rotor, rotation: Motion, mass: list[list[sp.Expr]], force: list[sp.Expr]
) -> Vector:
    """Add the row of a rotor; the rate of its momentum that is due to the body's turning."""
    momentum = g.named(tape, rotor.axis * rotor.inertia)
    for k, column in rotation.columns.items():
        mass[max(rotor.number, k)][min(rotor.number, k)] += momentum @ column
    mass[rotor.number][rotor.number] += rotor.inertia
    force[rotor.number] += rotor.moment - (momentum @ rotor.acceleration)
    spin = g.named(tape, momentum * rotor.speed)
    return rotation.value.cross(spin)


def turned_tensor(tape: Tape, tensor: Tensor, axis: Vector, angle: sp.Expr) -> Tensor:
    """Tensor R T R^T of a body that has turned about a unit axis by an angle.

    A polynomial in sine and cosine whose coefficients, where tensor and axis are parameters, are
    hoisted out of the kernel.
    """
    along = [[tape.let(a * b) for b in axis] for a in axis]
    across = [[(1 if i == j else 0) - along[i][j] for j in range(3)] for i in range(3)]
    x, y, z = axis
    quarter = [[sp.Integer(0), -z, y], [z, sp.Integer(0), -x], [-y, x, sp.Integer(0)]]

    def sandwich(left: Matrix, right: Matrix) -> list[list[sp.Expr]]:
        """Product left T right^T."""
        columns = [g.named(tape, product(tensor, g.vector(row))) for row in right]
        return [[tape.let(g.vector(row) @ column) for column in columns] for row in left]

    sine, cosine = tape.let(sp.sin(angle)), tape.let(sp.cos(angle))
    both, square = tape.let(sine * cosine), tape.let(sine * sine)
    still, full = sandwich(along, along), sandwich(across, across)
    turned, first = sandwich(quarter, quarter), sandwich(along, across)
    second, third = sandwich(along, quarter), sandwich(across, quarter)

    def entry(i: int, j: int) -> sp.Expr:
        return tape.let(
            tape.let(still[i][j] + full[i][j])
            + cosine * tape.let(first[i][j] + first[j][i])
            + sine * tape.let(second[i][j] + second[j][i])
            + both * tape.let(third[i][j] + third[j][i])
            + square * tape.let(turned[i][j] - full[i][j])
        )

    return _symmetric(entry)


def rotated_tensor(tape: Tape, tensor: Tensor, rotation: Tensor) -> Tensor:
    """Tensor R T R^T."""
    inner = [g.named(tape, product(tensor, row)) for row in rotation]
    return _symmetric(lambda i, j: tape.let(rotation[i] @ inner[j]))


def point_mass_tensor(mass: sp.Expr, lever: Vector) -> Tensor:
    """Tensor of a point mass about a point from which the lever leads to it."""
    square = lever @ lever
    return _symmetric(
        lambda i, j: mass * ((square if i == j else sp.Integer(0)) - lever[i] * lever[j])
    )


def _symmetric(entry: Callable[[int, int], sp.Expr]) -> Tensor:
    e = {(i, j): entry(i, j) for i in range(3) for j in range(i + 1)}
    return g.matrix(lambda i, j: e[max(i, j), min(i, j)])
