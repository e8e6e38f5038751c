"""Equations of the double-wishbone suspension: closures, analytic Jacobian, Newton step."""

from typing import cast

import sympy as sp

from vehiclemor.multibody.components import linkage
from vehiclemor.multibody.double_wishbone.definition import DECLARED, JOINTS
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.elimination import eliminate
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

# Pivots (equation, coordinate) of the Newton step, by Markowitz' rule at the design position.
PIVOTS = ((7, 7), (3, 5), (5, 6), (2, 4), (6, 3), (1, 2), (0, 1), (4, 0))


def derive() -> Program:
    """Derive residual, analytic Jacobian and outputs; the hard points stay symbols."""
    tape = Tape()
    q = sp.symbols([c.name for c in DECLARED["coordinates"]], real=True)
    u = sp.symbols([i.name for i in DECLARED["inputs"]], real=True)
    points = {}
    for name in DECLARED["parameters"]:
        components = sp.symbols([f"{name}_{axis}" for axis in "xyz"], real=True)
        points[name] = g.vector(components)
    corner = linkage.assembled(tape, q[:7], q[7], points)
    closures = corner.gaps(tape, points)
    wheel_centre, axle = (
        corner.on_carrier(tape, points["wheel_centre"]),
        g.column(corner.carrier, 1),
    )
    centre = wheel_centre - points["wheel_centre"]
    residual = [tape.let(e) for e in [*closures, centre[2] - u[0], q[7] - u[1]]]
    jacobian = tape.jacobian(residual, q)
    # As `JOINTS` names them.
    joints = [
        *(corner.upper_ball_joint, corner.on_carrier(tape, points["lower_ball_joint"])),
        *(corner.rack_end, corner.on_carrier(tape, points["tie_rod_outer"]), wheel_centre, axle),
    ]
    outputs = [centre[0], centre[1], q[1], sp.atan2(-axle[0], axle[1]), sp.asin(axle[2]), q[7]]
    (step,) = eliminate(tape, jacobian, [residual], PIVOTS)
    augmented = []
    for row, phi in zip(jacobian, residual, strict=True):
        augmented += [*row, phi]
    symbols = [component for point in points.values() for component in point]
    n = len(DECLARED["coordinates"])
    return assemble(
        tape,
        {"q": q, "u": u},
        cast("list[sp.Symbol]", symbols),
        {
            "residual": (residual, (n,)),
            "residual_jacobian": (augmented, (n, n + 1)),
            "newton_step": (step, (n,)),
            "outputs": (outputs, (len(DECLARED["outputs"]),)),
            "joints": ([c for joint in joints for c in joint], (len(JOINTS), 3)),
        },
    )
