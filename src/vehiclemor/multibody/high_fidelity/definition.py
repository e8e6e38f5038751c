"""High-fidelity vehicle: 26 coordinates, 12 constraints (DAE), Fiala tires, prescribed rack.

Masoudi, Uchida, McPhee (2015), section 3.3 and figure 8: double-wishbone front suspension and
trailing-arm rear suspension.   Axes: ISO 8855, road z = 0.

Static equilibrium: the springs are as long as it takes for the design position of all joints to be
the equilibrium, as a workshop would set the ride height; height and pitch follow from the
deflections of the tires.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.definition import Derivative, ModelDefinition
from vehiclemor.multibody.double_wishbone.definition import POINTS, check_linkage, tie_rod_angles
from vehiclemor.multibody.quantities import (
    VALIDITY,
    VEHICLE,
    WHEELS,
    check_moments,
    declared,
    equations_of,
    error_bounds,
)

COORDINATES = 26
# Places of z and theta among the coordinates, of those of the front corners, of the arms that carry
# the springs (lower arms in front, trailing arms behind), and of the wheels' spins.
HEIGHT, PITCH = 2, 4
CORNER = (range(6, 13), range(13, 20))
ARMS = (10, 17, 20, 21)
SPINS = (22, 23, 24, 25)
# Accelerations (m/s^2, rad/s^2) below which nothing moves; rounding alone gives a tenth of it.
AT_REST = 1e-9
MOST_ITERATIONS = 30
# Free lengths of the springs (m), with which the design position is the equilibrium.
SOLVED = ("front_free_length", "rear_free_length")


def wheelbase(p: Mapping[str, Any]) -> float:
    """Distance of the axles in m."""
    front, rear = wheel_places(p)
    return front[0] - rear[0]


DECLARED = declared("high_fidelity_vehicle")


def check(p: Mapping[str, Any]) -> None:
    """Raise `GeometryError` if the vehicle can't be assembled, or can't stand on its wheels."""
    check_linkage({name: p[name] for name in POINTS})
    wheels = wheel_places(p)
    for name in ("chassis_centre", "front_frame_origin"):
        if p[name][1] != 0.0:
            raise GeometryError(
                f"{name} lies {p[name][1]:g} m beside the midplane: both sides are mirror images"
            )
    for name, centre in zip(("front", "rear"), wheels, strict=True):
        if centre[1] <= 0.0:
            raise GeometryError(f"the left {name} wheel lies on the right side of the vehicle")
    if p["smallest_friction"] > p["largest_friction"]:
        raise GeometryError("smallest_friction is above largest_friction: friction falls with slip")
    _check_inertia(p)
    if wheels[0][0] <= wheels[1][0]:
        raise GeometryError("the vehicle can't stand: its front wheels are not ahead of the rear")
    for name in ("front", "rear"):
        if np.linalg.norm(p[f"{name}_spring_arm_point"] - p[f"{name}_spring_chassis_point"]) < 1e-6:
            raise GeometryError(f"the geometry can't be assembled: the {name} spring has length 0")
    mass, centre = _mass_and_centre(p)
    share = (centre - wheels[1][0]) / (wheels[0][0] - wheels[1][0])
    for name, part in (("front", share), ("rear", 1.0 - share)):
        if part <= 0.0:
            raise GeometryError(
                f"the vehicle can't stand: its weight lifts the {name} wheels off the ground"
            )
        if part * mass * p["gravity"] / 2.0 >= p["tire_stiffness"] * p["tire_radius"]:
            raise GeometryError(
                f"the vehicle can't stand: its weight presses the {name} tires flat "
                f"(tire_stiffness is too small)"
            )


def _check_inertia(p: Mapping[str, Any]) -> None:
    """Raise `GeometryError` if no body can have one of the inertia tensors, see `check_moments`.

    Wheels are let pass: the published moments of a tire about its axis exceed twice those across.
    """
    xy, xz, yz = p["rear_arm_inertia_products"]
    xx, yy, zz = p["rear_arm_inertia"]
    arm = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    for name in ("chassis_inertia", "upper_arm_inertia", "lower_arm_inertia", "carrier_inertia"):
        check_moments(name, p[name])
    check_moments("rear_arm_inertia", np.linalg.eigvalsh(arm))
    across = p["tie_rod_transverse_inertia"]
    check_moments("tie_rod_axial_inertia", np.array([p["tie_rod_axial_inertia"], across, across]))


def wheel_places(p: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Design positions of the left wheel centres, front and rear, chassis frame, in m."""
    origin = p["chassis_centre"]
    return p["wheel_centre"] + p["front_frame_origin"] - origin, p["rear_wheel_centre"] - origin


def _mass_and_centre(p: Mapping[str, Any]) -> tuple[float, float]:
    """Mass of the vehicle in kg and x of its centre of mass in the chassis in m."""
    front = p["front_frame_origin"][0] - p["chassis_centre"][0]
    rear = p["rear_wheel_centre"][0] - p["chassis_centre"][0]
    tie_rod = (p["tie_rod_inner"][0] + p["tie_rod_outer"][0]) / 2.0
    parts = [
        (p["chassis_mass"], 0.0),
        (2 * p["upper_arm_mass"], front + p["upper_arm_centre"][0]),
        (2 * p["lower_arm_mass"], front + p["lower_arm_centre"][0]),
        (2 * p["carrier_mass"], front + p["carrier_centre"][0]),
        (2 * p["tie_rod_mass"], front + tie_rod),
        (2 * p["front_wheel_mass"], front + p["wheel_centre"][0]),
        (2 * p["rear_arm_mass"], rear + p["rear_arm_centre"][0]),
        (2 * p["rear_wheel_mass"], rear),
    ]
    mass = sum(part for part, _ in parts)
    return mass, sum(part * x for part, x in parts) / mass


def design_state(p: Mapping[str, Any], height: float, pitch: float) -> np.ndarray:
    """State (52,) at rest with all joints at their design position."""
    x = np.zeros(2 * COORDINATES)
    x[HEIGHT], x[PITCH] = height, pitch
    inner, outer = p["tie_rod_inner"], p["tie_rod_outer"]
    mirror = np.array([1.0, -1.0, 1.0])
    x[CORNER[0][5:]] = tie_rod_angles(inner, outer)
    x[CORNER[1][5:]] = tie_rod_angles(mirror * inner, mirror * outer, side=-1)
    return x


def solve_equilibrium(p: Mapping[str, Any], derivative: Derivative) -> dict[str, float]:
    """Free lengths of the springs, height and pitch at which nothing accelerates.

    Newton's method on the accelerations of height, pitch, lower arm and rear arm, which are linear
    in the free lengths.  `GeometryError` if that leaves the wheels off the ground.
    """
    front, _ = wheel_places(p)
    mass, _ = _mass_and_centre(p)
    deflection = mass * p["gravity"] / (4.0 * p["tire_stiffness"])
    lengths = [
        float(np.linalg.norm(p[f"{end}_spring_chassis_point"] - p[f"{end}_spring_arm_point"]))
        for end in ("front", "rear")
    ]
    unknown = np.array([p["tire_radius"] - deflection - front[2], 0.0, *lengths])
    x, nothing = design_state(p, 0.0, 0.0), np.zeros(3)

    def accelerations(values: np.ndarray) -> np.ndarray:
        x[HEIGHT], x[PITCH] = values[:2]
        change = derivative(list(values[2:]), x, nothing)[COORDINATES:]
        return change[[HEIGHT, PITCH, ARMS[0], ARMS[2]]]

    residual, moved = accelerations(unknown), np.inf
    for _ in range(MOST_ITERATIONS):
        steps = 1e-6 * np.eye(4)
        jacobian = np.column_stack(
            [(accelerations(unknown + h) - accelerations(unknown - h)) / 2e-6 for h in steps]
        )
        if not np.isfinite(jacobian).all() or np.linalg.cond(jacobian) > 1e15:
            break
        change = np.linalg.solve(jacobian, residual)
        # A long step would lift wheels off the ground, where there is no slope to follow.
        change *= min(1.0, deflection / max(np.abs(change[:2]).max(), 1e-300))
        unknown, moved = unknown - change, np.abs(change).max()
        residual = accelerations(unknown)
        if moved < 1e-14 * max(1.0, np.abs(unknown).max()):
            break
    if not np.abs(residual).max() < AT_REST * p["gravity"]:
        raise GeometryError(
            "the vehicle can't stand: no free lengths of its springs hold it at its design "
            f"position (accelerations up to {np.abs(residual).max():.2g} are left)"
        )
    names = ("height", "pitch", *SOLVED)
    return dict(zip(names, map(float, unknown), strict=True))


# Parameters, and those that `solve_equilibrium` solves for.
def starts(p: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Initial states (52,) by name: straight running, and the same dropped onto the road."""
    equilibrium = design_state(p, p["height"], p["pitch"])
    equilibrium[COORDINATES] = p["initial_speed"]
    up = np.array([-np.sin(p["pitch"]), 0.0, np.cos(p["pitch"])])
    radii = [p["height"] + float(up @ wheel) for wheel in wheel_places(p)]
    equilibrium[COORDINATES + np.array(SPINS)] = p["initial_speed"] / np.repeat(radii, 2)
    dropped = equilibrium.copy()
    dropped[HEIGHT] += p["drop_height"]
    dropped[PITCH] += p["drop_pitch"]
    return {"equilibrium": equilibrium, "dropped": dropped}


STATES = [q.name for q in (*DECLARED["coordinates"], *DECLARED["speeds"])]
DEFINITION = ModelDefinition(
    name="high_fidelity_vehicle",
    kind="dae",
    summary="vehicle with 26 coordinates and 12 constraints, double wishbones, Fiala tires (DAE)",
    maneuver="rack_lane_change",
    **DECLARED,
    **VEHICLE,
    derive=equations_of("high_fidelity"),
    check=check,
    starts=starts,
    solved=SOLVED,
    solve_equilibrium=solve_equilibrium,
    cyclic=("x", "y", *(f"gamma_{wheel}" for wheel in WHEELS)),
    planar=("x", "y", "psi"),
    heading_pairs=(("x", "y"), ("x_dot", "y_dot")),
    # A heading that is off integrates to a lateral position that is off: no other error matters
    # as much.
    error_scale=dict.fromkeys(STATES, 10.0) | {"psi": 1.0, "psi_dot": 1.0},
    # Slips need forward motion.  At 1.3 rad of steering the linkage locks; another branch lies
    # beyond.
    validity=VALIDITY | {f"steer_{wheel}": (-1.1, 1.1) for wheel in WHEELS[:2]},
    error_bounds=error_bounds(2.5e-4),
    wheelbase=wheelbase,
    tabled_outputs=(
        "lateral_speed",
        "vertical_speed",
        "lateral_position",
        "yaw",
        "roll",
        "position_drift",
        "velocity_drift",
    ),
)
