"""Coordinates, speeds, inputs, outputs, constraints and parameters of the vehicle by name."""

from dataclasses import replace

from vehiclemor.multibody import vehicle_parameters as shared
from vehiclemor.multibody.double_wishbone.points import POINTS
from vehiclemor.multibody.quantities import (
    CHASSIS_COORDINATES,
    CHASSIS_OUTPUTS,
    TIRE_OUTPUTS,
    WHEELS,
    Quantity,
)
from vehiclemor.parameters import Declared, point

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
    *TIRE_OUTPUTS,
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
# Principal moments of a body.
_INERTIAS = replace(shared.INERTIA, size=3)


def _part(name: str) -> dict[str, Declared]:
    return {f"{name}_mass": shared.MASS, f"{name}_centre": point(), f"{name}_inertia": _INERTIAS}


PARAMETERS = {
    "gravity": shared.GRAVITY,
    "baumgarte_a": Declared("1/s", at_least=0.0, at_most=1e4),
    "baumgarte_b": Declared("1/s", at_least=0.0, at_most=1e4),
    # The stiffness of the slips goes as one over the speed: at a slower pace the explicit reference
    # runs into its limit of calls.
    "initial_speed": shared.initial_speed(slowest=3.0),
    "front_frame_origin": point(),
    "rear_wheel_centre": point(),
    "chassis_centre": point(),
    "chassis_mass": shared.MASS,
    "chassis_inertia": _INERTIAS,
    **POINTS,
    "front_spring_chassis_point": point(),
    "front_spring_arm_point": point(),
    **_part("upper_arm"),
    **_part("lower_arm"),
    **_part("carrier"),
    "tie_rod_mass": shared.MASS,
    "tie_rod_transverse_inertia": shared.INERTIA,
    "tie_rod_axial_inertia": shared.INERTIA,
    "front_wheel_mass": shared.MASS,
    "front_wheel_spin_inertia": shared.INERTIA,
    "front_wheel_transverse_inertia": shared.INERTIA,
    "front_stiffness": shared.STIFFNESS,
    "front_damping": shared.DAMPING,
    "rear_arm_pivot": point(),
    **_part("rear_arm"),
    "rear_arm_inertia_products": Declared("kg m^2", size=3, at_least=-1e6, at_most=1e6),
    "rear_wheel_mass": shared.MASS,
    "rear_wheel_spin_inertia": shared.INERTIA,
    "rear_wheel_transverse_inertia": shared.INERTIA,
    "rear_spring_chassis_point": point(),
    "rear_spring_arm_point": point(),
    "rear_stiffness": shared.STIFFNESS,
    "rear_damping": shared.DAMPING,
    **shared.TIRE,
    "longitudinal_slip_stiffness": shared.LOAD,
    "cornering_stiffness": Declared("N/rad", above=0.0, at_most=1e7),
    "largest_friction": Declared("1", at_least=0.0, at_most=10.0),
    "smallest_friction": Declared("1", at_least=0.0, at_most=10.0),
    "tire_width": Declared("m", at_least=0.0, at_most=5.0),
    "slip_speed": shared.SLIP_SPEED,
    **shared.DROP,
}
# Free lengths of the springs (m), with which the design position is the equilibrium.
SOLVED = ("front_free_length", "rear_free_length")
