"""Double-wishbone suspension: kinematics of one front-left corner in 8 joint coordinates (AE).

Masoudi, Uchida, McPhee (2015), section 3.2 and figure 5; joint coordinates after Uchida and McPhee
(2012), Multibody Syst. Dyn. 28(4), 331-347.  Axes: ISO 8855, x forward, y left, z up; the chassis
is fixed.  The inputs are the height of the wheel centre above its design position and the
displacement of the steering rack.
"""

from collections.abc import Mapping
from typing import cast

import numpy as np
import sympy as sp

from vehiclemor.models.double_wishbone import linkage as double_wishbone_linkage
from vehiclemor.models.double_wishbone import points as double_wishbone_points
from vehiclemor.models.equations import AlgebraicEquations
from vehiclemor.models.quantities import Quantity
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.elimination import eliminate
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

NAME = "double_wishbone"
KIND = "ae"
SUMMARY = "double-wishbone suspension, kinematics, 8 joint coordinates (algebraic equations)"
MANEUVER = "sine_travel"

COORDINATES = (
    Quantity("zeta", "rad", "first 3-2-1 Euler angle of the wheel carrier (about z)"),
    Quantity("eta", "rad", "second 3-2-1 Euler angle of the wheel carrier (about y)"),
    Quantity("xi", "rad", "third 3-2-1 Euler angle of the wheel carrier (about x)"),
    Quantity("theta_u", "rad", "rotation of the upper control arm"),
    Quantity("theta_l", "rad", "rotation of the lower control arm"),
    Quantity("alpha", "rad", "rotation of the tie rod's universal joint about z"),
    Quantity("beta", "rad", "rotation of the tie rod's universal joint about the rotated x axis"),
    Quantity("s", "m", "rack displacement, positive to the left"),
)
INPUTS = (
    Quantity("z", "m", "height of the wheel centre above its design position"),
    Quantity("s0", "m", "prescribed rack displacement, positive to the left"),
)
OUTPUTS = (
    Quantity("spindle_x", "m", "spindle displacement in x"),
    Quantity("spindle_y", "m", "spindle displacement in y"),
    Quantity("second_euler_angle", "rad", "second Euler angle of the wheel carrier"),
    Quantity("toe", "rad", "toe angle of the left wheel, positive when steered to the left"),
    Quantity("camber", "rad", "inclination of the left wheel's spin axis, positive upwards"),
    Quantity("rack", "m", "rack displacement"),
)
EQUATIONS = (
    Quantity("lower_ball_joint_x", "m", "closure of the lower ball joint in x"),
    Quantity("lower_ball_joint_y", "m", "closure of the lower ball joint in y"),
    Quantity("lower_ball_joint_z", "m", "closure of the lower ball joint in z"),
    Quantity("tie_rod_x", "m", "closure of the outer tie-rod joint in x"),
    Quantity("tie_rod_y", "m", "closure of the outer tie-rod joint in y"),
    Quantity("tie_rod_z", "m", "closure of the outer tie-rod joint in z"),
    Quantity("wheel_height", "m", "prescribed wheel-centre height"),
    Quantity("rack_displacement", "m", "prescribed rack displacement"),
)
PARAMETERS = double_wishbone_points.POINTS


def derive() -> AlgebraicEquations:
    """Derive residual, analytic Jacobian and outputs; the hard points stay symbols."""
    tape = Tape()
    q = sp.symbols([c.name for c in COORDINATES], real=True)
    u = sp.symbols([i.name for i in INPUTS], real=True)
    points = {
        name: g.vector(sp.symbols([f"{name}_{axis}" for axis in "xyz"], real=True))
        for name in PARAMETERS
    }
    position = _positions(tape, q, points)

    closures = [
        *g.subtract(position["lower_ball_joint"], position["lower_ball_joint_arm"]),
        *g.subtract(position["tie_rod_outer"], position["tie_rod_outer_rod"]),
    ]
    centre = g.subtract(position["wheel_centre"], points["wheel_centre"])
    residual = [tape.let(e) for e in [*closures, centre[2] - u[0], q[7] - u[1]]]
    jacobian = tape.jacobian(residual, q)
    axle = position["axle_direction"]
    outputs = [
        centre[0],
        centre[1],
        q[1],
        sp.atan2(-axle[0], axle[1]),
        sp.asin(axle[2]),
        q[7],
    ]
    step = eliminate(tape, jacobian, residual, PIVOTS)
    augmented = [e for row, phi in zip(jacobian, residual, strict=True) for e in [*row, phi]]
    n = len(COORDINATES)
    program = assemble(
        tape,
        {"q": q, "u": u},
        cast("list[sp.Symbol]", [component for point in points.values() for component in point]),
        {
            "residual": (residual, (n,)),
            "residual_jacobian": (augmented, (n, n + 1)),
            "newton_step": (step, (n,)),
            "outputs": (outputs, (len(OUTPUTS),)),
            "joints": (
                [c for name in JOINTS for c in position[name]],
                (len(JOINTS), 3),
            ),
        },
    )
    return AlgebraicEquations(COORDINATES, INPUTS, OUTPUTS, EQUATIONS, JOINTS, program)


# Moving points that a drawing of the mechanism needs, beside the fixed pivots.
# Pivots (equation, coordinate) of the Newton step, by Markowitz' rule at the design position.
PIVOTS = ((7, 7), (3, 5), (5, 6), (2, 4), (6, 3), (1, 2), (0, 1), (4, 0))

JOINTS = (
    "upper_ball_joint",
    "lower_ball_joint",
    "tie_rod_inner",
    "tie_rod_outer",
    "wheel_centre",
    "axle_direction",
)


def _positions(tape: Tape, q: list[sp.Symbol], points: dict[str, g.Vector]) -> dict[str, g.Vector]:
    """Moving points in the chassis frame, each ball joint as seen from both of its bodies."""
    linkage = double_wishbone_linkage.assembled(tape, q[:7], q[7], points)
    return {
        "upper_ball_joint": linkage.upper_ball_joint,
        "lower_ball_joint": linkage.on_carrier(tape, points["lower_ball_joint"]),
        "lower_ball_joint_arm": linkage.on_lower_arm(tape, points["lower_ball_joint"]),
        "tie_rod_inner": linkage.rack_end,
        "tie_rod_outer": linkage.on_carrier(tape, points["tie_rod_outer"]),
        "tie_rod_outer_rod": g.named(tape, linkage.rod_end),
        "wheel_centre": linkage.on_carrier(tape, points["wheel_centre"]),
        "axle_direction": (linkage.carrier[0][1], linkage.carrier[1][1], linkage.carrier[2][1]),
    }


def design_coordinates(points: Mapping[str, np.ndarray]) -> np.ndarray:
    """Coordinates (8,) at the design position: zero, but for the tie rod's universal joint.

    Raises
    ------
    GeometryError
        If two joints of one body coincide, so that the mechanism can't be assembled.
    """
    double_wishbone_points.check_linkage(points)
    design = np.zeros(len(COORDINATES))
    design[5:7] = double_wishbone_points.tie_rod_angles(
        points["tie_rod_inner"], points["tie_rod_outer"]
    )
    return design
