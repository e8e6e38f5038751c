"""Corners of the high-fidelity vehicle: double wishbones in front, trailing arms behind.

Each corner gives its bodies with their loads for any rates of its joint coordinates: where these
are speeds of their own the result is the unconstrained system, where they follow from the lower
arm's by the closures it is the constrained one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp

from vehiclemor.multibody.components import tilted_wheel
from vehiclemor.multibody.components.tires import TireForces
from vehiclemor.multibody.double_wishbone.linkage import Arm, Linkage
from vehiclemor.multibody.high_fidelity.linkage_motions import LinkageMotions
from vehiclemor.multibody.high_fidelity.parts import SIDES, Vehicle
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.joints import STILL, Rate, along, carried
from vehiclemor.symbolic.mechanics import Body, Motion, Rotor, Tensor
from vehiclemor.symbolic.tape import Tape

Parameters = Mapping[str, sp.Expr]
# Of the corners in order.
ENDS = ("front", "front", "rear", "rear")


class _WheelCarrier(NamedTuple):
    """A carrier or arm together with its wheel."""

    # Of both, in their present position.
    mass: sp.Expr
    tensor: Tensor
    # A point of the body, its motion and the body's rotation relative to the chassis.
    base: Vector
    motion: Motion
    turn: Motion
    # From the point to the centre of mass of both and to the wheel centre.
    to_centre: Vector
    to_wheel: Vector
    axle: Vector  # Spin axis of the wheel.


@dataclass(frozen=True)
class Corner:
    """Bodies of a corner with what acts on them."""

    bodies: tuple[Body, ...]
    # Generalised force of the spring-damper on the arm that carries it in N m.
    spring_moment: sp.Expr
    # Wheel on the road.
    contact: tilted_wheel.TiltedContact
    tire: TireForces


def front_corner(
    tape: Tape, v: Vehicle, k: int, linkage: Linkage, motions: LinkageMotions
) -> Corner:
    """Arms, wheel carrier with its wheel, and tie rod of the left (k = 0) or right (1) corner."""
    frame, points, p = v.frame, v.points[k], v.p

    def arm(name: str, turn: Motion) -> Body:
        part = linkage.upper if name == "upper" else linkage.lower
        lever = part.lever(tape, points[f"{name}_arm_centre"])
        centre_now = g.named(tape, part.rear + lever)
        design = _arm_tensor(tape, v, k, part, name)
        tensor = m.turned_tensor(tape, design, part.axis(tape), part.angle)
        centre = frame.point(tape, centre_now, carried(tape, STILL, turn, lever))
        rotation = m.with_inertia(tape, tensor, frame.turning(tape, turn))
        return Body(p[f"{name}_arm_mass"], centre, m.ZERO, rotation, tensor)

    along_rod, transverse = p["tie_rod_axial_inertia"], p["tie_rod_transverse_inertia"]
    tensor = m.axisymmetric_inertia(along_rod, transverse, g.named(tape, linkage.rod_direction))
    half = g.named(tape, linkage.rod * sp.Rational(1, 2))
    rod = Body(
        p["tie_rod_mass"],
        frame.point(
            tape,
            g.named(tape, linkage.rack_end + half),
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
    wheeled = _WheelCarrier(
        mass,
        m.rotated_tensor(tape, tensor, linkage.carrier),
        linkage.upper_ball_joint,
        motions.ball_joint,
        motions.carrier,
        linkage.carrier_lever(tape, centre),
        linkage.carrier_lever(tape, points["wheel_centre"]),
        g.column(linkage.carrier, 1),
    )
    carrier, contact, tire = _wheeled_body(tape, v, k, wheeled)
    lever = linkage.lower.lever(tape, points["front_spring_arm_point"])
    moment = _spring(
        tape,
        linkage.lower.rear + lever - points["front_spring_chassis_point"],
        carried(tape, STILL, motions.lower, lever),
        v,
        k,
    )
    bodies = (arm("upper", motions.upper), arm("lower", motions.lower), carrier, rod)
    return Corner(bodies, moment, contact, tire)


def rear_corner(tape: Tape, v: Vehicle, k: int, rates: Sequence[Rate]) -> Corner:
    """Trailing arm with its wheel, left (k = 2) or right (3); it turns about the lateral axis."""
    points, side, p, number = v.points[k], SIDES[k], v.p, v.numbers.arms[k]
    pivot, axis, angle = points["rear_arm_pivot"], m.UNIT[1], v.q[number]
    turn = along(rates[number], axis)

    def lever(name: str) -> Vector:
        design = g.named(tape, points[name] - pivot)
        return g.rotate_about_axis(tape, design, axis, angle)

    xy, xz, yz = (p[f"rear_arm_inertia_products_{a}"] for a in "xyz")
    xx, yy, zz = (p[f"rear_arm_inertia_{a}"] for a in "xyz")
    arm_tensor = (
        Vector(xx, side * xy, xz),
        Vector(side * xy, yy, side * yz),
        Vector(xz, side * yz, zz),
    )
    mass, centre, tensor = _with_wheel(
        tape,
        p["rear_arm_mass"],
        points["rear_arm_centre"],
        arm_tensor,
        points["rear_wheel_centre"],
        p,
        "rear",
    )
    to_centre = g.rotate_about_axis(tape, g.named(tape, centre - pivot), axis, angle)
    wheeled = _WheelCarrier(
        mass,
        m.turned_tensor(tape, tensor, axis, angle),
        pivot,
        STILL,
        turn,
        to_centre,
        lever("rear_wheel_centre"),
        axis,
    )
    arm, contact, tire = _wheeled_body(tape, v, k, wheeled)
    to_spring = lever("rear_spring_arm_point")
    moment = _spring(
        tape,
        pivot + to_spring - points["rear_spring_chassis_point"],
        carried(tape, STILL, turn, to_spring),
        v,
        k,
    )
    return Corner((arm,), moment, contact, tire)


def _wheeled_body(
    tape: Tape, v: Vehicle, k: int, part: _WheelCarrier
) -> tuple[Body, tilted_wheel.TiltedContact, TireForces]:
    """A carrier or arm together with its wheel, and the wheel on the road."""
    frame, axle, spin = v.frame, part.axle, v.numbers.spins[k]
    levers = (part.to_centre, part.to_wheel)
    places = [g.named(tape, part.base + lever) for lever in levers]
    centre, wheel = (
        frame.point(tape, point, carried(tape, part.motion, part.turn, lever))
        for point, lever in zip(places, levers, strict=True)
    )
    turning = frame.turning(tape, part.turn)
    height = tape.let(v.q[2] + tape.let(v.up @ places[1]))
    contact = tilted_wheel.tilted_contact(
        tape, v.up, height, axle, wheel.value, turning.value, v.rates[spin], v.p
    )
    tire = tilted_wheel.tire_on(tape, contact, v.p)
    force, moment = contact.loads(tape, tire)
    arm = g.named(tape, places[1] - places[0])
    inertia = v.p[f"{ENDS[k]}_wheel_spin_inertia"]
    rotor = Rotor(spin, v.rates[spin], axle, inertia, tape.let(moment @ axle))
    body = Body(
        part.mass,
        centre,
        force,
        m.with_inertia(tape, part.tensor, turning),
        part.tensor,
        g.named(tape, moment + arm.cross(force)),
        rotor,
        turning.bias,
    )
    return body, contact, tire


def _spring(tape: Tape, gap: Vector, motion: Motion, v: Vehicle, k: int) -> sp.Expr:
    """Generalised force of a spring-damper from the chassis to a moving point of an arm.

    The gap leads from the chassis to the arm, the motion is of the end on the arm.
    """
    p, end = v.p, ENDS[k]
    gap = g.named(tape, gap)
    length = g.length(tape, gap)
    direction = g.named(tape, gap * tape.let(1 / length))
    rate = tape.let(direction @ motion.value)
    compression = tape.let(p[f"{end}_free_length"] - length)
    force = tape.let(p[f"{end}_stiffness"] * compression - p[f"{end}_damping"] * rate)
    return tape.let(force * tape.let(direction @ motion.columns[v.numbers.arms[k]]))


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
    weighted = centre * mass + wheel_centre * wheel
    both = g.named(tape, weighted * (1 / total))
    transverse, spin = p[f"{end}_wheel_transverse_inertia"], p[f"{end}_wheel_spin_inertia"]
    parts = (
        tensor,
        m.axisymmetric_inertia(spin, transverse, m.UNIT[1]),
        m.point_mass_tensor(mass, g.named(tape, centre - both)),
        m.point_mass_tensor(wheel, g.named(tape, wheel_centre - both)),
    )
    rows = [
        g.named(tape, [sp.Add(*[part[i][j] for part in parts]) for j in range(3)]) for i in range(3)
    ]
    return total, both, (rows[0], rows[1], rows[2])


def diagonal(p: Parameters, name: str) -> Tensor:
    """Tensor of the principal moments of inertia that a parameter holds."""
    x, y, z = (p[f"{name}_{axis}"] for axis in "xyz")
    return g.vector((x, 0, 0)), g.vector((0, y, 0)), g.vector((0, 0, z))


def _arm_tensor(tape: Tape, v: Vehicle, k: int, arm: Arm, name: str) -> Tensor:
    """Tensor of a control arm at the design position, from that in its own axes."""
    axis = arm.axis(tape)
    lever = g.named(tape, v.points[k][f"{name}_ball_joint"] - arm.rear)
    # Upwards on both sides; the second axis then is the third times the first.
    normal = g.named(tape, axis.cross(lever) * sp.Integer(SIDES[k]))
    up = g.named(tape, normal * (1 / g.length(tape, normal)))
    out = g.named(tape, up.cross(axis))
    frame = tuple(g.vector([axis[i], out[i], up[i]]) for i in range(3))
    return m.rotated_tensor(
        tape, diagonal(v.p, f"{name}_arm_inertia"), (frame[0], frame[1], frame[2])
    )
