"""Equations of the double-wishbone suspension: closures, analytic Jacobian, Newton step."""

from typing import cast

import sympy as sp

from vehiclemor.multibody.double_wishbone import linkage
from vehiclemor.multibody.double_wishbone.points import JOINTS
from vehiclemor.multibody.quantities import declared
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.elimination import eliminate
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

# Pivots (equation, coordinate) of the Newton step, by Markowitz' rule at the design position.
PIVOTS = ((7, 7), (3, 5), (5, 6), (2, 4), (6, 3), (1, 2), (0, 1), (4, 0))

DECLARED = declared("double_wishbone")


def derive() -> Program:
    """Derive residual, analytic Jacobian and outputs; the hard points stay symbols."""
    tape = Tape()
    q = sp.symbols([c.name for c in DECLARED["coordinates"]], real=True)
    u = sp.symbols([i.name for i in DECLARED["inputs"]], real=True)
    points = {
        name: g.vector(sp.symbols([f"{name}_{axis}" for axis in "xyz"], real=True))
        for name in DECLARED["parameters"]
    }
    position = _positions(tape, q, points)

    closures = [
        *position["lower_ball_joint"] - position["lower_ball_joint_arm"],
        *position["tie_rod_outer"] - position["tie_rod_outer_rod"],
    ]
    centre = position["wheel_centre"] - points["wheel_centre"]
    residual = [tape.let(e) for e in [*closures, centre[2] - u[0], q[7] - u[1]]]
    jacobian = tape.jacobian(residual, q)
    axle = position["axle_direction"]
    outputs = [centre[0], centre[1], q[1], sp.atan2(-axle[0], axle[1]), sp.asin(axle[2]), q[7]]
    (step,) = eliminate(tape, jacobian, [residual], PIVOTS)
    augmented = [e for row, phi in zip(jacobian, residual, strict=True) for e in [*row, phi]]
    n = len(DECLARED["coordinates"])
    return assemble(
        tape,
        {"q": q, "u": u},
        cast("list[sp.Symbol]", [component for point in points.values() for component in point]),
        {
            "residual": (residual, (n,)),
            "residual_jacobian": (augmented, (n, n + 1)),
            "newton_step": (step, (n,)),
            "outputs": (outputs, (len(DECLARED["outputs"]),)),
            "joints": (
                [c for name in JOINTS for c in position[name]],
                (len(JOINTS), 3),
            ),
        },
    )


def _positions(tape: Tape, q: list[sp.Symbol], points: dict[str, g.Vector]) -> dict[str, g.Vector]:
    """Moving points in the chassis frame, each ball joint as seen from both of its bodies."""
    corner = linkage.assembled(tape, q[:7], q[7], points)
    return {
        "upper_ball_joint": corner.upper_ball_joint,
        "lower_ball_joint": corner.on_carrier(tape, points["lower_ball_joint"]),
        "lower_ball_joint_arm": corner.on_lower_arm(tape, points["lower_ball_joint"]),
        "tie_rod_inner": corner.rack_end,
        "tie_rod_outer": corner.on_carrier(tape, points["tie_rod_outer"]),
        "tie_rod_outer_rod": g.named(tape, corner.rod_end),
        "wheel_centre": corner.on_carrier(tape, points["wheel_centre"]),
        "axle_direction": g.column(corner.carrier, 1),
    }
