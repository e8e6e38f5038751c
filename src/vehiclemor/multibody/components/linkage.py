"""A double-wishbone corner with its tie rod: geometry, closures, and motions of its bodies.

Shared by the kinematic suspension model and by the vehicle that has two of these corners.  Joint
coordinates: Uchida and McPhee (2012), Multibody Syst. Dyn. 28(4), 331-347.  On the right side the
points are mirrored and the rotations follow the same right-hand rules.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.mechanics import STILL, Motion, Rate, along, carried, successive
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class Arm:
    """Control arm that turns about the axis from its rear to its front pivot."""

    # Pivots on the chassis.
    rear: g.Vector
    front: g.Vector
    angle: sp.Expr  # Rotation from the design position.

    def axis(self, tape: Tape) -> g.Vector:
        """Unit axis."""
        between = g.named(tape, self.front - self.rear)
        return g.named(tape, between * (1 / g.length(tape, between)))

    def lever(self, tape: Tape, point: g.Vector) -> g.Vector:
        """From the rear pivot to where a point has moved, given its design position."""
        axis = self.axis(tape)
        design = g.named(tape, point - self.rear)
        return g.rotate_about_axis(tape, design, axis, self.angle)

    def moved(self, tape: Tape, point: g.Vector) -> g.Vector:
        """Where a point has moved, given its design position."""
        return g.named(tape, self.rear + self.lever(tape, point))


@dataclass(frozen=True)
class Linkage:
    """Bodies of a corner in their present position, components in the chassis frame."""

    # Control arms.
    upper: Arm
    lower: Arm
    upper_ball_joint: g.Vector  # On the upper arm; the wheel carrier's reference point.
    carrier: g.Rotation  # Orientation of the wheel carrier.
    design_ball_joint: g.Vector  # The upper ball joint at the design position.
    rack_end: g.Vector  # Inner end of the tie rod.
    rod: g.Vector  # Vector from the inner to the outer end of the tie rod.
    # Unit vector along the tie rod: outwards on the left side, inwards on the right.
    rod_direction: g.Vector

    def carrier_lever(self, tape: Tape, point: g.Vector) -> g.Vector:
        """From the upper ball joint to a point of the carrier, given its design position."""
        design = g.named(tape, point - self.design_ball_joint)
        return g.rotate(tape, self.carrier, design)

    def on_carrier(self, tape: Tape, point: g.Vector) -> g.Vector:
        """Where a point of the carrier has moved, given its design position."""
        return g.named(tape, self.upper_ball_joint + self.carrier_lever(tape, point))

    def gaps(self, tape: Tape, points: Mapping[str, g.Vector]) -> list[sp.Expr]:
        """The closures (6): lower ball joint, then outer tie-rod joint."""
        ball, outer = points["lower_ball_joint"], points["tie_rod_outer"]
        return [
            *self.on_carrier(tape, ball) - self.lower.moved(tape, ball),
            *self.on_carrier(tape, outer) - g.named(tape, self.rack_end + self.rod),
        ]


def assembled(
    tape: Tape,
    # zeta, eta, xi (3-2-1 Euler angles of the carrier), theta_u, theta_l (arms), alpha, beta
    # (universal joint of the tie rod), rad.
    q: Sequence[sp.Symbol],
    rack: sp.Symbol,  # Displacement of the rack, positive to the left, in m.
    points: Mapping[str, g.Vector],  # `points.POINTS` of this side.
    side: int = 1,  # 1 for the left, -1 for the right side.
) -> Linkage:
    """Bodies of a corner."""
    zeta, eta, xi, theta_u, theta_l, alpha, beta = q

    def arm(name: str, angle: sp.Symbol) -> Arm:
        return Arm(points[f"{name}_arm_rear_pivot"], points[f"{name}_arm_front_pivot"], angle)

    upper = arm("upper", theta_u)
    ball = points["upper_ball_joint"]
    ball_joint = upper.moved(tape, ball)
    carrier = g.euler_321(tape, zeta, eta, xi)
    inner, outer = points["tie_rod_inner"], points["tie_rod_outer"]
    rod_length = g.length(tape, g.named(tape, outer - inner))
    cos_beta = tape.let(sp.cos(beta))
    direction = g.vector((-sp.sin(alpha) * cos_beta, sp.cos(alpha) * cos_beta, sp.sin(beta)))
    rack_end = g.named(tape, (inner[0], inner[1] + rack, inner[2]))
    rod = direction * (side * rod_length)
    return Linkage(
        upper, arm("lower", theta_l), ball_joint, carrier, ball, rack_end, rod, direction
    )


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
    rack: Sequence[sp.Expr],  # Velocity and acceleration of the rack.
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
    tape: Tape, linkage: Linkage, motions: LinkageMotions, points: Mapping[str, g.Vector]
) -> tuple[list[sp.Expr], list[Motion]]:
    """Closures of a corner (6) and their motions, see `Linkage.gaps`."""
    gaps = linkage.gaps(tape, points)
    ball, outer = points["lower_ball_joint"], points["tie_rod_outer"]

    def on_carrier(point: g.Vector) -> Motion:
        lever = linkage.carrier_lever(tape, point)
        return carried(tape, motions.ball_joint, motions.carrier, lever)

    rod = g.named(tape, linkage.rod)
    pairs = (
        (on_carrier(ball), carried(tape, STILL, motions.lower, linkage.lower.lever(tape, ball))),
        (on_carrier(outer), carried(tape, motions.rack_end, motions.rod, rod)),
    )
    named_gaps = [tape.let(gap) for gap in gaps]
    return named_gaps, [relative(tape, a, b) for a, b in pairs]


def relative(tape: Tape, a: Motion, b: Motion) -> Motion:
    """Motion of one point less that of another."""
    columns = dict(a.columns)
    for k, column in b.columns.items():
        columns[k] = columns.get(k, m.ZERO) - column
    named = {k: g.named(tape, column) for k, column in columns.items()}
    value, bias = a.value - b.value, a.bias - b.bias
    return Motion(g.named(tape, value), named, g.named(tape, bias))
