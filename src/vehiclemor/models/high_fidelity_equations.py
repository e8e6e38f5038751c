"""Equations of the high-fidelity vehicle, in minimal accelerations and before elimination.

The closures of the front corners are stabilised after J. Baumgarte, Comput. Methods Appl. Mech.
Eng. 1 (1972), 1-16.  A solve with fixed pivots in each front corner expresses its accelerations by
that of the lower arm, so that Kane's equations remain in 14 accelerations and no multipliers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from vehiclemor.models import double_wishbone_linkage as linkage
from vehiclemor.models import vehicle_body as body
from vehiclemor.models import vehicle_corners as corners
from vehiclemor.models.double_wishbone_points import POINTS
from vehiclemor.models.equations import DynamicEquations
from vehiclemor.models.high_fidelity_vehicle import (
    CONSTRAINTS,
    COORDINATES,
    INPUTS,
    OUTPUTS,
    PARAMETERS,
    SOLVED,
    SPEEDS,
)
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate_several, eliminate_symmetric
from vehiclemor.symbolic.joints import Rate, free_rate
from vehiclemor.symbolic.program import assemble
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
# Places of the front corners' coordinates, and of the arms that carry the springs.
CORNER = (range(6, 13), range(13, 20))
LOWER_ARMS = (10, 17)
REAR_ARMS = (20, 21)
SPINS = (22, 23, 24, 25)
# Pivots (closure, coordinate of the six without the lower arm's) at the design position.
PIVOTS = ((3, 4), (5, 5), (0, 1), (1, 2), (2, 3), (4, 0))
# Accelerations that are solved for: each but the last six couples to these and to one other.
INDEPENDENT = (*SPINS, *LOWER_ARMS, *REAR_ARMS, *range(6))


@dataclass(frozen=True)
class _Mechanism:
    """What both forms of the equations share: chassis, front linkages, design points, symbols."""

    chassis: corners.Chassis
    linkages: tuple[linkage.Linkage, ...]
    points: tuple[dict[str, g.Vector], ...]
    q: list[sp.Symbol]
    rates: list[sp.Symbol]
    rack: tuple[sp.Symbol, ...]
    p: dict[str, sp.Expr]


def derive() -> DynamicEquations:
    """Derive accelerations, outputs, and the unsolved descriptor form; parameters stay symbols."""
    tape = Tape()
    q, rates = body.symbols(COORDINATES), body.symbols(SPEEDS)
    rack = body.symbols(INPUTS)
    p, flat = _parameters()
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
    points = _points(tape, p)
    mechanism = _Mechanism(
        corners.Chassis(frame, up, q[2]),
        tuple(linkage.assembled(tape, _own(q, k), rack[0], points[k], SIDES[k]) for k in range(2)),
        points,
        q,
        rates,
        tuple(rack),
        p,
    )
    free = [free_rate(k, rate) for k, rate in enumerate(rates)]
    gaps, motions = _closures(tape, mechanism, free)
    gap_rates = [value for motion in motions for value in motion.value]
    a, b = tape.let(2 * p["baumgarte_a"]), tape.let(p["baumgarte_b"] ** 2)
    biases = [bias for motion in motions for bias in motion.bias]
    gamma = [
        tape.let(-bias - a * rate - b * gap)
        for bias, rate, gap in zip(biases, gap_rates, gaps, strict=True)
    ]

    bound = _bound_rates(tape, motions, gamma, free)
    vehicle = _corners(tape, mechanism, bound)
    mass, force = _kane(tape, mechanism, vehicle)
    chosen = sorted(INDEPENDENT)
    solved = eliminate_symmetric(
        tape,
        [[mass[j][k] for k in chosen] for j in chosen],
        [force[j] for j in chosen],
        [chosen.index(k) for k in INDEPENDENT],
    )
    accelerations = _accelerations(
        tape, attitude, bound, dict(zip(chosen, solved, strict=True)), speeds
    )

    open_vehicle = _corners(tape, mechanism, free)
    mass, force = _kane(tape, mechanism, open_vehicle)
    zero = g.vector((0, 0, 0))
    open_form = body.in_coordinates(tape, attitude, speeds, mass, force, velocity_bias=zero)
    n = len(COORDINATES)
    rows = [open_form[j * (n + 1) : (j + 1) * (n + 1)] for j in range(n)]
    second_order = [
        e
        for row in rows
        for e in [
            *row[:n],
            tape.let(sp.Add(*[row[k] * accelerations[k] for k in range(n)])),
        ]
    ]
    descriptor = [*open_form]
    for row, right in zip(_rows(motions, range(n)), gamma, strict=True):
        descriptor += [*row, right]
    program = assemble(
        tape,
        {"x": [*q, *rates], "u": rack},
        flat,
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (
                _outputs(tape, mechanism, vehicle, speeds, gaps, gap_rates),
                (len(OUTPUTS),),
            ),
            "second_order": (second_order, (n, n + 1)),
            "speeds": (list(rates), (n,)),
            "descriptor": (descriptor, (n + len(CONSTRAINTS), n + 1)),
            "violations": (
                [e for pair in zip(gaps, gap_rates, strict=True) for e in pair],
                (len(CONSTRAINTS), 2),
            ),
        },
    )
    return DynamicEquations(COORDINATES, SPEEDS, INPUTS, OUTPUTS, program, CONSTRAINTS)


def _parameters() -> tuple[dict[str, sp.Expr], list[sp.Symbol]]:
    """Symbols of the parameters by name, components of points apart, and in order."""
    flat = []
    for name, declared in PARAMETERS.items():
        flat += [name] if declared.size == 1 else [f"{name}_{axis}" for axis in "xyz"]
    flat += SOLVED
    symbols = {name: sp.Symbol(f"p_{name}", real=True) for name in flat}
    return dict(symbols), list(symbols.values())


def _points(tape: Tape, p: Mapping[str, sp.Expr]) -> tuple[dict[str, g.Vector], ...]:
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


def _motions(tape: Tape, m: _Mechanism, rates: Sequence[Rate], k: int) -> corners.LinkageMotions:
    rack = (m.rack[1], m.rack[2])
    return corners.linkage_motions(tape, m.linkages[k], _own(m.q, k), _own(rates, k), rack)


def _own(values: Sequence[Any], k: int) -> Sequence[Any]:
    """The part of a list over all coordinates that belongs to a front corner."""
    return values[CORNER[k].start : CORNER[k].stop]


def _rows(motions: Sequence[mechanics.Motion], numbers: Sequence[int]) -> list[list[sp.Expr]]:
    """Rows of the Jacobian of closures, in the columns of some speeds."""
    return [
        [motion.columns[j][i] if j in motion.columns else sp.Integer(0) for j in numbers]
        for motion in motions
        for i in range(3)
    ]


def _closures(
    tape: Tape, m: _Mechanism, free: Sequence[Rate]
) -> tuple[list[sp.Expr], list[mechanics.Motion]]:
    """The 12 closures and their motions, three at a time."""
    gaps, motions = [], []
    for k in range(2):
        own = _motions(tape, m, free, k)
        new, moving = corners.closures(tape, m.linkages[k], own, m.points[k])
        gaps += new
        motions += moving
    return gaps, motions


def _bound_rates(
    tape: Tape,
    closures: Sequence[mechanics.Motion],
    gamma: Sequence[sp.Expr],
    free: Sequence[Rate],
) -> list[Rate]:
    """Rates whose derivatives follow from the closures and those of the lower arms."""
    bound = list(free)
    for k in range(2):
        lower, pair = LOWER_ARMS[k], closures[2 * k : 2 * k + 2]
        dependent = [j for j in CORNER[k] if j != lower]
        driving = [-row[0] for row in _rows(pair, [lower])]
        follow, bias = eliminate_several(
            tape, _rows(pair, dependent), [driving, gamma[6 * k : 6 * k + 6]], PIVOTS
        )
        for place, j in enumerate(dependent):
            bound[j] = Rate(free[j].value, {lower: follow[place]}, bias[place])
    return bound


def _corners(tape: Tape, m: _Mechanism, rates: Sequence[Rate]) -> list[corners.Corner]:
    result = []
    for k in range(4):
        spin = corners.Spin(SPINS[k], m.rates[SPINS[k]])
        if k < 2:
            own, number = _motions(tape, m, rates, k), LOWER_ARMS[k]
            result.append(
                corners.front_corner(
                    tape, m.chassis, m.linkages[k], own, m.points[k], spin, m.p, number, SIDES[k]
                )
            )
        else:
            number = REAR_ARMS[k - 2]
            result.append(
                corners.rear_corner(
                    tape,
                    m.chassis,
                    m.q[number],
                    rates[number],
                    m.points[k],
                    spin,
                    m.p,
                    number,
                    SIDES[k],
                )
            )
    return result


def _kane(
    tape: Tape, m: _Mechanism, vehicle: Sequence[corners.Corner]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix and forces of all bodies, springs added."""
    frame, p = m.chassis.frame, m.p
    inertia = corners.diagonal(p, "chassis_inertia")
    chassis = mechanics.Body(
        p["chassis_mass"],
        frame.origin(tape),
        mechanics.ZERO,
        frame.rotation(tape, inertia),
        inertia,
    )
    bodies = [chassis, *(part for corner in vehicle for part in corner.bodies)]
    mass, force = mechanics.kane(tape, len(COORDINATES), bodies)
    for number, corner in zip((*LOWER_ARMS, *REAR_ARMS), vehicle, strict=True):
        force[number] = tape.let(force[number] + corner.spring_moment)
    return mass, force


def _accelerations(
    tape: Tape,
    attitude: body.Attitude,
    rates: Sequence[Rate],
    solved: Mapping[int, sp.Expr],
    speeds: Sequence[sp.Expr],
) -> list[sp.Expr]:
    """Second derivatives of all coordinates."""
    turning = g.vector(speeds[3:6])
    position = g.rotate(tape, attitude.rotation, g.vector([solved[k] for k in range(3)]))
    bias = body.angle_bias(tape, attitude, turning)
    change = g.named(tape, g.subtract(g.vector([solved[k] for k in range(3, 6)]), bias))
    angles = body.angle_rates(tape, attitude, change)
    joints = [
        solved[k]
        if k in solved
        else tape.let(
            rate.bias + sp.Add(*[factor * solved[j] for j, factor in rate.columns.items()])
        )
        for k, rate in enumerate(rates)
    ]
    return [*position, *angles, *joints[6:]]


def _outputs(
    tape: Tape,
    m: _Mechanism,
    vehicle: Sequence[corners.Corner],
    speeds: Sequence[sp.Expr],
    gaps: Sequence[sp.Expr],
    gap_rates: Sequence[sp.Expr],
) -> list[sp.Expr]:
    q = m.q
    contacts = [corner.contact for corner in vehicle]
    tires = [corner.tire for corner in vehicle]

    def norm(values: Sequence[sp.Expr]) -> sp.Expr:
        return tape.let(sp.sqrt(tape.let(sp.Add(*[value**2 for value in values]))))

    return [
        *(q[0], q[1], q[3], q[4], q[5]),
        *(speeds[0], speeds[1], m.rates[2], speeds[5]),
        *(tire.longitudinal for tire in tires),
        *(tire.lateral for tire in tires),
        *(contact.load for contact in contacts),
        *(tire.aligning for tire in tires),
        *(contact.slip_ratio for contact in contacts),
        *(tape.let(sp.atan(contact.tan_slip)) for contact in contacts),
        *(tape.let(sp.atan2(-part.carrier[0][1], part.carrier[1][1])) for part in m.linkages),
        norm(gaps),
        norm(gap_rates),
    ]
