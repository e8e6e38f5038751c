"""A double-wishbone corner closed in closed form: all its bodies from the lower arm and the rack.

Two loops are closed one after the other.  The upper ball joint turns about the upper arm's axis and
keeps its distance from the lower one; then the wheel carrier turns about the line through both
until the outer tie-rod joint is as far from the rack's end as the tie rod is long.  Each is an
equation A cos + B sin = C that a square root solves; the branch is that of the design position.
Rates and accelerations follow from the derivatives of the two distances.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.double_wishbone.linkage import Arm, Linkage
from vehiclemor.multibody.high_fidelity.linkage_motions import LinkageMotions, relative
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Rotation, Vector
from vehiclemor.symbolic.joints import STILL, Rate, along, carried, free_rate
from vehiclemor.symbolic.mechanics import Motion
from vehiclemor.symbolic.tape import Tape


@dataclass(frozen=True)
class ClosedCorner:
    """Closed position of a corner.

    Attributes
    ----------
    between
        Unit vector from the upper to the lower ball joint.
    distance
        Between the ball joints in m.
    off
        Unit vector from that line towards the outer tie-rod joint.
    offset
        Distance of the joint from the line in m.
    outer
        From the upper ball joint to the outer tie-rod joint.
    rod
        From the inner to the outer end of the tie rod.
    """

    linkage: Linkage
    between: Vector
    distance: sp.Expr
    off: Vector
    offset: sp.Expr
    outer: Vector
    rod: Vector


@dataclass(frozen=True)
class ClosedMotions:
    """Motions of a closed corner, and the rates of its other joint coordinates.

    Attributes
    ----------
    upper
        Rate of the upper arm's angle.
    outer
        Motion of the tie rod's outer end less that of its inner end.
    """

    bodies: LinkageMotions
    upper: Rate
    outer: Motion


def closed(
    tape: Tape, angle: sp.Symbol, rack: sp.Symbol, points: Mapping[str, Vector], side: int
) -> ClosedCorner:
    """Close a corner.

    Parameters
    ----------
    angle
        Rotation of the lower arm from the design position in rad.
    rack
        Displacement of the rack, positive to the left, in m.
    points
        `double_wishbone.points.POINTS` of this side.
    side
        1 for the left, -1 for the right side.
    """
    let = tape.let
    ball, outer = points["upper_ball_joint"], points["tie_rod_outer"]
    lower = Arm(points["lower_arm_rear_pivot"], points["lower_arm_front_pivot"], angle)
    lever = lower.lever(tape, points["lower_ball_joint"])
    low = g.named(tape, lower.rear + lever)
    upper, distance = _upper_arm(tape, low, points)
    high = g.named(tape, upper.rear + upper.lever(tape, ball))
    inverse = let(1 / distance)
    between = g.named(tape, g.named(tape, low - high) * inverse)

    # The tie-rod joint beside the line through the ball joints, at the design position.
    line = g.named(tape, points["lower_ball_joint"] - ball)
    design_between = g.named(tape, line * inverse)
    arm = g.named(tape, outer - ball)
    part = let(arm @ design_between)
    across = g.named(tape, arm - design_between * part)
    offset = g.length(tape, across)
    design_off = g.named(tape, across * let(1 / offset))
    inner = points["tie_rod_inner"]
    length = g.length(tape, g.named(tape, outer - inner))
    square = let(offset**2 - length**2)

    rack_end = g.named(tape, (inner[0], inner[1] + rack, inner[2]))
    off = _off(
        tape,
        rack_end,
        high,
        between,
        part,
        offset,
        square,
        _sign(tape, design_off @ g.named(tape, design_between.cross(inner - ball))),
    )
    carrier = _carrier(tape, (design_between, design_off), (between, off))
    reach = g.named(tape, between * part + off * offset)
    rod = g.named(tape, high - rack_end + reach)
    direction = g.named(tape, rod * let(side / length))
    linkage = Linkage(upper, lower, high, carrier, ball, rack_end, rod, direction)
    return ClosedCorner(linkage, between, distance, off, offset, reach, rod)


def _upper_arm(tape: Tape, low: Vector, points: Mapping[str, Vector]) -> tuple[Arm, sp.Expr]:
    """The upper arm for a place of the lower ball joint, and the distance of both."""
    let = tape.let
    rear, front = points["upper_arm_rear_pivot"], points["upper_arm_front_pivot"]
    ball, design = points["upper_ball_joint"], points["lower_ball_joint"]
    distance = g.length(tape, g.named(tape, design - ball))
    axis = Arm(rear, front, sp.Integer(0)).axis(tape)
    lever = g.named(tape, ball - rear)
    along_axis = g.named(tape, axis * let(axis @ lever))
    across = g.named(tape, lever - along_axis)
    quarter = g.named(tape, axis.cross(lever))
    centre = g.named(tape, rear + along_axis)
    gap = g.named(tape, low - centre)
    a, b = let(across @ gap), let(quarter @ gap)
    c = let((let((across @ across) - distance**2) + (gap @ gap)) / 2)
    square = let(a**2 + b**2)
    branch = _sign(tape, quarter @ g.named(tape, design - centre))
    root = let(branch * sp.sqrt(let(square - c**2)))
    inverse = let(1 / square)
    cosine, sine = let((a * c + b * root) * inverse), let((b * c - a * root) * inverse)
    return Arm(rear, front, (cosine, sine)), distance


def _off(
    tape: Tape,
    rack_end: Vector,
    high: Vector,
    between: Vector,
    part: sp.Expr,
    offset: sp.Expr,
    square: sp.Expr,
    branch: sp.Expr,
) -> Vector:
    """Unit vector from the line through the ball joints towards the outer tie-rod joint."""
    let = tape.let
    gap = g.named(tape, rack_end - high - between * part)
    height = let(gap @ between)
    across = g.named(tape, gap - between * height)
    wide = let(across @ across)
    c = let(let((let(square) + height**2 + wide) / 2) / offset)
    quarter = g.named(tape, between.cross(across))
    root = let(branch * sp.sqrt(let(wide - c**2)))
    inverse = let(1 / wide)
    first, second = let(c * inverse), let(root * inverse)
    return g.named(tape, across * first + quarter * second)


def _sign(tape: Tape, value: sp.Expr) -> sp.Expr:
    """1 or -1."""
    value = tape.let(value)
    return tape.let(value / tape.let(sp.Abs(value)))


def _carrier(tape: Tape, before: tuple[Vector, Vector], now: tuple[Vector, Vector]) -> Rotation:
    """Rotation that turns one pair of perpendicular unit vectors into another."""
    pairs = [*zip(before, now, strict=True)]
    third = (g.named(tape, before[0].cross(before[1])), g.named(tape, now[0].cross(now[1])))
    pairs.append(third)
    return g.matrix(lambda i, j: tape.let(sp.Add(*[b[i] * a[j] for a, b in pairs])))


def motions(
    tape: Tape,
    corner: ClosedCorner,
    number: int,
    speed: sp.Symbol,
    rack: tuple[sp.Expr, sp.Expr],
    points: Mapping[str, Vector],
) -> ClosedMotions:
    """Motions relative to the chassis.

    Parameters
    ----------
    number, speed
        Of the lower arm: its number among the speeds, and its rate in rad/s.
    rack
        Velocity and acceleration of the rack.
    """
    linkage = corner.linkage
    lower = along(free_rate(number, speed), linkage.lower.axis(tape))
    lever = linkage.lower.lever(tape, points["lower_ball_joint"])
    low = carried(tape, STILL, lower, lever)
    axis = linkage.upper.axis(tape)
    lever = linkage.upper.lever(tape, points["upper_ball_joint"])
    upper = _upper_rate(tape, corner, low, axis, lever, number)
    turning = along(upper, axis)
    high = carried(tape, STILL, turning, lever)
    rack_end = Motion(g.vector((0, rack[0], 0)), {}, g.vector((0, rack[1], 0)))
    carrier = _carrier_motion(tape, corner, low, high, rack_end, number)
    outer = relative(tape, carried(tape, high, carrier, corner.outer), rack_end)
    rod = _universal_joint(tape, corner.rod, outer)
    return ClosedMotions(LinkageMotions(turning, lower, carrier, rod, high, rack_end), upper, outer)


def _upper_rate(
    tape: Tape, corner: ClosedCorner, low: Motion, axis: Vector, lever: Vector, number: int
) -> Rate:
    """Rate of the upper arm that keeps the distance of the ball joints."""
    let, e = tape.let, corner.between
    per_rate = g.named(tape, axis.cross(lever))
    inverse = let(1 / let(e @ per_rate))
    factor = let((e @ low.columns[number]) * inverse)
    rate = let((e @ low.value) * inverse)
    apart = g.named(tape, low.value - per_rate * rate)
    square = let(rate**2)
    inwards = g.named(tape, axis.cross(per_rate)) * square
    bias = g.named(tape, low.bias - inwards)
    closing = let((apart @ apart) * let(1 / corner.distance))
    return Rate(rate, {number: factor}, let(((e @ bias) + closing) * inverse))


def _carrier_motion(
    tape: Tape, corner: ClosedCorner, low: Motion, high: Motion, rack_end: Motion, number: int
) -> Motion:
    """Rotation of the wheel carrier: that of the line through the ball joints, and one about it.

    The second keeps the length of the tie rod.
    """
    let, e, rod, arm = tape.let, corner.between, corner.rod, corner.outer
    per_length = let(1 / corner.distance)
    line = relative(tape, low, high)
    along_rod = let(corner.offset * (rod @ g.named(tape, e.cross(corner.off))))
    inverse = let(-1 / along_rod)

    def swing(change: Vector) -> Vector:
        """Rotation that goes with a change of the line."""
        return g.named(tape, e.cross(change) * per_length)

    def about(turn: Vector, velocity: Vector) -> sp.Expr:
        """Turn about the line that leaves the end of the rod at its distance."""
        moved = g.named(tape, velocity + turn.cross(arm))
        return let((rod @ moved) * inverse)

    column = swing(line.columns[number])
    turn = about(column, high.columns[number])
    column = g.named(tape, column + e * turn)
    value = swing(line.value)
    turn = about(value, high.value - rack_end.value)
    direction_rate = g.named(tape, line.value * per_length)
    value = g.named(tape, value + e * turn)

    bias = g.named(tape, swing(line.bias) + direction_rate * turn)
    swept = g.named(tape, value.cross(arm))
    apart = g.named(tape, high.value - rack_end.value + swept)
    inwards = high.bias - rack_end.bias + value.cross(swept)
    closing = let(apart @ apart)
    turn = let(about(bias, inwards) + closing * inverse)
    return Motion(value, {number: column}, g.named(tape, bias + e * turn))


def _universal_joint(tape: Tape, rod: Vector, end: Motion) -> Motion:
    """Rotation of a rod on a universal joint whose first axis is z, then x, from that of its end.

    The rod lies along the third axis, so that its rotation has a part about itself.

    Parameters
    ----------
    end
        Motion of the outer end less that of the inner one.
    """
    let = tape.let
    x, y, _ = rod
    inverse = let(1 / let(x**2 + y**2))
    still, turned = let(x * inverse), let(y * inverse)

    def rotation(change: Vector) -> Vector:
        x, y, z = change
        return Vector(turned * z, -still * z, still * y - turned * x)

    v = end.value
    value = g.named(tape, rotation(v))
    # Derivatives of the coefficients: of x and y, then of the squared length they are divided by.
    shrink = let(-2 * (still * v.x + turned * v.y))
    moved = g.named(tape, (v.y * v.z * inverse, -v.x * v.z * inverse, sp.Integer(0)))
    bias = rotation(end.bias) + moved + value * shrink
    columns = {k: g.named(tape, rotation(c)) for k, c in end.columns.items()}
    return Motion(value, columns, g.named(tape, bias))
