"""Vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE).

Masoudi, Uchida, McPhee (2015), section 3.1 and figure 1; structure after Sayers and Han (1996), A
generic multibody vehicle model for simulating handling and braking, Veh. Syst. Dyn. 25 (sup1),
599-613: a sprung body, four lumped masses on vertical prismatic joints, four spinning wheels.
Axes: ISO 8855.  Steering is quasi-static: the rate of the steering angle appears nowhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import (
    VALIDITY,
    VEHICLE,
    WHEELS,
    check_moments,
    declared,
    equations_of,
    error_bounds,
)


@dataclass(frozen=True)
class Derived:
    """What follows from the parameters, numbers or symbols; front first where there are two."""

    sprung_distance: tuple[Any, Any]  # Sprung centre of mass to the front and rear axle in m.
    yaw_inertia: Any  # Of the sprung body in kg m^2.
    preload: tuple[Any, Any]  # Static force of a spring in N.
    loaded_radius: tuple[Any, Any]  # Static height of a wheel centre above the road in m.
    depth: tuple[Any, Any]  # Sprung centre of mass above the wheel centres at zero travel in m.


def derived(p: Mapping[str, Any]) -> Derived:
    """Derived parameters of numbers or symbols."""
    mass, corner = p["sprung_mass"], p["unsprung_mass"]
    a, b = p["front_axle_distance"], p["rear_axle_distance"]
    total = mass + 4 * corner
    sprung_a = (total * a - 2 * corner * (a + b)) / mass
    load = (total * p["gravity"] * b / (2 * (a + b)), total * p["gravity"] * a / (2 * (a + b)))
    corners = sum(
        2 * corner * (distance**2 + track**2 / 4)
        for distance, track in ((a, p["front_track"]), (b, p["rear_track"]))
    )
    radius = tuple(p["tire_radius"] - part / p["tire_stiffness"] for part in load)
    return Derived(
        (sprung_a, a + b - sprung_a),
        p["whole_car_yaw_inertia"]
        - corners
        - 4 * p["diametral_inertia"]
        - mass * (a - sprung_a) ** 2,
        (load[0] - corner * p["gravity"], load[1] - corner * p["gravity"]),
        (radius[0], radius[1]),
        (p["sprung_height"] - radius[0], p["sprung_height"] - radius[1]),
    )


def check(p: Mapping[str, Any]) -> None:
    """Raise `GeometryError` if the vehicle can't stand on its four wheels, or be at all."""
    d = derived(p)
    for name, distance in zip(("front", "rear"), d.sprung_distance, strict=True):
        if distance <= 0.0:
            away = "rear" if name == "front" else "front"
            raise GeometryError(
                f"the vehicle can't stand: its sprung mass lies beyond the {name} axle, so that "
                f"the {away} wheels leave the ground"
            )
    for name, radius in zip(("front", "rear"), d.loaded_radius, strict=True):
        if radius <= 0.0:
            raise GeometryError(
                f"the vehicle can't stand: its weight presses the {name} tires flat "
                f"(tire_stiffness is too small)"
            )
    if d.yaw_inertia <= 0.0:
        raise GeometryError(
            f"the sprung body has a yaw inertia of {d.yaw_inertia:.4g} kg m^2: "
            "whole_car_yaw_inertia is smaller than that of the unsprung masses alone"
        )
    xx, yy, xz = p["roll_inertia"], p["pitch_inertia"], p["product_of_inertia"]
    tensor = np.array([[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, d.yaw_inertia]])
    check_moments("sprung body", np.linalg.eigvalsh(tensor))


def wheelbase(p: Mapping[str, Any]) -> float:
    """Distance of the axles in m."""
    return p["front_axle_distance"] + p["rear_axle_distance"]


def starts(p: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Initial states (28,) by name: straight running, and the same dropped onto the road."""
    d, speed = derived(p), float(p["initial_speed"])
    equilibrium = np.zeros(28)
    equilibrium[2] = p["sprung_height"]
    equilibrium[14] = speed
    equilibrium[24:] = speed / np.repeat(d.loaded_radius, 2)
    dropped = equilibrium.copy()
    dropped[2] += p["drop_height"]
    dropped[4] += p["drop_pitch"]
    # The velocity keeps its direction in space.
    dropped[14] = speed * np.cos(dropped[4])
    dropped[16] = speed * np.sin(dropped[4])
    return {"equilibrium": equilibrium, "dropped": dropped}


DECLARED = declared("independent_suspension_vehicle")
DEFINITION = ModelDefinition(
    name="independent_suspension_vehicle",
    kind="ode",
    summary="vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE)",
    maneuver="lane_change",
    **DECLARED,
    **VEHICLE,
    derive=equations_of("independent_suspension"),
    check=check,
    starts=starts,
    cyclic=("X", "Y", *(f"gamma_{wheel}" for wheel in WHEELS)),
    planar=("X", "Y", "psi"),
    # Slip needs forward motion, the contact point lies below the wheel centre.
    # Steering as far as that of the car (CommonRoad, BMW 320i).
    validity=VALIDITY | {"delta": (-1.066, 1.066)},
    error_bounds=error_bounds(7.59e-5),
    wheelbase=wheelbase,
    tabled_outputs=("pitch", "yaw", "roll", "lateral_position", "vertical_speed"),
    main_outputs=("pitch", "yaw", "lateral_position"),
)
