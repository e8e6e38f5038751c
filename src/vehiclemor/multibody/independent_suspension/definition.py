"""Vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE).

Masoudi, Uchida, McPhee (2015), section 3.1 and figure 1; structure after Sayers and Han (1996), A
generic multibody vehicle model for simulating handling and braking, Veh. Syst. Dyn. 25 (sup1),
599-613: a sprung body, four lumped masses on vertical prismatic joints, four spinning wheels.
Axes: ISO 8855.  Steering is quasi-static: the rate of the steering angle appears nowhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.independent_suspension.equilibrium import check, starts
from vehiclemor.multibody.quantities import FORWARD, TIRE_LOADS, UPRIGHT, WHEELS, declared

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program


def derive() -> Program:
    """Derive state derivatives, outputs and the second-order form; parameters stay symbols."""
    from vehiclemor.multibody.independent_suspension import equations

    return equations.derive()


DEFINITION = ModelDefinition(
    name="independent_suspension_vehicle",
    kind="ode",
    summary="vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE)",
    maneuver="lane_change",
    **declared("independent_suspension_vehicle"),
    derive=derive,
    check=check,
    starts=starts,
    cyclic=("X", "Y", *(f"gamma_{wheel}" for wheel in WHEELS)),
    planar=("X", "Y", "psi"),
    # Slip needs forward motion, the contact point lies below the wheel centre.
    # Steering as far as that of the car (CommonRoad, BMW 320i).
    validity={"longitudinal_speed": FORWARD, **UPRIGHT, "delta": (-1.066, 1.066)},
    loads=TIRE_LOADS,
    tabled_outputs=("pitch", "yaw", "roll", "lateral_position", "vertical_speed"),
    main_outputs=("pitch", "yaw", "lateral_position"),
)
