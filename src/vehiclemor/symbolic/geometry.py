"""Vectors and rotations whose components are named on a tape.

A vector is a tuple of three SymPy scalars in one frame; a rotation is a tuple of three rows.
"""

from collections.abc import Sequence

import sympy as sp

from vehiclemor.symbolic.tape import Tape

Vector = tuple[sp.Expr, sp.Expr, sp.Expr]
Rotation = tuple[Vector, Vector, Vector]
# An angle in rad, or its cosine and sine where no angle is known.
Angle = sp.Expr | tuple[sp.Expr, sp.Expr]


def vector(components: Sequence[sp.Expr | float]) -> Vector:
    """Make a vector from three components."""
    x, y, z = (sp.sympify(component) for component in components)
    return x, y, z


def named(tape: Tape, components: Sequence[sp.Expr]) -> Vector:
    """Name each component on the tape."""
    x, y, z = (tape.let(component) for component in components)
    return x, y, z


def add(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(factor: sp.Expr, a: Vector) -> Vector:
    """Product of a scalar and a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


def dot(a: Vector, b: Vector) -> sp.Expr:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(tape: Tape, a: Vector) -> sp.Expr:
    """Euclidean length, named on the tape."""
    return tape.let(sp.sqrt(tape.let(dot(a, a))))


def rotate(tape: Tape, rotation: Rotation, a: Vector) -> Vector:
    """Components of the rotated vector, named on the tape."""
    return named(tape, [dot(row, a) for row in rotation])


def euler_321(tape: Tape, yaw: sp.Expr, pitch: sp.Expr, roll: sp.Expr) -> Rotation:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll), 3-2-1 Euler angles in rad, named on the tape."""
    cz, sz = tape.let(sp.cos(yaw)), tape.let(sp.sin(yaw))
    cy, sy = tape.let(sp.cos(pitch)), tape.let(sp.sin(pitch))
    cx, sx = tape.let(sp.cos(roll)), tape.let(sp.sin(roll))
    cz_sy, sz_sy = tape.let(cz * sy), tape.let(sz * sy)
    return (
        named(tape, (cz * cy, cz_sy * sx - sz * cx, cz_sy * cx + sz * sx)),
        named(tape, (sz * cy, sz_sy * sx + cz * cx, sz_sy * cx - cz * sx)),
        named(tape, (-sy, cy * sx, cy * cx)),
    )


def cosine(tape: Tape, angle: Angle) -> sp.Expr:
    """Cosine of an angle, named on the tape."""
    return angle[0] if isinstance(angle, tuple) else tape.let(sp.cos(angle))


def sine(tape: Tape, angle: Angle) -> sp.Expr:
    """Sine of an angle, named on the tape."""
    return angle[1] if isinstance(angle, tuple) else tape.let(sp.sin(angle))


def rotate_about_axis(tape: Tape, a: Vector, axis: Vector, angle: Angle) -> Vector:
    """Rotate a vector about a unit axis by an angle (Rodrigues' formula).

    The part along the axis and the two vectors that span the circle are named on the tape, so that
    they are hoisted out of the kernel where they depend on parameters alone.
    """
    along = named(tape, scale(tape.let(dot(axis, a)), axis))
    across = named(tape, subtract(a, along))
    quarter_turn = named(tape, cross(axis, a))
    c, s = cosine(tape, angle), sine(tape, angle)
    return named(tape, add(along, add(scale(c, across), scale(s, quarter_turn))))
