"""Coordinates, speeds, inputs, outputs and parameters of the 14-DOF vehicle by name."""

from vehiclemor.multibody import vehicle_parameters as shared
from vehiclemor.multibody.components.tire_coefficients import MAGIC_FORMULA
from vehiclemor.multibody.quantities import (
    CHASSIS_COORDINATES,
    CHASSIS_OUTPUTS,
    CHASSIS_SPEEDS,
    TIRE_OUTPUTS,
    WHEELS,
    Quantity,
)
from vehiclemor.parameters import Declared

# Of the wheels in order.
FRONT = (True, True, False, False)
LEFT = (True, False, True, False)
COORDINATES = (
    *CHASSIS_COORDINATES,
    *(Quantity(f"z_{w}", "m", f"travel of the {w} wheel, compression positive") for w in WHEELS),
    *(Quantity(f"gamma_{w}", "rad", f"spin angle of the {w} wheel") for w in WHEELS),
)
SPEEDS = (
    *CHASSIS_SPEEDS,
    *(Quantity(f"zdot_{w}", "m/s", f"rate of travel of the {w} wheel") for w in WHEELS),
    *(Quantity(f"omega_{w}", "rad/s", f"spin of the {w} wheel on its carrier") for w in WHEELS),
)
INPUTS = (Quantity("delta", "rad", "steering angle of both front wheels, positive to the left"),)
OUTPUTS = (*CHASSIS_OUTPUTS, *TIRE_OUTPUTS)
PARAMETERS = {
    "gravity": shared.GRAVITY,
    "sprung_mass": shared.MASS,
    "unsprung_mass": Declared("kg", above=0.0, at_most=1e4),
    "roll_inertia": shared.INERTIA,
    "pitch_inertia": shared.INERTIA,
    "whole_car_yaw_inertia": shared.INERTIA,
    "product_of_inertia": Declared("kg m^2", at_least=-1e5, at_most=1e5),
    "front_axle_distance": shared.LENGTH,
    "rear_axle_distance": shared.LENGTH,
    "front_track": shared.LENGTH,
    "rear_track": shared.LENGTH,
    "sprung_height": shared.LENGTH,
    "front_stiffness": shared.STIFFNESS,
    "rear_stiffness": shared.STIFFNESS,
    "front_damping": shared.DAMPING,
    "rear_damping": shared.DAMPING,
    **shared.TIRE,
    "spin_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "diametral_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "slip_speed": shared.SLIP_SPEED,
    "nominal_load": shared.LOAD,
    "load_scale": Declared("1", above=0.0, at_most=100.0),
    **dict.fromkeys(MAGIC_FORMULA, shared.TIRE_COEFFICIENT),
    # Below walking pace the slip of a rolling wheel has no meaning.
    "initial_speed": shared.initial_speed(slowest=1.0),
    **shared.DROP,
}
