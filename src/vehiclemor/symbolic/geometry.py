"""Vectors and rotations whose components are named on a tape.

Components are SymPy scalars; a rotation is a tuple of three rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class Vector:
    """Three components in one frame; `a @ b` is the scalar product."""

    x: sp.Expr
    y: sp.Expr
    z: sp.Expr

    def __iter__(self) -> Iterator[sp.Expr]:
        return iter((self.x, self.y, self.z))

    def __getitem__(self, index: int) -> sp.Expr:
        return (self.x, self.y, self.z)[index]

    def __add__(self, other: Vector) -> Vector:
        return Vector(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: sp.Expr | int) -> Vector:
        return Vector(factor * self.x, factor * self.y, factor * self.z)

    def __matmul__(self, other: Vector) -> sp.Expr:
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vector) -> Vector:
        """Vector product."""
        return Vector(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )


Rotation = tuple[Vector, Vector, Vector]


def vector(components: Iterable[sp.Expr | float]) -> Vector:
    """Make a vector from three components."""
    x, y, z = (sp.sympify(component) for component in components)
    return Vector(x, y, z)


def named(tape: Tape, components: Iterable[sp.Expr]) -> Vector:
    """Name each component on the tape."""
    x, y, z = (tape.let(component) for component in components)
    return Vector(x, y, z)


def matrix(entry: Callable[[int, int], sp.Expr]) -> Rotation:
    """Three rows from their entries (row, column)."""
    rows = [Vector(entry(i, 0), entry(i, 1), entry(i, 2)) for i in range(3)]
    return rows[0], rows[1], rows[2]


def column(rotation: Rotation, number: int) -> Vector:
    """A column of a rotation: where it turns a unit vector."""
    return Vector(rotation[0][number], rotation[1][number], rotation[2][number])


def length(tape: Tape, a: Vector) -> sp.Expr:
    """Euclidean length, named on the tape."""
    return tape.let(sp.sqrt(tape.let(a @ a)))


def rotate(tape: Tape, rotation: Rotation, a: Vector) -> Vector:
    """Components of the rotated vector, named on the tape."""
    return named(tape, [row @ a for row in rotation])


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


def rotate_about_axis(tape: Tape, a: Vector, axis: Vector, angle: sp.Expr) -> Vector:
    """Rotate a vector about a unit axis by an angle (Rodrigues' formula).

    The part along the axis and the two vectors that span the circle are named on the tape, so that
    they are hoisted out of the kernel where they depend on parameters alone.
    """
    along = named(tape, axis * tape.let(axis @ a))
    across = named(tape, a - along)
    quarter_turn = named(tape, axis.cross(a))
    c, s = tape.let(sp.cos(angle)), tape.let(sp.sin(angle))
    return named(tape, along + across * c + quarter_turn * s)
