"""Double-wishbone suspension: kinematics of one front-left corner in 8 joint coordinates (AE).

Masoudi, Uchida, McPhee (2015), section 3.2 and figure 5; joint coordinates after Uchida and McPhee
(2012), Multibody Syst. Dyn. 28(4), 331-347.  Axes: ISO 8855, x forward, y left, z up; the chassis
is fixed.  The inputs are the height of the wheel centre above its design position and the
displacement of the steering rack.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.double_wishbone.points import JOINTS, design_coordinates
from vehiclemor.multibody.quantities import declared

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program


def derive() -> Program:
    """Derive residual, analytic Jacobian and outputs; the hard points stay symbols."""
    from vehiclemor.multibody.double_wishbone import equations

    return equations.derive()


DEFINITION = ModelDefinition(
    name="double_wishbone",
    kind="ae",
    summary="double-wishbone suspension, kinematics, 8 joint coordinates (algebraic equations)",
    maneuver="sine_travel",
    **declared("double_wishbone"),
    joints=JOINTS,
    derive=derive,
    design_coordinates=design_coordinates,
    # Beyond what a steering does (wheels turn by 0.7 rad, racks move by 0.08 m), and before the
    # cusp of the lower limit: there the wheel has turned by 1.04 rad, and soon turns right round.
    stops={"zeta": 1.0, "s": 0.1},
    tabled_outputs=("spindle_y", "second_euler_angle"),
    main_outputs=("second_euler_angle",),
)
