"""Wheels of the vehicle with frozen inertia: places from polynomials, exact contact and tires."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.components import tilted_wheel
from vehiclemor.multibody.components.tires import fiala, maximum
from vehiclemor.multibody.high_fidelity import frozen_quantities as frozen
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import UNIT, ZERO
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class Wheel:
    """A wheel with what it does to the chassis and to its arm.

    Attributes
    ----------
    force, moment
        On the chassis, the moment about its origin.
    arm
        Generalised force on the arm, of the mirrored angle on the right side.
    spin
        Derivative of the spin in space.
    turn
        Angular velocity of the carrier or arm about the axle.
    """

    force: Vector
    moment: Vector
    arm: sp.Expr
    spin: sp.Expr
    turn: sp.Expr


@dataclass(frozen=True)
class Place:
    """Wheel centre and axle on the chassis, their derivatives by the arm's angle, their rates."""

    centre: Vector
    axle: Vector
    centre_by_arm: Vector
    axle_by_arm: Vector
    centre_rate: Vector
    axle_rate: Vector
    turn: sp.Expr


def horner(tape: Tape, coefficients: Sequence[sp.Expr], x: sp.Expr) -> sp.Expr:
    """Value of a polynomial."""
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = tape.let(coefficient + x * value)
    return value


def slope(coefficients: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Coefficients of the derivative of a polynomial."""
    return [k * coefficient for k, coefficient in enumerate(coefficients)][1:]


def front_place(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    angle: sp.Expr,
    rate: sp.Expr,
    rack: Sequence[sp.Expr],
    side: int,
) -> Place:
    """A front wheel on the chassis; on the right side it is the mirror image of the left one."""
    let = tape.let
    s, s_dot = side * rack[0], side * rack[1]
    values, by_arm, rates = [], [], []
    for name in frozen.FRONT_MAPS:
        # Polynomials in the rack's displacement, whose values are coefficients of the angle.
        rows = [
            [c[f"{name}_{i}_{j}"] for power, j in frozen.MONOMIALS if power == i]
            for i in range(frozen.DEGREE + 1)
        ]
        at_rack = [horner(tape, row, s) for row in rows]
        values.append(horner(tape, at_rack, angle))
        by_arm.append(horner(tape, [let(e) for e in slope(at_rack)], angle))
        # The rack moves slowly: its share of the rate to first order.
        by_rack = let(rows[0][1] + 2 * rows[0][2] * s + rows[1][1] * angle)
        rates.append(let(by_arm[-1] * rate + by_rack * s_dot))

    def centre(v: Sequence[sp.Expr]) -> Vector:
        return Vector(v[0], side * v[1], v[2])

    def axle(x: sp.Expr, y: sp.Expr, z: sp.Expr) -> Vector:
        # It points to the left on both sides.
        return Vector(side * x, y, side * z)

    # The axle is a unit vector near y: to fourth order of its other components.
    x, z = values[3:]
    small = let(1 - (x**2 + z**2) / 2)
    along = [let(-(x * v[3] + z * v[4])) for v in (by_arm, rates)]
    turn = let(c["turn_by_arm"] * rate + c["turn_by_rack"] * s_dot)
    return Place(
        centre(values),
        axle(x, small, z),
        centre(by_arm),
        axle(by_arm[3], along[0], by_arm[4]),
        centre(rates),
        axle(rates[3], along[1], rates[4]),
        turn,
    )


def rear_place(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    angle: sp.Expr,
    rate: sp.Expr,
    rack: Sequence[sp.Expr],
    side: int,
) -> Place:
    """A rear wheel on the chassis; its axle keeps its direction."""
    del rack
    x, z = ([c[f"{name}_{i}"] for i in range(frozen.DEGREE + 1)] for name in frozen.REAR_MAPS)
    centre = Vector(horner(tape, x, angle), side * c["rear_centre_y"], horner(tape, z, angle))
    by_arm = g.vector((horner(tape, slope(x), angle), 0, horner(tape, slope(z), angle)))
    rates = g.named(tape, by_arm * rate)
    return Place(centre, UNIT[1], by_arm, ZERO, rates, ZERO, rate)


def wheel_on_road(
    tape: Tape,
    place: Place,
    up: Vector,
    height: sp.Expr,
    nu: Sequence[sp.Expr],
    spin: sp.Expr,
    p: Mapping[str, sp.Expr],
    end: str,
) -> Wheel:
    """Tire forces and the wheel's gyroscopic moment, as they act on chassis, arm and wheel.

    The contact is that of `tilted_wheel`, in the directions of heading, axle and road normal.
    """
    let, axle = tape.let, place.axle
    turning = g.vector(nu[3:6])
    tilt = let(axle @ up)
    # The axle is a unit vector; the cosine is that of the camber angle.
    cosine = let(sp.sqrt(let(1 - tilt**2)))
    inverse = let(1 / cosine)
    heading = g.named(tape, axle.cross(up) * inverse)
    radius = let((height + (up @ place.centre)) * inverse)
    velocity = g.named(tape, g.vector(nu[:3]) + turning.cross(place.centre) + place.centre_rate)
    # The axle's change gives the part of the carrier's rotation across the axle; that about it
    # is in the spin.
    change = g.named(tape, turning.cross(axle) + place.axle_rate)
    rise, tilting = let(velocity @ up), let(change @ up)
    turn = let((turning @ axle) + place.turn)
    ahead = let(velocity @ heading)
    forward = let(ahead - radius * turn)
    lateral = let(((velocity @ axle) - tilt * rise) * inverse + radius * tilting)
    rate = let(rise + let(radius * tilt) * let(tilting * inverse)) * inverse
    load = tilted_wheel.vertical_load(tape, radius, rate, p)
    per_speed = let(1 / maximum(tape, let(sp.Abs(forward)), p["slip_speed"]))
    slip = let(let(spin * radius - ahead) * per_speed)
    tire = fiala(tape, p, load, slip, let(lateral * per_speed))

    # Force in the directions of heading, axle and normal; the leftward direction is
    # (axle - tilt normal) / cosine.
    sideways = let(tire.lateral * inverse)
    upwards = let(load - sideways * tilt)
    force = g.named(tape, heading * tire.longitudinal + axle * sideways + up * upwards)
    # Moment about the wheel centre, without its part about the axle, which turns the wheel.
    along = let(tire.lateral * cosine + load * tilt)
    rolling, twist = let(radius * along), tire.aligning
    momentum = let(p[f"{end}_wheel_spin_inertia"] * spin)
    free = heading * rolling + (up - axle * tilt) * twist
    free = g.named(tape, free - change * momentum)
    on_arm = force @ place.centre_by_arm
    if place.axle_by_arm != ZERO:
        # The axle turns with its arm about axle x (its derivative).
        on_arm += place.axle_by_arm @ g.named(tape, free.cross(axle))
    moment = free + place.centre.cross(force)
    driving = let(twist * tilt - radius * tire.longitudinal)
    return Wheel(
        force,
        g.named(tape, moment),
        let(on_arm),
        let(driving * let(1 / p[f"{end}_wheel_spin_inertia"])),
        turn,
    )
