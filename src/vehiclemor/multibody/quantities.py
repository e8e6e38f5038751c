"""Named quantities of models: coordinates, speeds, inputs and outputs, without any symbols.

Chassis frame of the vehicles: origin at the centre of mass of the sprung body, x forward, y left,
z up (ISO 8855).  The road is the plane z = 0.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """Name, SI unit and meaning of one coordinate, input or output."""

    name: str
    unit: str
    long_name: str


# Front left, front right, rear left, rear right.
WHEELS = ("FL", "FR", "RL", "RR")

CHASSIS_COORDINATES = (
    Quantity("X", "m", "position of the sprung body's centre of mass in x"),
    Quantity("Y", "m", "position of the sprung body's centre of mass in y"),
    Quantity("Z", "m", "height of the sprung body's centre of mass above the road"),
    Quantity("psi", "rad", "yaw angle, positive to the left"),
    Quantity("theta", "rad", "pitch angle, nose down positive"),
    Quantity("phi", "rad", "roll angle, right side down positive"),
)
CHASSIS_SPEEDS = (
    Quantity("u", "m/s", "longitudinal velocity, chassis component"),
    Quantity("v", "m/s", "lateral velocity, chassis component"),
    Quantity("w", "m/s", "vertical velocity, chassis component"),
    Quantity("p", "rad/s", "roll velocity, chassis component"),
    Quantity("q_y", "rad/s", "pitch velocity, chassis component"),
    Quantity("r", "rad/s", "yaw velocity, chassis component"),
)
CHASSIS_OUTPUTS = (
    Quantity("longitudinal_position", "m", "X"),
    Quantity("lateral_position", "m", "Y"),
    Quantity("yaw", "rad", "yaw angle"),
    Quantity("pitch", "rad", "pitch angle, nose down positive"),
    Quantity("roll", "rad", "roll angle, right side down positive"),
    Quantity("longitudinal_speed", "m/s", "longitudinal velocity, chassis component"),
    Quantity("lateral_speed", "m/s", "lateral velocity, chassis component"),
    Quantity("vertical_speed", "m/s", "vertical velocity, chassis component"),
    Quantity("yaw_rate", "rad/s", "yaw velocity, chassis component"),
)


def per_wheel(name: str, unit: str, long_name: str) -> tuple[Quantity, ...]:
    """One quantity for each wheel; the wheel's name fills the braces in the meaning."""
    return tuple(Quantity(f"{name}_{w}", unit, long_name.format(w)) for w in WHEELS)


TIRE_OUTPUTS = (
    *per_wheel("Fx", "N", "longitudinal force on the {} tire"),
    *per_wheel("Fy", "N", "lateral force on the {} tire"),
    *per_wheel("Fz", "N", "vertical load of the {} tire"),
    *per_wheel("Mz", "N m", "aligning moment on the {} tire"),
    *per_wheel("slip_ratio", "1", "longitudinal slip of the {} tire"),
    *per_wheel("slip_angle", "rad", "slip angle of the {} tire, sliding left positive"),
)
# Outputs that are zero where a wheel has left the road.
TIRE_LOADS = tuple(f"Fz_{wheel}" for wheel in WHEELS)
# Bounds beyond which the models mean nothing: of the longitudinal speed, and of the attitude.
FORWARD = (0.5, math.inf)
UPRIGHT = {"roll": (-1.2, 1.2), "pitch": (-1.2, 1.2)}
