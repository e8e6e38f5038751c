"""What the forms of the high-fidelity vehicle's equations share: chassis, corners, assembly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.models.components import body
from vehiclemor.models.components.tires import tire_outputs
from vehiclemor.models.double_wishbone import linkage
from vehiclemor.models.double_wishbone.points import POINTS
from vehiclemor.models.high_fidelity import corners
from vehiclemor.models.high_fidelity.linkage_motions import LinkageMotions
from vehiclemor.models.high_fidelity.quantities import PARAMETERS, SOLVED
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.joints import Rate
from vehiclemor.symbolic.tape import Tape

# 1 on the left, -1 on the right: FL, FR, RL, RR.
SIDES = (1, -1, 1, -1)
FRONT_POINTS = (
    *POINTS,
    "front_spring_chassis_point",
    "front_spring_arm_point",
    "upper_arm_centre",
    "lower_arm_centre",
    "carrier_centre",
)
REAR_POINTS = (
    "rear_arm_pivot",
    "rear_arm_centre",
    "rear_spring_chassis_point",
    "rear_spring_arm_point",
)


@dataclass(frozen=True)
class Numbers:
    """Numbers of the speeds; the first six are the chassis'."""

    total: int
    lower_arms: tuple[int, ...]
    rear_arms: tuple[int, ...]
    spins: tuple[int, ...]

    @property
    def order(self) -> tuple[int, ...]:
        """Order of elimination: each but the last six couples to these and to one other."""
        return (*self.spins, *self.lower_arms, *self.rear_arms, *range(6))


@dataclass(frozen=True)
class Vehicle:
    """What all forms of the equations begin with.

    Attributes
    ----------
    chassis
        Moving frame on the road; gravity is counted as an acceleration of it upwards.
    points
        Design points of the four corners, chassis frame.
    q, rates
        Coordinates and their rates.
    p
        Symbols of the parameters.
    """

    chassis: corners.Chassis
    points: tuple[dict[str, g.Vector], ...]
    q: Sequence[sp.Symbol]
    rates: Sequence[sp.Symbol]
    p: Mapping[str, sp.Expr]
    numbers: Numbers


def vehicle(
    tape: Tape,
    q: Sequence[sp.Symbol],
    rates: Sequence[sp.Symbol],
    p: Mapping[str, sp.Expr],
    numbers: Numbers,
) -> tuple[Vehicle, body.Attitude, list[sp.Expr]]:
    """The chassis with the design points; attitude and the six speeds of the chassis."""
    attitude = body.attitude(tape, q)
    speeds = body.speeds(tape, attitude, rates)
    up = attitude.road_normal
    # The first three speeds are velocities in space, and gravity an acceleration upwards.
    frame = mechanics.MovingFrame(
        g.vector(speeds[:3]),
        g.vector(speeds[3:6]),
        first=0,
        acceleration=g.named(tape, g.scale(p["gravity"], up)),
    )
    points = design_points(tape, p)
    chassis = corners.Chassis(frame, up, q[2])
    return Vehicle(chassis, points, q, rates, p, numbers), attitude, speeds


def parameters() -> tuple[dict[str, sp.Expr], list[sp.Symbol]]:
    """Symbols of the parameters by name, components of points apart, and in order."""
    flat = []
    for name, declared in PARAMETERS.items():
        flat += [name] if declared.size == 1 else [f"{name}_{axis}" for axis in "xyz"]
    flat += SOLVED
    symbols = {name: sp.Symbol(f"p_{name}", real=True) for name in flat}
    return dict(symbols), list(symbols.values())


def design_points(tape: Tape, p: Mapping[str, sp.Expr]) -> tuple[dict[str, g.Vector], ...]:
    """Design points of the four corners, chassis frame."""

    def vector(name: str) -> g.Vector:
        return g.vector([p[f"{name}_{axis}"] for axis in "xyz"])

    origin = vector("chassis_centre")
    front = g.named(tape, g.subtract(vector("front_frame_origin"), origin))
    rear = g.named(tape, g.subtract(vector("rear_wheel_centre"), origin))
    left = {name: g.named(tape, g.add(vector(name), front)) for name in FRONT_POINTS}
    behind = {name: g.named(tape, g.add(vector(name), rear)) for name in REAR_POINTS}
    behind["rear_wheel_centre"] = rear

    def mirrored(points: dict[str, g.Vector]) -> dict[str, g.Vector]:
        return {name: (x, -y, z) for name, (x, y, z) in points.items()}

    return left, mirrored(left), behind, mirrored(behind)


def front_corner(
    tape: Tape, v: Vehicle, assembled: linkage.Linkage, motions: LinkageMotions, k: int
) -> corners.Corner:
    """The left (k = 0) or right (1) front corner."""
    place = _place(v, k, v.numbers.lower_arms[k])
    return corners.front_corner(tape, v.chassis, assembled, motions, place, v.p)


def rear_corner(tape: Tape, v: Vehicle, rates: Sequence[Rate], k: int) -> corners.Corner:
    """The left (k = 2) or right (3) rear corner."""
    arm = v.numbers.rear_arms[k - 2]
    return corners.rear_corner(tape, v.chassis, v.q[arm], rates[arm], _place(v, k, arm), v.p)


def _place(v: Vehicle, k: int, arm: int) -> corners.Place:
    spin = v.numbers.spins[k]
    return corners.Place(v.points[k], arm, spin, v.rates[spin], SIDES[k])


def kane(
    tape: Tape, v: Vehicle, parts: Sequence[corners.Corner]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix and forces of all bodies, springs added."""
    frame, p = v.chassis.frame, v.p
    inertia = corners.diagonal(p, "chassis_inertia")
    chassis = mechanics.Body(
        p["chassis_mass"],
        frame.origin(tape),
        mechanics.ZERO,
        frame.rotation(tape, inertia),
        inertia,
    )
    bodies = [chassis, *(part for corner in parts for part in corner.bodies)]
    mass, force = mechanics.kane(tape, v.numbers.total, bodies)
    arms = (*v.numbers.lower_arms, *v.numbers.rear_arms)
    for number, corner in zip(arms, parts, strict=True):
        force[number] = tape.let(force[number] + corner.spring_moment)
    return mass, force


def solved(tape: Tape, v: Vehicle, parts: Sequence[corners.Corner]) -> dict[int, sp.Expr]:
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
    tape: Tape,
    attitude: body.Attitude,
    solved: Mapping[int, sp.Expr],
    speeds: Sequence[sp.Expr],
) -> list[sp.Expr]:
    """Second derivatives of position, yaw, pitch and roll."""
    turning = g.vector(speeds[3:6])
    position = g.rotate(tape, attitude.rotation, g.vector([solved[k] for k in range(3)]))
    bias = body.angle_bias(tape, attitude, turning)
    change = g.named(tape, g.subtract(g.vector([solved[k] for k in range(3, 6)]), bias))
    return [*position, *body.angle_rates(tape, attitude, change)]


def outputs(
    tape: Tape,
    v: Vehicle,
    parts: Sequence[corners.Corner],
    speeds: Sequence[sp.Expr],
    carriers: Sequence[g.Rotation],
) -> list[sp.Expr]:
    """The model's outputs but for the last two, which measure the constraints.

    Parameters
    ----------
    carriers
        Orientations of the front wheel carriers.
    """
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
