"""Double-wishbone suspension: kinematics of one front-left corner in 8 joint coordinates (AE).

Masoudi, Uchida, McPhee (2015), section 3.2 and figure 5; joint coordinates after Uchida and McPhee
(2012), Multibody Syst. Dyn. 28(4), 331-347.  Axes: ISO 8855, x forward, y left, z up; the chassis
is fixed.  The inputs are the height of the wheel centre above its design position and the
displacement of the steering rack.
"""

from collections.abc import Mapping

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import ErrorBound, declared, equations_of

# Hard points at the design position, left side.
POINTS = (
    *("upper_arm_front_pivot", "upper_arm_rear_pivot", "upper_ball_joint"),
    *("lower_arm_front_pivot", "lower_arm_rear_pivot", "lower_ball_joint"),
    *("tie_rod_inner", "tie_rod_outer", "wheel_centre"),
)
# What a drawing of the mechanism needs that moves, beside the fixed pivots.
JOINTS = (
    *("upper_ball_joint", "lower_ball_joint", "tie_rod_inner", "tie_rod_outer"),
    *("wheel_centre", "axle_direction"),
)


def tie_rod_angles(inner: np.ndarray, outer: np.ndarray, side: int = 1) -> tuple[float, float]:
    """Angles alpha and beta (rad) of the tie rod's universal joint at the design position."""
    rod = outer - inner
    direction = side * rod / np.linalg.norm(rod)
    return float(np.arctan2(-direction[0], direction[1])), float(np.arcsin(direction[2]))


def check_linkage(points: Mapping[str, np.ndarray]) -> None:
    """Raise `GeometryError` if two joints of one body coincide: nothing could be assembled."""
    rigid_links = {
        "upper arm axis": ("upper_arm_front_pivot", "upper_arm_rear_pivot"),
        "lower arm axis": ("lower_arm_front_pivot", "lower_arm_rear_pivot"),
        "tie rod": ("tie_rod_inner", "tie_rod_outer"),
        "wheel carrier": ("upper_ball_joint", "lower_ball_joint"),
    }
    for link, (start, end) in rigid_links.items():
        if np.linalg.norm(points[end] - points[start]) < 1e-6:
            raise GeometryError(
                f"the geometry can't be assembled: {start} and {end} coincide ({link} of length 0)"
            )
    for arm in ("upper", "lower"):
        rear, front = points[f"{arm}_arm_rear_pivot"], points[f"{arm}_arm_front_pivot"]
        lever = np.cross(front - rear, points[f"{arm}_ball_joint"] - rear)
        if np.linalg.norm(lever) < 1e-6 * np.linalg.norm(front - rear):
            raise GeometryError(
                f"the geometry can't be assembled: {arm}_ball_joint lies on the axis of its arm"
            )


def design_coordinates(points: Mapping[str, np.ndarray]) -> np.ndarray:
    """Coordinates (8,) at the design position: zero, but for the tie rod's universal joint.

    `GeometryError` if two joints of one body coincide.
    """
    check_linkage(points)
    design = np.zeros(8)
    design[5:7] = tie_rod_angles(points["tie_rod_inner"], points["tie_rod_outer"])
    return design


DECLARED = declared("double_wishbone")
DEFINITION = ModelDefinition(
    name="double_wishbone",
    kind="ae",
    summary="double-wishbone suspension, kinematics, 8 joint coordinates (algebraic equations)",
    maneuver="sine_travel",
    **DECLARED,
    joints=JOINTS,
    derive=equations_of("double_wishbone"),
    design_coordinates=design_coordinates,
    # Beyond what a steering does (wheels turn by 0.7 rad, racks move by 0.08 m), and before the
    # cusp of the lower limit: there the wheel has turned by 1.04 rad, and soon turns right round.
    stops={"zeta": 1.0, "s": 0.1},
    # Published errors of its reduced model (paper, section 3.2).
    error_bounds={
        "spindle_y": ErrorBound("rms", 7.57e-5),
        "second_euler_angle": ErrorBound("rms", 2.4e-5),
    },
    tabled_outputs=("spindle_y", "second_euler_angle"),
    main_outputs=("second_euler_angle",),
)
