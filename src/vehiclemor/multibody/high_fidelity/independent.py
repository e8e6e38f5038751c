"""The high-fidelity vehicle in 14 independent coordinates: an ODE without constraints.

Its front corners close in closed form (`closed_corner.py`), so that these equations are the exact
ones of `equations.py` on the manifold where all constraints hold.
"""

from collections.abc import Mapping, Sequence

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.high_fidelity import assembly, closed_corner, parts
from vehiclemor.multibody.high_fidelity.closed_corner import ClosedCorner, ClosedMotions
from vehiclemor.multibody.high_fidelity.corners import front_corner, rear_corner
from vehiclemor.multibody.high_fidelity.quantities import (
    COORDINATES,
    INDEPENDENT_COORDINATES,
    INDEPENDENT_SPEEDS,
    INPUTS,
    OUTPUTS,
    PLACES,
)
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.joints import free_rate
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

NUMBERS = parts.Numbers(len(PLACES), (6, 7, 8, 9), (10, 11, 12, 13))


def derive() -> Program:
    """Derive accelerations, outputs and the state of all 26 coordinates; parameters are symbols."""
    tape = Tape()
    q, rates = body.symbols(INDEPENDENT_COORDINATES), body.symbols(INDEPENDENT_SPEEDS)
    rack = body.symbols(INPUTS)
    p, flat = parts.parameters()
    vehicle, attitude, speeds = parts.vehicle(tape, q, rates, p, NUMBERS)
    corners, motions = closed_corners(tape, q, rates, rack, vehicle.points)
    front = [
        front_corner(tape, vehicle, k, corners[k].linkage, motions[k].bodies) for k in range(2)
    ]
    free = [free_rate(k, rate) for k, rate in enumerate(rates)]
    whole = [*front, *(rear_corner(tape, vehicle, k, free) for k in (2, 3))]
    mass, _ = assembly.kane(tape, vehicle, whole)
    solved = assembly.solved(tape, vehicle, whole)
    accelerations = [
        *assembly.chassis_accelerations(tape, attitude, solved, speeds),
        *(solved[k] for k in range(6, NUMBERS.total)),
    ]
    carriers = [corner.linkage.carrier for corner in corners]
    zero = sp.Integer(0)
    outputs = [*assembly.outputs(tape, vehicle, whole, speeds, carriers), zero, zero]
    n = NUMBERS.total
    return assemble(
        tape,
        {"x": [*q, *rates], "u": rack},
        flat,
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (outputs, (len(OUTPUTS),)),
            "full_state": (full_state(tape, q, rates, corners, motions), (2 * len(COORDINATES),)),
            "mass": ([entry for row in mass for entry in row], (n, n)),
            "quasi_speeds": (_quasi_speeds(tape, rates, speeds, corners, motions), (n,)),
            "suspension": (_suspension(tape, vehicle, corners[0]), (3, 4)),
        },
    )


def closed_corners(
    tape: Tape,
    q: Sequence[sp.Symbol],
    rates: Sequence[sp.Symbol],
    rack: Sequence[sp.Symbol],
    points: Sequence[Mapping[str, g.Vector]],
) -> tuple[list[ClosedCorner], list[ClosedMotions]]:
    """Both front corners and their motions, from angles and rates of the lower arms."""
    corners, motions = [], []
    for k, number in enumerate(NUMBERS.arms[:2]):
        corner = closed_corner.closed(tape, q[number], rack[0], points[k], parts.SIDES[k])
        moved = (rack[1], rack[2])
        corners.append(corner)
        motions.append(closed_corner.motions(tape, corner, number, rates[number], moved, points[k]))
    return corners, motions


def carrier_turns(
    turning: g.Vector,
    corners: Sequence[ClosedCorner],
    motions: Sequence[ClosedMotions],
    rates: Sequence[sp.Expr],
) -> list[sp.Expr]:
    """Angular velocities in space of wheel carriers and trailing arms about the wheels' axles.

    Parameters
    ----------
    turning
        Angular velocity of the chassis.
    rates
        Of the coordinates, by number.
    """
    turns = []
    for corner, motion in zip(corners, motions, strict=True):
        axle = g.column(corner.linkage.carrier, 1)
        turns.append(axle @ (turning + motion.bodies.carrier.value))
    return [*turns, *(turning[1] + rates[number] for number in NUMBERS.arms[2:])]


def full_state(
    tape: Tape,
    q: Sequence[sp.Expr],
    rates: Sequence[sp.Expr],
    corners: Sequence[ClosedCorner],
    motions: Sequence[ClosedMotions],
) -> list[sp.Expr]:
    """All 26 coordinates and their rates, from the 14 independent ones and theirs."""
    lifted, lifted_rates = [*q[:6]], [*rates[:6]]
    for corner, motion, number in zip(corners, motions, NUMBERS.arms, strict=False):
        angles, turning = _joints(tape, corner, motion)
        # The lower arm's angle comes after that of the upper one.
        lifted += [*angles[:4], q[number], *angles[4:]]
        lifted_rates += [*turning[:4], rates[number], *turning[4:]]
    return [*lifted, *q[8:], *lifted_rates, *rates[8:]]


def _joints(
    tape: Tape, corner: ClosedCorner, motions: ClosedMotions
) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """zeta, eta, xi, theta_u, alpha, beta of a corner, and their rates."""
    let, linkage = tape.let, corner.linkage
    rows, (x, y, z) = linkage.carrier, linkage.rod_direction
    first = g.column(rows, 0)
    flat = let(first[0] ** 2 + first[1] ** 2)
    level = let(sp.sqrt(flat))
    turn = linkage.upper.angle
    assert isinstance(turn, tuple)
    wide = let(x**2 + y**2)
    angles = [
        sp.atan2(first[1], first[0]),
        sp.atan2(-first[2], level),
        sp.atan2(rows[2][1], rows[2][2]),
        sp.atan2(turn[1], turn[0]),
        sp.atan2(-x, y),
        sp.atan2(z, let(sp.sqrt(wide))),
    ]
    # Angular velocity of the carrier along z, the turned y axis and the carrier's x axis.
    a, b, c = motions.bodies.carrier.value
    roll = let((a * first[0] + b * first[1]) / flat)
    pitch = let((b * first[0] - a * first[1]) / level)
    yaw = let(c - roll * first[2])
    rod = motions.bodies.rod.value
    # The rod turns about z with alpha and about the turned x axis, (y, -x) / root, with beta.
    beta = let((rod[0] * y - rod[1] * x) / let(sp.sqrt(wide)))
    rates = [yaw, pitch, roll, motions.upper.value, rod[2], beta]
    return [let(angle) for angle in angles], rates


def _quasi_speeds(
    tape: Tape,
    rates: Sequence[sp.Expr],
    speeds: Sequence[sp.Expr],
    corners: Sequence[ClosedCorner],
    motions: Sequence[ClosedMotions],
) -> list[sp.Expr]:
    """Chassis speeds, rates of the arms, and spins of the wheels in space."""
    turns = carrier_turns(g.vector(speeds[3:6]), corners, motions, rates)
    spins = zip(turns, NUMBERS.spins, strict=True)
    return [*speeds, *rates[6:10], *(tape.let(turn + rates[number]) for turn, number in spins)]


def _suspension(tape: Tape, vehicle: parts.Vehicle, corner: ClosedCorner) -> list[sp.Expr]:
    """Rows: left front and rear wheel centre with the length of the spring; front axle and zero."""
    linkage, front, rear = corner.linkage, vehicle.points[0], vehicle.points[2]
    angle = vehicle.q[NUMBERS.arms[2]]

    def behind(name: str) -> g.Vector:
        lever = g.named(tape, rear[name] - rear["rear_arm_pivot"])
        turned = g.rotate_about_axis(tape, lever, mechanics.UNIT[1], angle)
        return g.named(tape, rear["rear_arm_pivot"] + turned)

    def spring(end: g.Vector, fixed: g.Vector) -> sp.Expr:
        return g.length(tape, g.named(tape, end - fixed))

    lever = linkage.lower.lever(tape, front["front_spring_arm_point"])
    return [
        *linkage.on_carrier(tape, front["wheel_centre"]),
        spring(linkage.lower.rear + lever, front["front_spring_chassis_point"]),
        *behind("rear_wheel_centre"),
        spring(behind("rear_spring_arm_point"), rear["rear_spring_chassis_point"]),
        *g.column(linkage.carrier, 1),
        sp.Integer(0),
    ]
