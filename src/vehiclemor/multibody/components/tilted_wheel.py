"""A wheel on the road with camber: contact point in the wheel's plane, vertical load, tire forces.

The contact point is where the wheel's plane, through its centre and across its spin axis, meets the
road; the loaded radius is also the effective rolling radius.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.components.tires import TireForces, fiala, maximum, minimum
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class TiltedContact:
    """Wheel on the road, chassis components."""

    arm: Vector  # From the wheel centre to the contact point in m.
    # Unit vectors along and across the wheel in the road's plane, and its normal.
    heading: Vector
    leftward: Vector
    up: Vector
    load: sp.Expr  # Vertical force in N, not negative.
    # kappa and the tangent of the slip angle (sliding to the left is positive).
    slip_ratio: sp.Expr
    tan_slip: sp.Expr

    def loads(self, tape: Tape, tire: TireForces) -> tuple[Vector, Vector]:
        """Force on the wheel and its moment about the wheel centre."""
        shear = self.heading * tire.longitudinal + self.leftward * tire.lateral
        force = g.named(tape, shear + self.up * self.load)
        moment = self.arm.cross(force) + self.up * tire.aligning
        return force, g.named(tape, moment)


def tilted_contact(
    tape: Tape,
    up: Vector,  # Road normal.
    height: sp.Expr,  # Height of the wheel centre above the road.
    axle: Vector,  # Unit spin axis.
    # Velocity of the wheel centre, angular velocity of the carrier without the spin.
    velocity: Vector,
    turning: Vector,
    spin: sp.Expr,  # Spin of the wheel on its carrier in rad/s.
    p: Mapping[str, sp.Expr],  # `tire_radius`, `tire_stiffness`, `tire_damping`, `slip_speed`.
) -> TiltedContact:
    """Contact of a wheel with camber."""
    let = tape.let
    across = g.named(tape, axle.cross(up))
    # The length of axle x up is the cosine of the camber angle.
    cosine = g.length(tape, across)
    inverse = let(1 / cosine)
    heading = g.named(tape, across * inverse)
    leftward = g.named(tape, up.cross(heading))
    down = g.named(tape, axle.cross(heading))
    radius = let(height * inverse)
    arm = g.named(tape, down * radius)
    sliding = g.named(tape, velocity + turning.cross(arm))
    forward, lateral = let(sliding @ heading), let(sliding @ leftward)
    rise = let(sliding @ up)

    load = vertical_load(tape, radius, rise * inverse, p)
    per_speed = let(1 / maximum(tape, let(sp.Abs(forward)), p["slip_speed"]))
    return TiltedContact(
        arm,
        heading,
        leftward,
        up,
        load,
        let(let(spin * radius - forward) * per_speed),
        let(lateral * per_speed),
    )


def vertical_load(tape: Tape, radius: sp.Expr, rate: sp.Expr, p: Mapping[str, sp.Expr]) -> sp.Expr:
    """Vertical force of a wheel that pushes and never pulls, from its loaded radius and rate."""
    let = tape.let
    pressed = let(p["tire_radius"] - radius)
    elastic = let(let(p["tire_stiffness"] / 2) * (pressed + sp.Abs(pressed)))
    damping = let(-p["tire_damping"] * let(rate))
    total = let(elastic + minimum(tape, elastic, damping))
    return let((total + sp.Abs(total)) / 2)


def tire_on(tape: Tape, contact: TiltedContact, p: Mapping[str, sp.Expr]) -> TireForces:
    """Forces of a Fiala tire at the contact."""
    return fiala(tape, p, contact.load, contact.slip_ratio, contact.tan_slip)
