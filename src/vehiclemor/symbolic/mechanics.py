"""Kane's equations of rigid bodies, assembled from geometric partial velocities on a tape.

Every velocity is linear in the speeds; its columns (partial velocities) follow from geometry, so
nothing is differentiated.  All vectors are components in one moving frame, the chassis.

T. R. Kane, D. A. Levinson, Dynamics: Theory and Applications (McGraw-Hill 1985), chapters 4 to 6.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.tape import Tape

ZERO: Vector = (sp.Integer(0), sp.Integer(0), sp.Integer(0))
UNIT: tuple[Vector, Vector, Vector] = (
    g.vector((1, 0, 0)),
    g.vector((0, 1, 0)),
    g.vector((0, 0, 1)),
)


@dataclass(frozen=True)
class Motion:
    """A velocity that is linear in the speeds.

    Attributes
    ----------
    value
        The velocity.
    columns
        Number of a speed -> partial velocity; speeds without influence are left out.
    bias
        Its rate of change in the inertial frame where the derivatives of all speeds are zero.
    """

    value: Vector
    columns: Mapping[int, Vector]
    bias: Vector


@dataclass(frozen=True)
class Body:
    """A rigid body or point mass with its resultant loads.

    Attributes
    ----------
    mass
        Mass in kg.
    centre
        Motion of the centre of mass.
    force
        Resultant applied force, gravity included, in N.
    rotation
        Angular velocity; its `bias` is the rate of the angular momentum about the centre of mass
        where the derivatives of all speeds are zero.  None for a point mass.
    inertia
        Tensor about the centre of mass (three rows) in kg m^2.
    moment
        Resultant applied moment about the centre of mass in N m.
    """

    mass: sp.Expr
    centre: Motion
    force: Vector
    rotation: Motion | None = None
    inertia: tuple[Vector, Vector, Vector] | None = None
    moment: Vector = ZERO


@dataclass(frozen=True)
class MovingFrame:
    """A body-fixed frame; its origin's velocity and its angular velocity are speeds themselves.

    Attributes
    ----------
    velocity, angular_velocity
        Components in the frame.
    first
        Number of the first of its six speeds.
    """

    velocity: Vector
    angular_velocity: Vector
    first: int

    def origin(self, tape: Tape) -> Motion:
        """Motion of the origin."""
        bias = g.named(tape, g.cross(self.angular_velocity, self.velocity))
        return Motion(self.velocity, {self.first + i: UNIT[i] for i in range(3)}, bias)

    def point(
        self, tape: Tape, place: Vector, slide: tuple[int, sp.Expr, Vector] | None = None
    ) -> Motion:
        """Motion of a point at a place in the frame.

        Parameters
        ----------
        slide
            (number of the speed, the speed, direction) of a translation relative to the frame.
        """
        origin, turn = self.origin(tape), self.angular_velocity
        velocity = g.add(self.velocity, g.cross(turn, place))
        columns = dict(origin.columns)
        columns |= {self.first + 3 + i: g.cross(UNIT[i], place) for i in range(3)}
        lever = g.named(tape, g.cross(turn, place))
        bias = g.add(origin.bias, g.cross(turn, lever))
        if slide is not None:
            number, speed, direction = slide
            velocity = g.add(velocity, g.scale(speed, direction))
            columns[number] = direction
            # Coriolis acceleration; the direction is fixed in the frame.
            bias = g.add(bias, g.scale(2 * speed, g.cross(turn, direction)))
        return Motion(g.named(tape, velocity), columns, g.named(tape, bias))

    def rotation(
        self,
        tape: Tape,
        inertia: tuple[Vector, Vector, Vector],
        spin: tuple[int, sp.Expr, Vector] | None = None,
    ) -> Motion:
        """Rotation of a body whose inertia tensor is constant in the frame.

        Parameters
        ----------
        inertia
            Tensor about the centre of mass.
        spin
            (number of the speed, the speed, axis) of a rotation relative to the frame about an axis
            of symmetry.
        """
        turn = self.angular_velocity
        value, columns = turn, {self.first + 3 + i: UNIT[i] for i in range(3)}
        if spin is not None:
            number, speed, axis = spin
            value = g.named(tape, g.add(turn, g.scale(speed, axis)))
            columns[number] = axis
        momentum = g.named(tape, product(inertia, value))
        return Motion(value, columns, g.named(tape, g.cross(turn, momentum)))


def product(tensor: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    """Product of a tensor and a vector."""
    return g.dot(tensor[0], a), g.dot(tensor[1], a), g.dot(tensor[2], a)


def axisymmetric_inertia(
    about_axis: sp.Expr, across: sp.Expr, axis: Vector
) -> tuple[Vector, Vector, Vector]:
    """Inertia tensor of a body of revolution about a unit axis."""
    excess = about_axis - across

    def row(i: int) -> Vector:
        return g.vector([excess * axis[i] * axis[j] + (across if i == j else 0) for j in range(3)])

    return row(0), row(1), row(2)


def kane(
    tape: Tape, speeds: int, bodies: Sequence[Body]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix (n x n) and forces (n) such that M d(speeds)/dt = F, named on the tape."""
    mass: list[list[sp.Expr]] = [[sp.Integer(0)] * speeds for _ in range(speeds)]
    force: list[sp.Expr] = [sp.Integer(0)] * speeds
    for body in bodies:
        free = g.subtract(body.force, g.scale(body.mass, body.centre.bias))
        loads = [(body.centre.columns, g.named(tape, free))]
        # Columns beside their images: mass times velocity, inertia times angular velocity.
        columns = body.centre.columns
        images = [(columns, {k: g.scale(body.mass, column) for k, column in columns.items()})]
        if body.rotation is not None and body.inertia is not None:
            columns = body.rotation.columns
            images.append((columns, {k: product(body.inertia, c) for k, c in columns.items()}))
            turning = g.named(tape, g.subtract(body.moment, body.rotation.bias))
            loads.append((columns, turning))
        for columns, weighted in images:
            for k, image in weighted.items():
                for j, other in columns.items():
                    if j >= k:
                        mass[j][k] += g.dot(other, image)
        for columns, load in loads:
            for j, column in columns.items():
                force[j] += g.dot(column, load)
    lower = [[tape.let(mass[j][k]) for k in range(j + 1)] for j in range(speeds)]
    full = [[lower[max(j, k)][min(j, k)] for k in range(speeds)] for j in range(speeds)]
    return full, [tape.let(f) for f in force]
