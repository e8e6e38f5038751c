"""Corners of the high-fidelity vehicle: double wishbones in front, trailing arms behind.

Each corner gives its bodies with their loads for any rates of its joint coordinates: where these
are speeds of their own the result is the unconstrained system, where they follow from the lower
arm's by the closures it is the constrained one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.models.components import tilted_wheel
from vehiclemor.models.components.tires import TireForces
from vehiclemor.models.double_wishbone.linkage import Arm, Linkage
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.joints import STILL, Rate, along, carried, successive
from vehiclemor.symbolic.mechanics import Body, Motion, MovingFrame, Rotor, Tensor
from vehiclemor.symbolic.tape import Tape

Parameters = Mapping[str, sp.Expr]
Points = Mapping[str, Vector]


@dataclass(frozen=True)
class Chassis:
    """Moving frame of the chassis on the road.

    Attributes
    ----------
    frame
        Its origin is the chassis' centre of mass.
    up
        Road normal, chassis components.
    height
        Height of the origin above the road.
    """

    frame: MovingFrame
    up: Vector
    height: sp.Expr


@dataclass(frozen=True)
class Spin:
    """Spin of a wheel: number of the speed and the speed."""

    number: int
    speed: sp.Expr


@dataclass(frozen=True)
class Corner:
    """Bodies of a corner with what acts on them.

    Attributes
    ----------
    spring_moment
        Generalised force of the spring-damper on the arm that carries it in N m.
    contact, tire
        Wheel on the road.
    """

    bodies: tuple[Body, ...]
    spring_moment: sp.Expr
    contact: tilted_wheel.TiltedContact
    tire: TireForces


@dataclass(frozen=True)
class LinkageMotions:
    """Motions of a double-wishbone corner's bodies relative to the chassis.

    Attributes
    ----------
    upper, lower, carrier, rod
        Rotations of control arms, wheel carrier and tie rod.
    ball_joint, rack_end
        Motions of the upper ball joint and of the tie rod's inner end.
    """

    upper: Motion
    lower: Motion
    carrier: Motion
    rod: Motion
    ball_joint: Motion
    rack_end: Motion


def linkage_motions(
    tape: Tape,
    linkage: Linkage,
    q: Sequence[sp.Symbol],
    rates: Sequence[Rate],
    rack: tuple[sp.Expr, sp.Expr],
) -> LinkageMotions:
    """Relative motions for rates of the seven joint coordinates q.

    Parameters
    ----------
    rack
        Velocity and acceleration of the rack.
    """
    zeta, alpha = q[0], q[5]
    turned_y = g.vector((-tape.let(sp.sin(zeta)), tape.let(sp.cos(zeta)), 0))
    turned_x = g.vector((tape.let(sp.cos(alpha)), tape.let(sp.sin(alpha)), 0))
    first_column = (linkage.carrier[0][0], linkage.carrier[1][0], linkage.carrier[2][0])
    upper = along(rates[3], linkage.upper.axis(tape))
    lever = linkage.upper.lever(tape, linkage.design_ball_joint)
    return LinkageMotions(
        upper,
        along(rates[4], linkage.lower.axis(tape)),
        successive(tape, rates[:3], (m.UNIT[2], turned_y, first_column)),
        successive(tape, rates[5:7], (m.UNIT[2], turned_x)),
        carried(tape, STILL, upper, lever),
        Motion(g.vector((0, rack[0], 0)), {}, g.vector((0, rack[1], 0))),
    )


def closures(
    tape: Tape, linkage: Linkage, motions: LinkageMotions, points: Points
) -> tuple[list[sp.Expr], list[Motion]]:
    """Closures of a corner (6) and their motions: lower ball joint, then outer tie-rod joint."""
    ball, outer = points["lower_ball_joint"], points["tie_rod_outer"]
    gaps = [
        *g.subtract(linkage.on_carrier(tape, ball), linkage.on_lower_arm(tape, ball)),
        *g.subtract(linkage.on_carrier(tape, outer), g.named(tape, linkage.rod_end)),
    ]

    def on_carrier(place: Vector) -> Motion:
        lever = linkage.carrier_lever(tape, place)
        return carried(tape, motions.ball_joint, motions.carrier, lever)

    rod = g.named(tape, linkage.rod)
    pairs = (
        (on_carrier(ball), carried(tape, STILL, motions.lower, linkage.lower.lever(tape, ball))),
        (on_carrier(outer), carried(tape, motions.rack_end, motions.rod, rod)),
    )
    return [tape.let(gap) for gap in gaps], [_difference(tape, a, b) for a, b in pairs]


def _difference(tape: Tape, a: Motion, b: Motion) -> Motion:
    columns = dict(a.columns)
    for k, column in b.columns.items():
        columns[k] = g.subtract(columns.get(k, m.ZERO), column)
    return Motion(
        g.named(tape, g.subtract(a.value, b.value)),
        {k: g.named(tape, column) for k, column in columns.items()},
        g.named(tape, g.subtract(a.bias, b.bias)),
    )


def front_corner(
    tape: Tape,
    chassis: Chassis,
    linkage: Linkage,
    motions: LinkageMotions,
    points: Points,
    spin: Spin,
    p: Parameters,
    lower_arm: int,
    side: int,
) -> Corner:
    """Arms, wheel carrier with its wheel, and tie rod of a front corner.

    Parameters
    ----------
    points
        `double_wishbone_linkage.POINTS`, centres of mass and ends of the spring, of this side.
    lower_arm
        Number of the lower arm's speed.
    """
    frame = chassis.frame

    def arm(name: str, turn: Motion) -> Body:
        part = linkage.upper if name == "upper" else linkage.lower
        lever = part.lever(tape, points[f"{name}_arm_centre"])
        place = g.named(tape, g.add(part.rear, lever))
        tensor = m.turned_tensor(
            tape, _arm_tensor(tape, part, points, name, p, side), part.axis(tape), part.angle
        )
        centre = frame.point(tape, place, carried(tape, STILL, turn, lever))
        rotation = m.with_inertia(tape, tensor, frame.turning(tape, turn))
        return Body(p[f"{name}_arm_mass"], centre, m.ZERO, rotation, tensor)

    along_rod, transverse = p["tie_rod_axial_inertia"], p["tie_rod_transverse_inertia"]
    tensor = m.axisymmetric_inertia(along_rod, transverse, g.named(tape, linkage.rod_direction))
    half = g.named(tape, g.scale(sp.Rational(1, 2), linkage.rod))
    rod = Body(
        p["tie_rod_mass"],
        frame.point(
            tape,
            g.named(tape, g.add(linkage.rack_end, half)),
            carried(tape, motions.rack_end, motions.rod, half),
        ),
        m.ZERO,
        m.with_inertia(tape, tensor, frame.turning(tape, motions.rod)),
        tensor,
    )
    mass, centre, tensor = _with_wheel(
        tape,
        p["carrier_mass"],
        points["carrier_centre"],
        diagonal(p, "carrier_inertia"),
        points["wheel_centre"],
        p,
        "front",
    )
    axle = (linkage.carrier[0][1], linkage.carrier[1][1], linkage.carrier[2][1])
    carrier, contact, tire = _wheeled_body(
        tape,
        chassis,
        (mass, m.rotated_tensor(tape, tensor, linkage.carrier)),
        (linkage.upper_ball_joint, motions.ball_joint, motions.carrier),
        (linkage.carrier_lever(tape, centre), linkage.carrier_lever(tape, points["wheel_centre"])),
        axle,
        spin,
        p,
        "front",
    )
    lever = linkage.lower.lever(tape, points["front_spring_arm_point"])
    moment = _spring(
        tape,
        g.subtract(g.add(linkage.lower.rear, lever), points["front_spring_chassis_point"]),
        carried(tape, STILL, motions.lower, lever),
        lower_arm,
        p,
        "front",
    )
    bodies = (arm("upper", motions.upper), arm("lower", motions.lower), carrier, rod)
    return Corner(bodies, moment, contact, tire)


def rear_corner(
    tape: Tape,
    chassis: Chassis,
    angle: sp.Symbol,
    rate: Rate,
    points: Points,
    spin: Spin,
    p: Parameters,
    number: int,
    side: int,
) -> Corner:
    """Trailing arm with its wheel; it turns about the chassis' lateral axis.

    Parameters
    ----------
    points
        `rear_arm_pivot`, `rear_arm_centre`, `rear_wheel_centre` and ends of the spring, this side.
    number
        Number of the arm's speed.
    """
    pivot, axis = points["rear_arm_pivot"], m.UNIT[1]
    turn = along(rate, axis)

    def lever(name: str) -> Vector:
        design = g.named(tape, g.subtract(points[name], pivot))
        return g.rotate_about_axis(tape, design, axis, angle)

    xy, xz, yz = (p[f"rear_arm_inertia_products_{a}"] for a in "xyz")
    xx, yy, zz = (p[f"rear_arm_inertia_{a}"] for a in "xyz")
    arm_tensor = ((xx, side * xy, xz), (side * xy, yy, side * yz), (xz, side * yz, zz))
    mass, centre, tensor = _with_wheel(
        tape,
        p["rear_arm_mass"],
        points["rear_arm_centre"],
        arm_tensor,
        points["rear_wheel_centre"],
        p,
        "rear",
    )
    to_centre = g.rotate_about_axis(tape, g.named(tape, g.subtract(centre, pivot)), axis, angle)
    arm, contact, tire = _wheeled_body(
        tape,
        chassis,
        (mass, m.turned_tensor(tape, tensor, axis, angle)),
        (pivot, STILL, turn),
        (to_centre, lever("rear_wheel_centre")),
        axis,
        spin,
        p,
        "rear",
    )
    to_spring = lever("rear_spring_arm_point")
    moment = _spring(
        tape,
        g.subtract(g.add(pivot, to_spring), points["rear_spring_chassis_point"]),
        carried(tape, STILL, turn, to_spring),
        number,
        p,
        "rear",
    )
    return Corner((arm,), moment, contact, tire)


def _wheeled_body(
    tape: Tape,
    chassis: Chassis,
    body: tuple[sp.Expr, Tensor],
    reference: tuple[Vector, Motion, Motion],
    levers: tuple[Vector, Vector],
    axle: Vector,
    spin: Spin,
    p: Parameters,
    end: str,
) -> tuple[Body, tilted_wheel.TiltedContact, TireForces]:
    """A carrier or arm together with its wheel, and the wheel on the road.

    Parameters
    ----------
    body
        Mass and tensor of both.
    reference
        A point of the body, its motion and the body's rotation relative to the chassis.
    levers
        From the point to the centre of mass of both and to the wheel centre.
    """
    frame = chassis.frame
    base, motion, turn = reference
    places = [g.named(tape, g.add(base, lever)) for lever in levers]
    centre, wheel = (
        frame.point(tape, place, carried(tape, motion, turn, lever))
        for place, lever in zip(places, levers, strict=True)
    )
    turning = frame.turning(tape, turn)
    height = tape.let(chassis.height + tape.let(g.dot(chassis.up, places[1])))
    contact = tilted_wheel.tilted_contact(
        tape, chassis.up, height, axle, wheel.value, turning.value, spin.speed, p
    )
    tire = tilted_wheel.tire_on(tape, contact, p)
    force, moment = contact.loads(tape, tire)
    arm = g.named(tape, g.subtract(places[1], places[0]))
    rotor = Rotor(
        spin.number,
        spin.speed,
        axle,
        p[f"{end}_wheel_spin_inertia"],
        tape.let(g.dot(moment, axle)),
    )
    return (
        Body(
            body[0],
            centre,
            force,
            m.with_inertia(tape, body[1], turning),
            body[1],
            g.named(tape, g.add(moment, g.cross(arm, force))),
            rotor,
            turning.bias,
        ),
        contact,
        tire,
    )


def _spring(
    tape: Tape, gap: Vector, motion: Motion, number: int, p: Parameters, end: str
) -> sp.Expr:
    """Generalised force of a spring-damper that ends on a moving point of an arm.

    Parameters
    ----------
    gap
        From the end on the chassis to the end on the arm.
    motion
        Of the end on the arm, relative to the chassis.
    number
        Number of the arm's speed.
    """
    gap = g.named(tape, gap)
    length = g.length(tape, gap)
    direction = g.named(tape, g.scale(tape.let(1 / length), gap))
    rate = tape.let(g.dot(direction, motion.value))
    compression = tape.let(p[f"{end}_free_length"] - length)
    force = tape.let(p[f"{end}_stiffness"] * compression - p[f"{end}_damping"] * rate)
    return tape.let(force * tape.let(g.dot(direction, motion.columns[number])))


def _with_wheel(
    tape: Tape,
    mass: sp.Expr,
    centre: Vector,
    tensor: Tensor,
    wheel_centre: Vector,
    p: Parameters,
    end: str,
) -> tuple[sp.Expr, Vector, Tensor]:
    """Mass, centre of mass and tensor of a carrier with its wheel, at the design position."""
    wheel = p[f"{end}_wheel_mass"]
    total = tape.let(mass + wheel)
    weighted = g.add(g.scale(mass, centre), g.scale(wheel, wheel_centre))
    both = g.named(tape, g.scale(1 / total, weighted))
    transverse, spin = p[f"{end}_wheel_transverse_inertia"], p[f"{end}_wheel_spin_inertia"]
    parts = (
        tensor,
        m.axisymmetric_inertia(spin, transverse, m.UNIT[1]),
        m.point_mass_tensor(mass, g.named(tape, g.subtract(centre, both))),
        m.point_mass_tensor(wheel, g.named(tape, g.subtract(wheel_centre, both))),
    )
    rows = [
        g.named(tape, [sp.Add(*[part[i][j] for part in parts]) for j in range(3)]) for i in range(3)
    ]
    return total, both, (rows[0], rows[1], rows[2])


def diagonal(p: Parameters, name: str) -> Tensor:
    """Tensor of the principal moments of inertia that a parameter holds."""
    x, y, z = (p[f"{name}_{axis}"] for axis in "xyz")
    return g.vector((x, 0, 0)), g.vector((0, y, 0)), g.vector((0, 0, z))


def _arm_tensor(
    tape: Tape, arm: Arm, points: Points, name: str, p: Parameters, side: int
) -> Tensor:
    """Tensor of a control arm at the design position, from that in its own axes."""
    axis = arm.axis(tape)
    lever = g.named(tape, g.subtract(points[f"{name}_ball_joint"], arm.rear))
    # Upwards on both sides; the second axis then is the third times the first.
    normal = g.named(tape, g.scale(sp.Integer(side), g.cross(axis, lever)))
    up = g.named(tape, g.scale(1 / g.length(tape, normal), normal))
    out = g.named(tape, g.cross(up, axis))
    frame = tuple(g.vector([axis[i], out[i], up[i]]) for i in range(3))
    return m.rotated_tensor(
        tape, diagonal(p, f"{name}_arm_inertia"), (frame[0], frame[1], frame[2])
    )
