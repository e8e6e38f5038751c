"""Geometry of a double-wishbone corner with its tie rod: bodies as seen from their joints.

Shared by the kinematic suspension model and by the vehicle that has two of these corners.  Joint
coordinates: Uchida and McPhee (2012), Multibody Syst. Dyn. 28(4), 331-347.  On the right side the
points are mirrored and the rotations follow the same right-hand rules.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class Arm:
    """Control arm that turns about the axis from its rear to its front pivot."""

    # Pivots on the chassis.
    rear: g.Vector
    front: g.Vector
    angle: g.Angle  # Rotation from the design position.

    def axis(self, tape: Tape) -> g.Vector:
        """Unit axis."""
        between = g.named(tape, self.front - self.rear)
        return g.named(tape, between * (1 / g.length(tape, between)))

    def lever(self, tape: Tape, place: g.Vector) -> g.Vector:
        """From the rear pivot to where a point has moved, given its design position."""
        axis = self.axis(tape)
        design = g.named(tape, place - self.rear)
        return g.rotate_about_axis(tape, design, axis, self.angle)


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

    def carrier_lever(self, tape: Tape, place: g.Vector) -> g.Vector:
        """From the upper ball joint to a point of the carrier, given its design position."""
        design = g.named(tape, place - self.design_ball_joint)
        return g.rotate(tape, self.carrier, design)

    def on_carrier(self, tape: Tape, place: g.Vector) -> g.Vector:
        """Where a point of the carrier has moved, given its design position."""
        return g.named(tape, self.upper_ball_joint + self.carrier_lever(tape, place))

    def on_lower_arm(self, tape: Tape, place: g.Vector) -> g.Vector:
        """Where a point of the lower arm has moved, given its design position."""
        return g.named(tape, self.lower.rear + self.lower.lever(tape, place))

    @property
    def rod_end(self) -> g.Vector:
        """Outer end of the tie rod; not named on a tape."""
        return self.rack_end + self.rod


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
    ball_joint = g.named(tape, upper.rear + upper.lever(tape, ball))
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
