"""Coordinates, speeds, inputs, outputs and parameters of the 14-DOF vehicle by name."""

from vehiclemor.models.components.tire_coefficients import MAGIC_FORMULA
from vehiclemor.models.quantities import (
    CHASSIS_COORDINATES,
    CHASSIS_OUTPUTS,
    CHASSIS_SPEEDS,
    TIRE_OUTPUTS,
    WHEELS,
    Quantity,
)
from vehiclemor.models.vehicle_parameters import (
    DAMPING,
    DROP,
    GRAVITY,
    INERTIA,
    LENGTH,
    MASS,
    SLIP_SPEED,
    STIFFNESS,
    TIRE,
    initial_speed,
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
    "gravity": GRAVITY,
    "sprung_mass": MASS,
    "unsprung_mass": Declared("kg", above=0.0, at_most=1e4),
    "roll_inertia": INERTIA,
    "pitch_inertia": INERTIA,
    "whole_car_yaw_inertia": INERTIA,
    "product_of_inertia": Declared("kg m^2", at_least=-1e5, at_most=1e5),
    "front_axle_distance": LENGTH,
    "rear_axle_distance": LENGTH,
    "front_track": LENGTH,
    "rear_track": LENGTH,
    "sprung_height": LENGTH,
    "front_stiffness": STIFFNESS,
    "rear_stiffness": STIFFNESS,
    "front_damping": DAMPING,
    "rear_damping": DAMPING,
    **TIRE,
    "spin_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "diametral_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "slip_speed": SLIP_SPEED,
    "nominal_load": Declared("N", above=0.0),
    "load_scale": Declared("1", above=0.0),
    **{name: Declared("1") for name in MAGIC_FORMULA},
    # Below walking pace the slip of a rolling wheel has no meaning.
    "initial_speed": initial_speed(slowest=1.0),
    **DROP,
}
