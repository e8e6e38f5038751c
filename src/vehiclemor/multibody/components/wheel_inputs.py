"""Optional inputs at one wheel: torques of drive and brake, friction, height of the road."""

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic.tape import Tape

# Spin in rad/s below which a brake fades, so that its torque changes sign smoothly.
BRAKE_SPEED = sp.Integer(1)


@dataclass(frozen=True)
class WheelInputs:
    """Symbols, or defaults of inputs that are neither driven nor parameters.

    Attributes
    ----------
    drive, brake
        Torques in N m: forwards on the wheel; against its spin, not negative.
    friction
        Factor on the friction of the tire.
    road, road_rate
        Height of the road under the wheel in m, upwards, and its rate in m/s.
    """

    drive: sp.Expr
    brake: sp.Expr
    friction: sp.Expr
    road: sp.Expr
    road_rate: sp.Expr

    def torque(self, tape: Tape, spin: sp.Expr) -> sp.Expr:
        """Torque of drive and brake on a wheel that spins on its carrier at so many rad/s."""
        # In one expression: without a brake nothing is left of it.
        against = self.brake * spin / sp.sqrt(spin**2 + BRAKE_SPEED**2)
        return tape.let(self.drive - against)


def wheel_inputs(values: Mapping[str, sp.Expr], wheel: str) -> WheelInputs:
    """Inputs at one wheel among those of a vehicle."""
    names = "drive_torque_{}", "brake_torque_{}", "friction_{}", "road_{}", "road_{}_dot"
    return WheelInputs(*(values[name.format(wheel)] for name in names))
