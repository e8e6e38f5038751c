"""Inputs, ports, outputs and parameters of the flexible truck by name.

Places have coordinates x forward, y left and z up from the middle of the front axle (ISO 8855).
"""

from vehiclemor.multibody import vehicle_parameters as shared
from vehiclemor.multibody.quantities import TIRE_LOADS, WHEELS, Quantity, per_wheel
from vehiclemor.parameters import Declared, point

# Excess beyond shortest or longest length, in mm, at which the stops' force is a parameter.
STOP_TABLE = (10, 20, 30, 40, 50)
# Two rails, two flanges, five bays.
STRAINS = 20

INPUTS = (
    *per_wheel("road", "m", "height of the road under the {} wheel"),
    *(Quantity(f"road_{w}_dot", "m/s", f"rate of the road's height, {w} wheel") for w in WHEELS),
)
PORTS = (
    *per_wheel("spring", "m", "compression of the {} spring"),
    *per_wheel("damper", "m", "compression of the {} damper"),
    *per_wheel("tire", "m", "height of the {} wheel above its place without load"),
)
_PLACES = {
    "driver": "the driver's place",
    **{f"platform_{w}": f"the platform's corner {w}" for w in WHEELS},
}
OUTPUTS = (
    *(
        Quantity(f"{name}_{kind}", unit, f"{kind} of {place}, upward, about the static state")
        for kind, unit in (("height", "m"), ("speed", "m/s"), ("acceleration", "m/s^2"))
        for name, place in _PLACES.items()
    ),
    Quantity("pitch", "rad", "pitch angle of the frame between the axles, nose down positive"),
    Quantity("roll", "rad", "roll angle of the frame, mean at the axles, right side down positive"),
    Quantity("twist", "rad", "roll angle of the frame at the front axle less that at the rear"),
    *per_wheel("deflection", "m", "compression of the {} spring, about the static state"),
    *per_wheel("Fz", "N", "vertical load of the {} tire"),
    *(
        Quantity(f"strain_{k + 1}", "1", f"axial strain of the rails' flanges at place {k + 1}")
        for k in range(STRAINS)
    ),
)
LOADS = TIRE_LOADS

_SHEET = Declared("m", above=0.0, at_most=0.1)
_FORCE = Declared("N", at_least=0.0, at_most=1e7)
_DEGRESSION = Declared("s/m", at_least=0.0, at_most=1e3)
_PLACE = Declared("m", at_least=-20.0, at_most=20.0)
_ENDS = ("front", "rear")

PARAMETERS = {
    "gravity": shared.GRAVITY,
    "sprung_mass": shared.MASS,
    "roll_inertia": shared.INERTIA,
    "pitch_inertia": shared.INERTIA,
    "yaw_inertia": shared.INERTIA,
    "sprung_distance": shared.LENGTH,
    "sprung_height": _PLACE,
    "wheelbase": shared.LENGTH,
    "wheel_offset": shared.LENGTH,
    "driver": point(),
    **{f"{end}_axle_mass": shared.MASS for end in _ENDS},
    **{f"{end}_axle_inertia": shared.INERTIA for end in _ENDS},
    **{f"{end}_spring_stiffness": shared.STIFFNESS for end in _ENDS},
    **{f"{end}_spring_progression": Declared("N/m^2", at_least=0.0, at_most=1e9) for end in _ENDS},
    **{f"{end}_spring_offset": shared.LENGTH for end in _ENDS},
    **{f"{end}_damper_offset": shared.LENGTH for end in _ENDS},
    **{f"{end}_free_length": shared.LENGTH for end in _ENDS},
    "shortest_length": shared.LENGTH,
    "longest_length": shared.LENGTH,
    **{f"stop_force_{excess}_mm": _FORCE for excess in STOP_TABLE},
    "bump_damping": shared.DAMPING,
    "bump_degression": _DEGRESSION,
    "rebound_damping": shared.DAMPING,
    "rebound_degression": _DEGRESSION,
    "tire_stiffness": shared.STIFFNESS,
    "tire_damping": shared.DAMPING,
    "modulus": Declared("N/m^2", above=0.0, at_most=1e18),
    "poisson_ratio": Declared("1", at_least=0.0, at_most=0.49),
    "density": Declared("kg/m^3", above=0.0, at_most=1e5),
    "rail_spacing": shared.LENGTH,
    "rail_depth": Declared("m", above=0.0, at_most=1.0),
    "rail_flange": Declared("m", above=0.0, at_most=0.5),
    "rail_thickness": _SHEET,
    "cross_width": Declared("m", above=0.0, at_most=0.5),
    "cross_thickness": _SHEET,
    "front_overhang": shared.LENGTH,
    "frame_length": shared.LENGTH,
    "frame_height": _PLACE,
    "gearbox_distance": shared.LENGTH,
    "cab_mass": shared.MASS,
    "cab_roll_inertia": shared.INERTIA,
    "cab_pitch_inertia": shared.INERTIA,
    "cab_yaw_inertia": shared.INERTIA,
    "cab_place": _PLACE,
    "cab_height": _PLACE,
    "cab_mount_distance": shared.LENGTH,
    "cab_mount_stiffness": shared.STIFFNESS,
    "cab_mount_damping": shared.DAMPING,
    "platform_front": shared.LENGTH,
    "platform_rear": shared.LENGTH,
    "platform_width": shared.LENGTH,
    "platform_height": _PLACE,
    "frame_damping_ratio": Declared("1", at_least=0.0, at_most=1.0),
    "frame_damping_frequency": Declared("Hz", above=0.0, at_most=1e4),
    "hold_frequency": Declared("Hz", above=0.0, at_most=0.05),
    "payload": Declared("kg", at_least=0.0, at_most=5000.0),
    "elements_per_bay": Declared("1", at_least=1.0, at_most=64.0),
    "shell_size": Declared("m", at_least=0.0, at_most=0.5),
}
