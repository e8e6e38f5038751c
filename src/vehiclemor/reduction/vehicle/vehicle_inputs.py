"""Inputs of a vehicle by what they do: steering and its derivatives, torques, friction."""

from dataclasses import dataclass

import numpy as np

from vehiclemor.multibody.quantities import OPTIONAL_INPUTS, WHEELS
from vehiclemor.simulation.model import Model

DRIVE, BRAKE, FRICTION = "drive_torque", "brake_torque", "friction"
# Steps of inputs in differences: of torques in N m, of all others.
TORQUE_STEP, INPUT_STEP = 1.0, 1e-5
OPTIONAL = {quantity.name for quantity in OPTIONAL_INPUTS}
KNOWN = {f"{kind}_{wheel}" for kind in (DRIVE, BRAKE, FRICTION) for wheel in WHEELS}


@dataclass(frozen=True)
class VehicleInputs:
    """Names of a vehicle's inputs; steering and its derivatives come first."""

    names: tuple[str, ...]

    @property
    def steering(self) -> int:
        """How many inputs are the steering and its derivatives."""
        return sum(name not in OPTIONAL for name in self.names)

    @property
    def torques(self) -> bool:
        """Whether drive or brakes are inputs."""
        return any(name.startswith((DRIVE, BRAKE)) for name in self.names)

    @property
    def steps(self) -> np.ndarray:
        """Steps (inputs,) of differences."""
        torque = [name.startswith((DRIVE, BRAKE)) for name in self.names]
        return np.where(torque, TORQUE_STEP, INPUT_STEP)

    def left_torque(self, left: str, right: str) -> np.ndarray:
        """Inputs (inputs,) by which the left wheel has 1 N m of drive more, and no more in sum."""
        change = np.zeros(len(self.names))
        for wheel, half in ((left, 0.5), (right, -0.5)):
            drive, brake = self.of_wheel(DRIVE, wheel), self.of_wheel(BRAKE, wheel)
            if drive is not None:
                change[drive] = half
            elif brake is not None:
                change[brake] = -half
        return change

    def of_wheel(self, kind: str, wheel: str) -> int | None:
        """Index of an input at a wheel, if it is one."""
        name = f"{kind}_{wheel}"
        return self.names.index(name) if name in self.names else None


def unknown_input(model: Model) -> str:
    """Why the inputs are not a steering with its derivatives, torques and friction; else empty."""
    first, *others = (name for name in model.inputs if name not in KNOWN)
    if driven := [name for name in others if name in OPTIONAL]:
        return f"it reduces vehicles on an even road; this one is driven by {driven[0]} too"
    if others != [f"{first}_dot", f"{first}_ddot"][: len(others)]:
        return f"the inputs of {model.name} are not a steering and its derivatives"
    return ""
