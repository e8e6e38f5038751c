"""Ride of a two-axle truck on a flexible ladder frame: sparse matrices and twelve ports.

M q'' + (W W' + d K) q' + K q = load + B f(w, w', u), w = B' q: small motion about the upright truck
at constant speed, gravity along z.  Masses, springs, dampers and stops are those of Project
Chrono's MAN KAT1 5 t, which has a rigid frame; frame, cab, platform and tires' rates are ours.  The
real frame is closed and stiffer.  Axes: ISO 8855.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.flexible_truck.vehicle import DECLARED, check, structure
from vehiclemor.multibody.quantities import TIRE_LOADS, WHEELS

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

# Travel of the springs in m from end to end of the stops' table: nothing is known beyond.
TRAVEL = 0.37
SMALL_ANGLE = 0.2
# In N: the tire is pressed by its section height, 0.375 m.
LARGEST_LOAD = 100_788.0


def derive() -> Program:
    """Derive the law of the ports; parameters stay symbols."""
    from vehiclemor.multibody.flexible_truck import equations

    return equations.derive()


DEFINITION = ModelDefinition(
    name="flexible_truck",
    kind="structural",
    summary="truck on a flexible ladder frame, beams or shells, ride over rough roads (structural)",
    maneuver="road",
    coordinates=(),
    **DECLARED,
    structure=structure,
    online=("payload",),
    derive=derive,
    check=check,
    validity={
        **{f"road_{wheel}": (-0.5, 0.5) for wheel in WHEELS},
        **{f"road_{wheel}_dot": (-10.0, 10.0) for wheel in WHEELS},
        **{f"deflection_{wheel}": (-TRAVEL, TRAVEL) for wheel in WHEELS},
        **dict.fromkeys(TIRE_LOADS, (0.0, LARGEST_LOAD)),
        **dict.fromkeys(("pitch", "roll"), (-SMALL_ANGLE, SMALL_ANGLE)),
    },
    loads=TIRE_LOADS,
    tabled_outputs=("driver_acceleration", "pitch", "roll", "twist", *TIRE_LOADS, "strain_1"),
    main_outputs=("driver_acceleration", "twist", "Fz_FL"),
)
