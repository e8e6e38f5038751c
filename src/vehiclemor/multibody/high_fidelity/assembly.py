"""Equations of the high-fidelity vehicle assembled from its four corners, and its outputs."""

from collections.abc import Mapping, Sequence

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.components.tires import tire_outputs
from vehiclemor.multibody.high_fidelity.corners import Corner, diagonal
from vehiclemor.multibody.high_fidelity.parts import Vehicle
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.tape import Tape


def kane(
    tape: Tape, v: Vehicle, parts: Sequence[Corner]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix and forces of all bodies, springs added."""
    frame, p = v.frame, v.p
    inertia = diagonal(p, "chassis_inertia")
    chassis = mechanics.Body(
        p["chassis_mass"],
        frame.origin(tape),
        mechanics.ZERO,
        frame.rotation(tape, inertia),
        inertia,
    )
    bodies = [chassis, *(part for corner in parts for part in corner.bodies)]
    mass, force = mechanics.kane(tape, v.numbers.total, bodies)
    for number, corner in zip(v.numbers.arms, parts, strict=True):
        force[number] = tape.let(force[number] + corner.spring_moment)
    return mass, force


def solved(tape: Tape, v: Vehicle, parts: Sequence[Corner]) -> dict[int, sp.Expr]:
    """Derivatives of the independent speeds by number; of the chassis', see `kane`."""
    mass, force = kane(tape, v, parts)
    order = v.numbers.order
    chosen = sorted(order)
    values = eliminate_symmetric(
        tape,
        [[mass[j][k] for k in chosen] for j in chosen],
        [force[j] for j in chosen],
        [chosen.index(k) for k in order],
    )
    return dict(zip(chosen, values, strict=True))


def chassis_accelerations(
    tape: Tape, attitude: body.Attitude, solved: Mapping[int, sp.Expr], speeds: Sequence[sp.Expr]
) -> list[sp.Expr]:
    """Second derivatives of position, yaw, pitch and roll."""
    turning = g.vector(speeds[3:6])
    position = g.rotate(tape, attitude.rotation, g.vector([solved[k] for k in range(3)]))
    bias = body.angle_bias(tape, attitude, turning)
    change = g.named(tape, g.vector([solved[k] for k in range(3, 6)]) - bias)
    return [*position, *body.angle_rates(tape, attitude, change)]


def outputs(
    tape: Tape,
    v: Vehicle,
    parts: Sequence[Corner],
    speeds: Sequence[sp.Expr],
    carriers: Sequence[g.Rotation],  # Orientations of the front wheel carriers.
) -> list[sp.Expr]:
    """The model's outputs but for the last two, which measure the constraints."""
    q = v.q
    contacts = [corner.contact for corner in parts]
    return [
        *(q[0], q[1], q[3], q[4], q[5]),
        *(speeds[0], speeds[1], v.rates[2], speeds[5]),
        *tire_outputs(
            [corner.tire for corner in parts],
            [contact.load for contact in contacts],
            [contact.slip_ratio for contact in contacts],
            [tape.let(sp.atan(contact.tan_slip)) for contact in contacts],
        ),
        *(tape.let(sp.atan2(-carrier[0][1], carrier[1][1])) for carrier in carriers),
    ]
