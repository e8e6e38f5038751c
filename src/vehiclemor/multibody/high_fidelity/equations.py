"""Equations of the high-fidelity vehicle, in minimal accelerations and before elimination.

The closures of the front corners are stabilised after J. Baumgarte, Comput. Methods Appl. Mech.
Eng. 1 (1972), 1-16.  A solve with fixed pivots in each front corner expresses its accelerations by
that of the lower arm, so that Kane's equations remain in 14 accelerations and no multipliers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.double_wishbone import linkage
from vehiclemor.multibody.high_fidelity import assembly, corners, linkage_motions, parts
from vehiclemor.multibody.high_fidelity.equilibrium import DECLARED
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate
from vehiclemor.symbolic.joints import Rate, free_rate
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

# Places of the front corners' coordinates, and of the arms that carry the springs.
CORNER = (range(6, 13), range(13, 20))
LOWER_ARMS = (10, 17)
NUMBERS = parts.Numbers(len(DECLARED["coordinates"]), (*LOWER_ARMS, 20, 21), (22, 23, 24, 25))
# Pivots (closure, coordinate of the six without the lower arm's) at the design position.
PIVOTS = ((3, 4), (5, 5), (0, 1), (1, 2), (2, 3), (4, 0))


@dataclass(frozen=True)
class _Mechanism:
    """The vehicle, its front linkages in any position, and displacement and motion of the rack."""

    vehicle: parts.Vehicle
    linkages: tuple[linkage.Linkage, ...]
    rack: tuple[sp.Symbol, ...]


def derive() -> Program:
    """Derive accelerations, outputs, and the unsolved descriptor form; parameters stay symbols."""
    tape = Tape()
    q, rates = body.symbols(DECLARED["coordinates"]), body.symbols(DECLARED["speeds"])
    rack = body.symbols(DECLARED["inputs"])
    p, flat = parts.parameters()
    vehicle, attitude, speeds = parts.vehicle(tape, q, rates, p, NUMBERS)
    mechanism = _Mechanism(
        vehicle,
        tuple(
            linkage.assembled(tape, _own(q, k), rack[0], vehicle.points[k], parts.SIDES[k])
            for k in range(2)
        ),
        tuple(rack),
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
    closed = _corners(tape, mechanism, bound)
    solved = assembly.solved(tape, vehicle, closed)
    accelerations = [
        *assembly.chassis_accelerations(tape, attitude, solved, speeds),
        *_joint_accelerations(tape, bound, solved)[6:],
    ]

    mass, force = assembly.kane(tape, vehicle, _corners(tape, mechanism, free))
    zero = g.vector((0, 0, 0))
    open_form = body.in_coordinates(tape, attitude, speeds, mass, force, velocity_bias=zero)
    n = len(DECLARED["coordinates"])
    rows = [open_form[j * (n + 1) : (j + 1) * (n + 1)] for j in range(n)]
    second_order = [
        e
        for row in rows
        for e in [*row[:n], tape.let(sp.Add(*[row[k] * accelerations[k] for k in range(n)]))]
    ]
    descriptor = [*open_form]
    for row, right in zip(_rows(motions, range(n)), gamma, strict=True):
        descriptor += [*row, right]
    return assemble(
        tape,
        {"x": [*q, *rates], "u": rack},
        flat,
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (
                _outputs(tape, mechanism, closed, speeds, gaps, gap_rates),
                (len(DECLARED["outputs"]),),
            ),
            "second_order": (second_order, (n, n + 1)),
            "speeds": (list(rates), (n,)),
            "descriptor": (descriptor, (n + len(DECLARED["constraints"]), n + 1)),
            "violations": (
                [e for pair in zip(gaps, gap_rates, strict=True) for e in pair],
                (len(DECLARED["constraints"]), 2),
            ),
        },
    )


def _motions(
    tape: Tape, m: _Mechanism, rates: Sequence[Rate], k: int
) -> linkage_motions.LinkageMotions:
    rack = (m.rack[1], m.rack[2])
    return linkage_motions.linkage_motions(
        tape, m.linkages[k], _own(m.vehicle.q, k), _own(rates, k), rack
    )


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
        new, moving = linkage_motions.closures(tape, m.linkages[k], own, m.vehicle.points[k])
        gaps += new
        motions += moving
    return gaps, motions


def _bound_rates(
    tape: Tape, closures: Sequence[mechanics.Motion], gamma: Sequence[sp.Expr], free: Sequence[Rate]
) -> list[Rate]:
    """Rates whose derivatives follow from the closures and those of the lower arms."""
    bound = list(free)
    for k in range(2):
        lower, pair = LOWER_ARMS[k], closures[2 * k : 2 * k + 2]
        dependent = [j for j in CORNER[k] if j != lower]
        driving = [-row[0] for row in _rows(pair, [lower])]
        follow, bias = eliminate(
            tape, _rows(pair, dependent), [driving, gamma[6 * k : 6 * k + 6]], PIVOTS
        )
        for place, j in enumerate(dependent):
            bound[j] = Rate(free[j].value, {lower: follow[place]}, bias[place])
    return bound


def _corners(tape: Tape, m: _Mechanism, rates: Sequence[Rate]) -> list[corners.Corner]:
    front = [
        corners.front_corner(tape, m.vehicle, k, m.linkages[k], _motions(tape, m, rates, k))
        for k in range(2)
    ]
    return [*front, *(corners.rear_corner(tape, m.vehicle, k, rates) for k in (2, 3))]


def _joint_accelerations(
    tape: Tape, rates: Sequence[Rate], solved: Mapping[int, sp.Expr]
) -> list[sp.Expr]:
    """Derivatives of rates, from those that are solved for."""
    return [
        solved[k]
        if k in solved
        else tape.let(
            rate.bias + sp.Add(*[factor * solved[j] for j, factor in rate.columns.items()])
        )
        for k, rate in enumerate(rates)
    ]


def _outputs(
    tape: Tape,
    m: _Mechanism,
    corner_parts: Sequence[corners.Corner],
    speeds: Sequence[sp.Expr],
    gaps: Sequence[sp.Expr],
    gap_rates: Sequence[sp.Expr],
) -> list[sp.Expr]:
    def norm(values: Sequence[sp.Expr]) -> sp.Expr:
        return tape.let(sp.sqrt(tape.let(sp.Add(*[value**2 for value in values]))))

    carriers = [part.carrier for part in m.linkages]
    return [
        *assembly.outputs(tape, m.vehicle, corner_parts, speeds, carriers),
        norm(gaps),
        norm(gap_rates),
    ]
