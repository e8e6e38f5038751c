"""High-fidelity vehicle: 26 coordinates, 12 constraints (DAE), Fiala tires, prescribed rack.

Masoudi, Uchida, McPhee (2015), section 3.3 and figure 8: double-wishbone front suspension and
trailing-arm rear suspension.  Its equations are derived in `high_fidelity_equations.py`; what a
study needs to know of the model stands here, without symbols.  Axes: ISO 8855, road z = 0.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.models.double_wishbone import points as double_wishbone_points
from vehiclemor.models.high_fidelity import equilibrium as vehicle_equilibrium
from vehiclemor.models.quantities import (
    CHASSIS_COORDINATES,
    CHASSIS_OUTPUTS,
    WHEELS,
    Quantity,
    per_wheel,
)
from vehiclemor.parameters import Declared, point

if TYPE_CHECKING:
    from vehiclemor.models.equations import DynamicEquations

NAME = "high_fidelity_vehicle"
KIND = "dae"
SUMMARY = "vehicle with 26 coordinates and 12 constraints, double wishbones, Fiala tires (DAE)"
MANEUVER = "rack_lane_change"
FRONT = WHEELS[:2]

_JOINTS = (
    ("zeta", "first 3-2-1 Euler angle of the {} wheel carrier on the chassis (about z)"),
    ("eta", "second 3-2-1 Euler angle of the {} wheel carrier on the chassis (about y)"),
    ("xi", "third 3-2-1 Euler angle of the {} wheel carrier on the chassis (about x)"),
    ("theta_u", "rotation of the {} upper control arm"),
    ("theta_l", "rotation of the {} lower control arm"),
    ("alpha", "rotation of the {} tie rod's universal joint about z"),
    ("beta", "rotation of the {} tie rod's universal joint about the rotated x axis"),
)
COORDINATES = (
    Quantity("x", "m", "position of the chassis' centre of mass in x"),
    Quantity("y", "m", "position of the chassis' centre of mass in y"),
    Quantity("z", "m", "height of the chassis' centre of mass above the road"),
    *CHASSIS_COORDINATES[3:],
    *(Quantity(f"{name}_{w}", "rad", text.format(w)) for w in FRONT for name, text in _JOINTS),
    *(Quantity(f"a_{w}", "rad", f"angle of the {w} trailing arm, wheel up") for w in WHEELS[2:]),
    *(Quantity(f"gamma_{w}", "rad", f"spin angle of the {w} wheel") for w in WHEELS),
)
SPEEDS = tuple(
    Quantity(f"{q.name}_dot", f"{q.unit}/s", f"rate of the {q.long_name}") for q in COORDINATES
)
INPUTS = (
    Quantity("s", "m", "displacement of the steering rack, positive to the left"),
    Quantity("s_dot", "m/s", "velocity of the steering rack"),
    Quantity("s_ddot", "m/s^2", "acceleration of the steering rack"),
)
OUTPUTS = (
    *CHASSIS_OUTPUTS[:7],
    Quantity("vertical_speed", "m/s", "vertical velocity of the chassis' centre of mass"),
    Quantity("yaw_rate", "rad/s", "yaw velocity, chassis component"),
    *per_wheel("Fx", "N", "longitudinal force on the {} tire"),
    *per_wheel("Fy", "N", "lateral force on the {} tire"),
    *per_wheel("Fz", "N", "vertical load of the {} tire"),
    *per_wheel("Mz", "N m", "aligning moment on the {} tire"),
    *per_wheel("slip_ratio", "1", "longitudinal slip of the {} tire"),
    *per_wheel("slip_angle", "rad", "slip angle of the {} tire, sliding left positive"),
    *(
        Quantity(f"steer_{w}", "rad", f"angle of the {w} wheel, positive to the left")
        for w in FRONT
    ),
    Quantity("position_drift", "m", "violation of the 12 constraints, Euclidean norm"),
    Quantity("velocity_drift", "m/s", "rate of violation of the 12 constraints, Euclidean norm"),
)
CONSTRAINTS = tuple(
    Quantity(f"{joint}_{axis}_{w}", "m", f"closure of the {w} {text} in {axis}")
    for w in FRONT
    for joint, text in (("lower_ball_joint", "lower ball joint"), ("tie_rod", "tie rod"))
    for axis in "xyz"
)
# The right-hand side does not depend on them; it turns with the heading.
CYCLIC = ("x", "y", *(f"gamma_{wheel}" for wheel in WHEELS))
HEADING = ("psi", (("x", "y"), ("x_dot", "y_dot")))
# Position on the road and heading: all else moves as the same wherever the vehicle is.
PLANAR = ("x", "y", "psi")
# Magnitudes below which errors count absolutely.  A heading that is off integrates to a lateral
# position that is off: no other error matters as much.
TYPICAL = dict.fromkeys([q.name for q in (*COORDINATES, *SPEEDS)], 10.0) | {
    "psi": 1.0,
    "psi_dot": 1.0,
}
# Slips need forward motion.  At 1.3 rad of steering the linkage locks; another branch lies beyond.
VALIDITY = {
    "longitudinal_speed": (0.5, np.inf),
    **{f"steer_{wheel}": (-1.1, 1.1) for wheel in FRONT},
    "roll": (-1.2, 1.2),
    "pitch": (-1.2, 1.2),
}
LOADS = tuple(f"Fz_{wheel}" for wheel in WHEELS)


def _mass() -> Declared:
    return Declared("kg", above=0.0, at_most=1e5)


def _inertia(size: int = 1) -> Declared:
    return Declared("kg m^2", size=size, above=0.0, at_most=1e6)


PARAMETERS = {
    "gravity": Declared("m/s^2", above=0.0, at_most=100.0),
    "baumgarte_a": Declared("1/s", at_least=0.0, at_most=1e4),
    "baumgarte_b": Declared("1/s", at_least=0.0, at_most=1e4),
    # The stiffness of the slips goes as one over the speed: at a slower pace the explicit reference
    # runs into its limit of calls.
    "initial_speed": Declared("m/s", at_least=3.0, at_most=150.0),
    "front_frame_origin": point(),
    "rear_wheel_centre": point(),
    "chassis_centre": point(),
    "chassis_mass": _mass(),
    "chassis_inertia": _inertia(3),
    **double_wishbone_points.POINTS,
    "front_spring_chassis_point": point(),
    "front_spring_arm_point": point(),
    "upper_arm_mass": _mass(),
    "upper_arm_centre": point(),
    "upper_arm_inertia": _inertia(3),
    "lower_arm_mass": _mass(),
    "lower_arm_centre": point(),
    "lower_arm_inertia": _inertia(3),
    "carrier_mass": _mass(),
    "carrier_centre": point(),
    "carrier_inertia": _inertia(3),
    "tie_rod_mass": _mass(),
    "tie_rod_transverse_inertia": _inertia(),
    "tie_rod_axial_inertia": _inertia(),
    "front_wheel_mass": _mass(),
    "front_wheel_spin_inertia": _inertia(),
    "front_wheel_transverse_inertia": _inertia(),
    "front_stiffness": Declared("N/m", above=0.0),
    "front_damping": Declared("N s/m", at_least=0.0),
    "rear_arm_pivot": point(),
    "rear_arm_mass": _mass(),
    "rear_arm_centre": point(),
    "rear_arm_inertia": _inertia(3),
    "rear_arm_inertia_products": Declared("kg m^2", size=3, at_least=-1e6, at_most=1e6),
    "rear_wheel_mass": _mass(),
    "rear_wheel_spin_inertia": _inertia(),
    "rear_wheel_transverse_inertia": _inertia(),
    "rear_spring_chassis_point": point(),
    "rear_spring_arm_point": point(),
    "rear_stiffness": Declared("N/m", above=0.0),
    "rear_damping": Declared("N s/m", at_least=0.0),
    "tire_radius": Declared("m", above=0.0, at_most=20.0),
    "tire_stiffness": Declared("N/m", above=0.0),
    "tire_damping": Declared("N s/m", at_least=0.0),
    "longitudinal_slip_stiffness": Declared("N", above=0.0),
    "cornering_stiffness": Declared("N/rad", above=0.0),
    "largest_friction": Declared("1", at_least=0.0, at_most=10.0),
    "smallest_friction": Declared("1", at_least=0.0, at_most=10.0),
    "tire_width": Declared("m", at_least=0.0, at_most=5.0),
    "slip_speed": Declared("m/s", above=0.0, at_most=10.0),
    "drop_height": Declared("m", at_least=-0.05, at_most=1.0),
    "drop_pitch": Declared("rad", at_least=-0.5, at_most=0.5),
}
# Free lengths of the springs (m), with which the design position is the equilibrium.
SOLVED = ("front_free_length", "rear_free_length")


def check(p: Mapping[str, Any]) -> None:
    """Raise `GeometryError` if the vehicle can't be assembled or can't stand on its wheels."""
    vehicle_equilibrium.check_vehicle(p)


def settle(p: Mapping[str, Any], derivative: vehicle_equilibrium.Derivative) -> dict[str, float]:
    """Free lengths of the springs (the kernels' parameters `SOLVED`), height and pitch at rest.

    Parameters
    ----------
    derivative
        (values of `SOLVED`, x, u) -> time derivative of x.
    """
    return vehicle_equilibrium.settled(p, derivative)


def starts(p: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Initial states (52,) by name, from the parameters and what `settle` has found."""
    return vehicle_equilibrium.initial_states(p)


def derive() -> "DynamicEquations":
    """Derive accelerations, outputs, and the unsolved descriptor form; parameters stay symbols."""
    from vehiclemor.models.high_fidelity import equations as high_fidelity_equations

    return high_fidelity_equations.derive()
