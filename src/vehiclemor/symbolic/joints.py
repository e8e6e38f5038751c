"""Motions relative to a moving frame: joints that turn or slide in it, and points they carry."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import ZERO, Motion
from vehiclemor.symbolic.tape import Tape


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


STILL = Motion(ZERO, {}, ZERO)
