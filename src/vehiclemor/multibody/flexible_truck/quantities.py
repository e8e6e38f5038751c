"""Inputs, ports, outputs and parameters of the flexible truck by name.

Places have coordinates x forward, y left and z up from the middle of the front axle (ISO 8855).
"""

from vehiclemor.multibody import vehicle_parameters as shared
from vehiclemor.multibody.quantities import WHEELS, Quantity, per_wheel
from vehiclemor.parameters import Declared, point

# Excess beyond shortest or longest length, in mm, at which the stops' force is a parameter.
STOP_TABLE = (10, 20, 30, 40, 50)
ENDS = ("front", "rear")
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

_SHEET = Declared("m", above=0.0, at_most=0.1)
_FORCE = Declared("N", at_least=0.0, at_most=1e7)
_PROGRESSION = Declared("N/m^2", at_least=0.0, at_most=1e9)
_DEGRESSION = Declared("s/m", at_least=0.0, at_most=1e3)
_PLACE = Declared("m", at_least=-20.0, at_most=20.0)


def _each(declared: Declared, *names: str) -> dict[str, Declared]:
    return dict.fromkeys(names, declared)


def _both(declared: Declared, *names: str) -> dict[str, Declared]:
    """Parameters of the front axle and of the rear axle."""
    return {f"{end}_{name}": declared for name in names for end in ENDS}


PARAMETERS = {
    "gravity": shared.GRAVITY,
    "sprung_mass": shared.MASS,
    **_each(shared.INERTIA, "roll_inertia", "pitch_inertia", "yaw_inertia"),
    **_each(shared.LENGTH, "sprung_distance", "wheelbase", "wheel_offset"),
    "sprung_height": _PLACE,
    "driver": point(),
    **_both(shared.MASS, "axle_mass"),
    **_both(shared.INERTIA, "axle_inertia"),
    **_both(shared.STIFFNESS, "spring_stiffness"),
    **_both(_PROGRESSION, "spring_progression"),
    **_both(shared.LENGTH, "spring_offset", "damper_offset", "free_length"),
    **_each(shared.LENGTH, "shortest_length", "longest_length"),
    **_each(_FORCE, *(f"stop_force_{excess}_mm" for excess in STOP_TABLE)),
    **_each(shared.DAMPING, "bump_damping", "rebound_damping"),
    **_each(_DEGRESSION, "bump_degression", "rebound_degression"),
    "tire_stiffness": shared.STIFFNESS,
    "tire_damping": shared.DAMPING,
    "modulus": Declared("N/m^2", above=0.0, at_most=1e18),
    "poisson_ratio": Declared("1", at_least=0.0, at_most=0.49),
    "density": Declared("kg/m^3", above=0.0, at_most=1e5),
    "rail_spacing": shared.LENGTH,
    "rail_depth": Declared("m", above=0.0, at_most=1.0),
    "rail_flange": Declared("m", above=0.0, at_most=0.5),
    "cross_width": Declared("m", above=0.0, at_most=0.5),
    **_each(_SHEET, "rail_thickness", "cross_thickness"),
    **_each(shared.LENGTH, "front_overhang", "frame_length", "gearbox_distance"),
    "frame_height": _PLACE,
    "cab_mass": shared.MASS,
    **_each(shared.INERTIA, "cab_roll_inertia", "cab_pitch_inertia", "cab_yaw_inertia"),
    **_each(_PLACE, "cab_place", "cab_height"),
    "cab_mount_distance": shared.LENGTH,
    "cab_mount_stiffness": shared.STIFFNESS,
    "cab_mount_damping": shared.DAMPING,
    **_each(shared.LENGTH, "platform_front", "platform_rear", "platform_width"),
    "platform_height": _PLACE,
    "frame_damping_ratio": Declared("1", at_least=0.0, at_most=1.0),
    "frame_damping_frequency": Declared("Hz", above=0.0, at_most=1e4),
    "hold_frequency": Declared("Hz", above=0.0, at_most=0.05),
    "payload": Declared("kg", at_least=0.0, at_most=5000.0),
    "elements_per_bay": Declared("1", at_least=1.0, at_most=64.0),
    "shell_size": Declared("m", at_least=0.0, at_most=0.5),
}
