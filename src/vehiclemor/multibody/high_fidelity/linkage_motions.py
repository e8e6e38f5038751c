"""Motions of a double-wishbone corner's bodies relative to the chassis, and of its closures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.double_wishbone.linkage import Linkage
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.joints import STILL, Rate, along, carried, successive
from vehiclemor.symbolic.mechanics import Motion
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class LinkageMotions:
    """Motions of a double-wishbone corner's bodies relative to the chassis."""

    # Rotations of control arms, wheel carrier and tie rod.
    upper: Motion
    lower: Motion
    carrier: Motion
    rod: Motion
    # Motions of the upper ball joint and of the tie rod's inner end.
    ball_joint: Motion
    rack_end: Motion


def linkage_motions(
    tape: Tape,
    linkage: Linkage,
    q: Sequence[sp.Symbol],
    rates: Sequence[Rate],
    rack: tuple[sp.Expr, sp.Expr],  # Velocity and acceleration of the rack.
) -> LinkageMotions:
    """Relative motions for rates of the seven joint coordinates q."""
    zeta, alpha = q[0], q[5]
    turned_y = g.vector((-tape.let(sp.sin(zeta)), tape.let(sp.cos(zeta)), 0))
    turned_x = g.vector((tape.let(sp.cos(alpha)), tape.let(sp.sin(alpha)), 0))
    upper = along(rates[3], linkage.upper.axis(tape))
    lever = linkage.upper.lever(tape, linkage.design_ball_joint)
    return LinkageMotions(
        upper,
        along(rates[4], linkage.lower.axis(tape)),
        successive(tape, rates[:3], (m.UNIT[2], turned_y, g.column(linkage.carrier, 0))),
        successive(tape, rates[5:7], (m.UNIT[2], turned_x)),
        carried(tape, STILL, upper, lever),
        Motion(g.vector((0, rack[0], 0)), {}, g.vector((0, rack[1], 0))),
    )


def closures(
    tape: Tape, linkage: Linkage, motions: LinkageMotions, points: Mapping[str, Vector]
) -> tuple[list[sp.Expr], list[Motion]]:
    """Closures of a corner (6) and their motions: lower ball joint, then outer tie-rod joint."""
    ball, outer = points["lower_ball_joint"], points["tie_rod_outer"]
    gaps = [
        *linkage.on_carrier(tape, ball) - linkage.on_lower_arm(tape, ball),
        *linkage.on_carrier(tape, outer) - g.named(tape, linkage.rod_end),
    ]

    def on_carrier(place: Vector) -> Motion:
        lever = linkage.carrier_lever(tape, place)
        return carried(tape, motions.ball_joint, motions.carrier, lever)

    rod = g.named(tape, linkage.rod)
    pairs = (
        (on_carrier(ball), carried(tape, STILL, motions.lower, linkage.lower.lever(tape, ball))),
        (on_carrier(outer), carried(tape, motions.rack_end, motions.rod, rod)),
    )
    return [tape.let(gap) for gap in gaps], [relative(tape, a, b) for a, b in pairs]


def relative(tape: Tape, a: Motion, b: Motion) -> Motion:
    """Motion of one point less that of another."""
    columns = dict(a.columns)
    for k, column in b.columns.items():
        columns[k] = columns.get(k, m.ZERO) - column
    named = {k: g.named(tape, column) for k, column in columns.items()}
    value, bias = a.value - b.value, a.bias - b.bias
    return Motion(g.named(tape, value), named, g.named(tape, bias))
