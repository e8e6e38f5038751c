"""The high-fidelity vehicle and its corners: double wishbones in front, trailing arms behind.

Each corner gives its bodies with their loads for any rates of its joint coordinates: where these
are speeds of their own the result is the unconstrained system, where they follow from the lower
arm's by the closures it is the constrained one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.components import linkage as links
from vehiclemor.multibody.components.tires import Corner, WheelMotion, WheelOnRoad, tilted_wheel
from vehiclemor.multibody.double_wishbone.definition import POINTS
from vehiclemor.multibody.high_fidelity.definition import ARMS, CORNER, DECLARED, SOLVED, SPINS
from vehiclemor.multibody.quantities import WHEELS, InputChoice
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import STILL, Body, Motion, Rate, Rotor, Tensor, along, carried
from vehiclemor.symbolic.tape import Tape

Parameters = Mapping[str, sp.Expr]
# Of the corners in order: FL, FR, RL, RR; 1 on the left, -1 on the right.
ENDS = ("front", "front", "rear", "rear")
SIDES = (1, -1, 1, -1)
# Inputs with which tires slip in both directions: the paper's runs coast, and keep its Fiala tires.
COMBINED_SLIP = ("drive_torque_", "brake_torque_", "friction_")
FRONT_POINTS = (
    *POINTS,
    *("front_spring_chassis_point", "front_spring_arm_point"),
    *("upper_arm_centre", "lower_arm_centre", "carrier_centre"),
)
REAR_POINTS = (
    *("rear_arm_pivot", "rear_arm_centre", "rear_spring_chassis_point", "rear_spring_arm_point"),
)


@dataclass(frozen=True)
class Vehicle:
    """The chassis, the design points, and the front linkages in any position."""

    attitude: body.Attitude
    # Moving frame of the chassis, its origin the centre of mass; its first three speeds are
    # velocities in space, and gravity is counted as an acceleration upwards.
    frame: m.MovingFrame
    points: tuple[dict[str, Vector], ...]  # Design points of the four corners, chassis frame.
    linkages: tuple[links.Linkage, ...]
    # Coordinates and their rates.
    q: Sequence[sp.Symbol]
    rates: Sequence[sp.Symbol]
    inputs: body.Inputs
    p: Parameters
    combined: bool  # Whether tires have the forces of `brush`, else those of `fiala`.

    @property
    def rack(self) -> list[sp.Symbol]:
        """Displacement, velocity and acceleration of the rack."""
        return self.inputs.driven[:3]

    @property
    def speeds(self) -> list[sp.Expr]:
        """The six speeds of the chassis."""
        return [*self.frame.velocity, *self.frame.angular_velocity]

    def motions(self, tape: Tape, rates: Sequence[Rate], k: int) -> links.LinkageMotions:
        """Motions of the front left (0) or right (1) corner for rates of all coordinates."""
        q = [self.q[j] for j in CORNER[k]]
        corner_rates = [rates[j] for j in CORNER[k]]
        return links.linkage_motions(tape, self.linkages[k], q, corner_rates, self.rack[1:])


def vehicle(tape: Tape, choice: InputChoice) -> tuple[Vehicle, list[sp.Symbol]]:
    """The vehicle, and the symbols of its parameters in order."""
    q, rates = (body.symbols(DECLARED[k]) for k in ("coordinates", "speeds"))
    inputs = body.inputs(DECLARED["inputs"], choice)
    declared, solved = body.parameters(DECLARED["parameters"]), body.parameters({}, SOLVED)
    p = declared | solved
    combined = any(name.startswith(COMBINED_SLIP) for name in (*choice.driven, *choice.constant))
    attitude = body.attitude(tape, q)
    speeds = body.speeds(tape, attitude, rates)
    frame = m.MovingFrame(
        g.vector(speeds[:3]),
        g.vector(speeds[3:6]),
        acceleration=g.named(tape, attitude.road_normal * p["gravity"]),
    )
    points = _design_points(tape, p)
    linkages = []
    for k in range(2):
        angles = [q[j] for j in CORNER[k]]
        linkages.append(links.assembled(tape, angles, inputs.driven[0], points[k], SIDES[k]))
    vehicle = Vehicle(attitude, frame, points, tuple(linkages), q, rates, inputs, p, combined)
    return vehicle, [*declared.values(), *inputs.constant, *solved.values()]


def _design_points(tape: Tape, p: Parameters) -> tuple[dict[str, Vector], ...]:
    """Design points of the four corners, chassis frame."""

    def vector(name: str) -> Vector:
        return g.vector([p[f"{name}_{axis}"] for axis in "xyz"])

    origin = vector("chassis_centre")
    front = g.named(tape, vector("front_frame_origin") - origin)
    rear = g.named(tape, vector("rear_wheel_centre") - origin)
    left = {name: g.named(tape, vector(name) + front) for name in FRONT_POINTS}
    behind = {name: g.named(tape, vector(name) + rear) for name in REAR_POINTS}
    behind["rear_wheel_centre"] = rear

    def mirrored(points: dict[str, Vector]) -> dict[str, Vector]:
        return {name: Vector(x, -y, z) for name, (x, y, z) in points.items()}

    return left, mirrored(left), behind, mirrored(behind)


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


def front_corner(tape: Tape, v: Vehicle, k: int, motions: links.LinkageMotions) -> Corner:
    """Arms, wheel carrier with its wheel, and tie rod of the left (k = 0) or right (1) corner."""
    frame, points, p, linkage = v.frame, v.points[k], v.p, v.linkages[k]

    def part(name: str, centre: Vector, moving: Motion, turn: Motion, tensor: Tensor) -> Body:
        motion = frame.point(tape, centre, moving)
        rotation = m.with_inertia(tape, tensor, frame.angular_velocity_of(tape, turn))
        return Body(p[f"{name}_mass"], motion, m.ZERO, rotation, tensor)

    def arm(name: str, arm: links.Arm, turn: Motion) -> Body:
        lever = arm.lever(tape, points[f"{name}_arm_centre"])
        centre = g.named(tape, arm.rear + lever)
        design = _arm_tensor(tape, v, k, arm, name)
        tensor = m.turned_tensor(tape, design, arm.axis(tape), arm.angle)
        return part(f"{name}_arm", centre, carried(tape, STILL, turn, lever), turn, tensor)

    along_rod, transverse = p["tie_rod_axial_inertia"], p["tie_rod_transverse_inertia"]
    tensor = m.axisymmetric_inertia(along_rod, transverse, g.named(tape, linkage.rod_direction))
    half = g.named(tape, linkage.rod * sp.Rational(1, 2))
    centre = g.named(tape, linkage.rack_end + half)
    moving = carried(tape, motions.rack_end, motions.rod, half)
    rod = part("tie_rod", centre, moving, motions.rod, tensor)
    mass, centre, tensor = _with_wheel(tape, v, k, "carrier", diagonal(p, "carrier_inertia"))
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
    carrier, wheel, shaft = _wheeled_body(tape, v, k, wheeled)
    lever = linkage.lower.lever(tape, points["front_spring_arm_point"])
    moment = _spring(tape, v, k, linkage.lower.rear, lever, motions.lower)
    upper = arm("upper", linkage.upper, motions.upper)
    lower = arm("lower", linkage.lower, motions.lower)
    return Corner((upper, lower, carrier, rod), moment, wheel, shaft)


def rear_corner(tape: Tape, v: Vehicle, k: int, rates: Sequence[Rate]) -> Corner:
    """Trailing arm with its wheel, left (k = 2) or right (3); it turns about the lateral axis."""
    points, side, p, number = v.points[k], SIDES[k], v.p, ARMS[k]
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
    mass, centre, tensor = _with_wheel(tape, v, k, "rear_arm", arm_tensor)
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
    arm, wheel, shaft = _wheeled_body(tape, v, k, wheeled)
    moment = _spring(tape, v, k, pivot, lever("rear_spring_arm_point"), turn)
    return Corner((arm,), moment, wheel, shaft)


def _wheeled_body(
    tape: Tape, v: Vehicle, k: int, part: _WheelCarrier
) -> tuple[Body, WheelOnRoad, Vector]:
    """A carrier or arm with its wheel, the wheel on the road, torque of the half shaft on it."""
    frame, axle, spin = v.frame, part.axle, v.rates[SPINS[k]]
    inputs = v.inputs.at(WHEELS[k])
    levers = (part.to_centre, part.to_wheel)
    positions = [g.named(tape, part.base + lever) for lever in levers]
    centre, wheel = (
        frame.point(tape, point, carried(tape, part.motion, part.turn, lever))
        for point, lever in zip(positions, levers, strict=True)
    )
    turning = frame.angular_velocity_of(tape, part.turn)
    height = tape.let(v.q[2] + tape.let(v.attitude.road_normal @ positions[1]))
    motion = WheelMotion(height, axle, wheel.value, turning.value)
    on_road = tilted_wheel(tape, v.attitude.road_normal, motion, spin, v.p, inputs, v.combined)
    force, moment = on_road.force, on_road.moment
    arm = g.named(tape, positions[1] - positions[0])
    inertia = v.p[f"{ENDS[k]}_wheel_spin_inertia"]
    about_axle = tape.let(tape.let(moment @ axle) + inputs.torque(tape, spin))
    rotor = Rotor(SPINS[k], spin, axle, inertia, about_axle, turning.bias)
    # The caliper of a brake sits on the carrier: its torque is an inner one, a half shaft's is not.
    shaft = g.named(tape, axle * inputs.drive)
    body = Body(
        part.mass,
        centre,
        force,
        m.with_inertia(tape, part.tensor, turning),
        part.tensor,
        g.named(tape, moment + arm.cross(force) + shaft),
        rotor,
    )
    return body, on_road, shaft


def _spring(tape: Tape, v: Vehicle, k: int, pivot: Vector, lever: Vector, turn: Motion) -> sp.Expr:
    """Generalised force of a spring-damper from the chassis to an arm on a pivot, at a lever."""
    p, end = v.p, ENDS[k]
    motion = carried(tape, STILL, turn, lever)
    gap = g.named(tape, pivot + lever - v.points[k][f"{end}_spring_chassis_point"])
    length = g.length(tape, gap)
    direction = g.named(tape, gap * tape.let(1 / length))
    rate = tape.let(direction @ motion.value)
    compression = tape.let(p[f"{end}_free_length"] - length)
    force = tape.let(p[f"{end}_stiffness"] * compression - p[f"{end}_damping"] * rate)
    return tape.let(force * tape.let(direction @ motion.columns[ARMS[k]]))


def _with_wheel(
    tape: Tape, v: Vehicle, k: int, name: str, tensor: Tensor
) -> tuple[sp.Expr, Vector, Tensor]:
    """Mass, centre of mass and tensor of a carrier with its wheel, at the design position."""
    p, points, end = v.p, v.points[k], ENDS[k]
    mass, centre, wheel = p[f"{name}_mass"], points[f"{name}_centre"], p[f"{end}_wheel_mass"]
    wheel_centre = points["wheel_centre" if end == "front" else "rear_wheel_centre"]
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

    def row(i: int) -> Vector:
        return g.named(tape, [sp.Add(*[part[i][j] for part in parts]) for j in range(3)])

    return total, both, (row(0), row(1), row(2))


def diagonal(p: Parameters, name: str) -> Tensor:
    """Tensor of the principal moments of inertia that a parameter holds."""
    x, y, z = (p[f"{name}_{axis}"] for axis in "xyz")
    return g.vector((x, 0, 0)), g.vector((0, y, 0)), g.vector((0, 0, z))


def _arm_tensor(tape: Tape, v: Vehicle, k: int, arm: links.Arm, name: str) -> Tensor:
    """Tensor of a control arm at the design position, from that in the arm's axes."""
    axis = arm.axis(tape)
    lever = g.named(tape, v.points[k][f"{name}_ball_joint"] - arm.rear)
    # Upwards on both sides; the second axis then is the third times the first.
    normal = g.named(tape, axis.cross(lever) * sp.Integer(SIDES[k]))
    up = g.named(tape, normal * (1 / g.length(tape, normal)))
    out = g.named(tape, up.cross(axis))
    axes = g.matrix(lambda i, j: (axis, out, up)[j][i])
    return m.rotated_tensor(tape, diagonal(v.p, f"{name}_arm_inertia"), axes)
