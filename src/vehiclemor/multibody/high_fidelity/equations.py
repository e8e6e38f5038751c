"""Equations of the high-fidelity vehicle, in minimal accelerations and before elimination.

The closures of the front corners are stabilised after J. Baumgarte, Comput. Methods Appl. Mech.
Eng. 1 (1972), 1-16.  A solve with fixed pivots in each front corner expresses its accelerations by
that of the lower arm, so that Kane's equations remain in 14 accelerations and no multipliers.
"""

from collections.abc import Mapping, Sequence

import sympy as sp

from vehiclemor.multibody.components import body, linkage
from vehiclemor.multibody.components.tires import Corner, kane_with_corners, tire_outputs
from vehiclemor.multibody.high_fidelity import corners
from vehiclemor.multibody.high_fidelity.corners import Vehicle
from vehiclemor.multibody.high_fidelity.definition import ARMS, CORNER, DECLARED, SPINS
from vehiclemor.multibody.quantities import DEFAULTS, InputChoice
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate, eliminate_symmetric
from vehiclemor.symbolic.mechanics import Rate, free_rate
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

LOWER_ARMS = ARMS[:2]
# Order of elimination: each but the last six couples to these and to one other.
ORDER = (*SPINS, *ARMS, *range(6))
# Pivots (closure, coordinate of the six without the lower arm's) at the design position.
PIVOTS = ((3, 4), (5, 5), (0, 1), (1, 2), (2, 3), (4, 0))


def derive(choice: InputChoice = DEFAULTS) -> Program:
    """Derive accelerations, outputs, and the unsolved descriptor form; parameters stay symbols."""
    tape = Tape()
    vehicle, parameters = corners.vehicle(tape, choice)
    p, q, rates, speeds = vehicle.p, vehicle.q, vehicle.rates, vehicle.speeds
    n, count = len(q), len(DECLARED["constraints"])
    free = [free_rate(k, rate) for k, rate in enumerate(rates)]
    gaps, motions = _closures(tape, vehicle, free)
    gap_rates = [value for motion in motions for value in motion.value]
    a, b = tape.let(2 * p["baumgarte_a"]), tape.let(p["baumgarte_b"] ** 2)
    biases = [bias for motion in motions for bias in motion.bias]
    gamma = [
        tape.let(-bias - a * rate - b * gap)
        for bias, rate, gap in zip(biases, gap_rates, gaps, strict=True)
    ]

    bound = _bound_rates(tape, motions, gamma, free)
    closed = _corners(tape, vehicle, bound)
    solved = eliminate_symmetric(tape, *_kane(tape, vehicle, closed), ORDER)
    accelerations = _chassis_accelerations(tape, vehicle, solved)
    for rate in bound[6:]:
        change = sp.Add(*[factor * solved[j] for j, factor in rate.columns.items()])
        accelerations.append(tape.let(rate.bias + change))

    mass, force = _kane(tape, vehicle, _corners(tape, vehicle, free))
    open_form = body.in_coordinates(
        tape, vehicle.attitude, speeds, mass, force, velocity_bias=mechanics.ZERO
    )
    second_order = []
    for j in range(n):
        mass_row = open_form[j * (n + 1) : (j + 1) * (n + 1) - 1]
        products = [m * a for m, a in zip(mass_row, accelerations, strict=True)]
        second_order += [*mass_row, tape.let(sp.Add(*products))]
    descriptor = [*open_form]
    for row, right in zip(_rows(motions, range(n)), gamma, strict=True):
        descriptor += [*row, right]
    violations = [e for pair in zip(gaps, gap_rates, strict=True) for e in pair]
    outputs = [
        *_outputs(tape, vehicle, closed),
        *(_norm(tape, values) for values in (gaps, gap_rates)),
    ]
    return assemble(
        tape,
        {"x": [*q, *rates], "u": vehicle.inputs.driven},
        parameters,
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (outputs, (len(DECLARED["outputs"]),)),
            "second_order": (second_order, (n, n + 1)),
            "speeds": (list(rates), (n,)),
            "descriptor": (descriptor, (n + count, n + 1)),
            "violations": (violations, (count, 2)),
        },
    )


def _rows(motions: Sequence[mechanics.Motion], numbers: Sequence[int]) -> list[list[sp.Expr]]:
    """Rows of the Jacobian of closures, in the columns of some speeds."""
    return [
        [motion.columns[j][i] if j in motion.columns else sp.Integer(0) for j in numbers]
        for motion in motions
        for i in range(3)
    ]


def _closures(
    tape: Tape, v: Vehicle, free: Sequence[Rate]
) -> tuple[list[sp.Expr], list[mechanics.Motion]]:
    """The 12 closures and their motions, three at a time."""
    gaps, motions = [], []
    for k in range(2):
        new, moving = linkage.closures(tape, v.linkages[k], v.motions(tape, free, k), v.points[k])
        gaps += new
        motions += moving
    return gaps, motions


def _bound_rates(
    tape: Tape, closures: Sequence[mechanics.Motion], gamma: Sequence[sp.Expr], free: Sequence[Rate]
) -> list[Rate]:
    """Rates whose derivatives follow from the closures and those of the lower arms."""
    bound = list(free)
    for k, lower in enumerate(LOWER_ARMS):
        pair = closures[2 * k : 2 * k + 2]
        dependent = [j for j in CORNER[k] if j != lower]
        driving = [-row[0] for row in _rows(pair, [lower])]
        follow, bias = eliminate(
            tape, _rows(pair, dependent), [driving, gamma[6 * k : 6 * k + 6]], PIVOTS
        )
        for row, j in enumerate(dependent):
            bound[j] = Rate(free[j].value, {lower: follow[row]}, bias[row])
    return bound


def _corners(tape: Tape, v: Vehicle, rates: Sequence[Rate]) -> list[Corner]:
    front = [corners.front_corner(tape, v, k, v.motions(tape, rates, k)) for k in range(2)]
    return [*front, *(corners.rear_corner(tape, v, k, rates) for k in (2, 3))]


def _kane(
    tape: Tape, v: Vehicle, parts: Sequence[Corner]
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix and forces of all bodies, springs added."""
    inertia = corners.diagonal(v.p, "chassis_inertia")
    chassis = mechanics.Body(
        v.p["chassis_mass"],
        v.frame.origin(tape),
        g.vector((v.inputs.values["body_force_x"], 0, 0)),
        v.frame.rotation(tape, inertia),
        inertia,
    )
    return kane_with_corners(tape, chassis, parts, ARMS, len(v.q))


def _chassis_accelerations(tape: Tape, v: Vehicle, solved: Mapping[int, sp.Expr]) -> list[sp.Expr]:
    """Second derivatives of position, yaw, pitch and roll from the derivatives of the speeds."""
    attitude = v.attitude
    position = g.rotate(tape, attitude.rotation, g.vector([solved[k] for k in range(3)]))
    bias = body.angle_bias(tape, attitude, v.frame.angular_velocity)
    change = g.named(tape, g.vector([solved[k] for k in range(3, 6)]) - bias)
    return [*position, *body.angle_rates(tape, attitude, change)]


def _outputs(tape: Tape, v: Vehicle, parts: Sequence[Corner]) -> list[sp.Expr]:
    """The model's outputs but for the last two, which measure the constraints."""
    # The vertical speed is that in space.
    speeds = [*v.speeds[:2], v.rates[2], *v.speeds[3:]]
    carriers = [part.carrier for part in v.linkages]
    return [
        *body.outputs(v.q, speeds),
        *tire_outputs(tape, parts),
        *(tape.let(sp.atan2(-carrier[0][1], carrier[1][1])) for carrier in carriers),
    ]


def _norm(tape: Tape, values: Sequence[sp.Expr]) -> sp.Expr:
    return tape.let(sp.sqrt(tape.let(sp.Add(*[value**2 for value in values]))))
