"""Coordinates, speeds and constants of the high-fidelity vehicle with frozen inertia by name."""

from vehiclemor.multibody.high_fidelity.quantities import (
    INDEPENDENT_COORDINATES,
    INDEPENDENT_SPEEDS,
)
from vehiclemor.multibody.quantities import CHASSIS_SPEEDS, per_wheel

COORDINATES = INDEPENDENT_COORDINATES
SPEEDS = (
    *CHASSIS_SPEEDS,
    *INDEPENDENT_SPEEDS[6:10],
    *per_wheel("spin", "rad/s", "angular velocity of the {} wheel in space about its axle"),
)
N = len(COORDINATES)
DEGREE = 3
SPRING_DEGREE = 4
# Exponents (of the arm's angle, of the rack's displacement).
RACK_DEGREE = 2
MONOMIALS = tuple(
    (i, j) for i in range(DEGREE + 1) for j in range(min(RACK_DEGREE, DEGREE - i) + 1)
)
# The axle is a unit vector: two components give the third.
FRONT_MAPS = (*(f"front_centre_{axis}" for axis in "xyz"), "front_axle_x", "front_axle_z")
REAR_MAPS = ("rear_centre_x", "rear_centre_z")
SPRING_MAPS = ("front_spring", "rear_spring")
ENDS = ("front", "rear")
# Unknowns of motions that are their own mirror image, then of those that reverse: three chassis
# speeds and the mean, or half the difference, of both front and of both rear arms.
FAMILIES = ("even", "odd")
FAMILY_CHASSIS = ((0, 2, 4), (1, 3, 5))


def _names() -> list[str]:
    """Names of the constants that `frozen_constants` gives, in order."""
    names = [f"{name}_{i}_{j}" for name in FRONT_MAPS for i, j in MONOMIALS]
    names += [f"{name}_{i}" for name in REAR_MAPS for i in range(DEGREE + 1)]
    names += [f"{name}_{i}" for name in SPRING_MAPS for i in range(SPRING_DEGREE + 1)]
    names += ["rear_centre_y", "turn_by_arm", "turn_by_rack", "total_mass"]
    names += ["offset_x", "offset_z", "tensor_xx", "tensor_yy", "tensor_zz", "tensor_xz"]
    names += [f"{end}_first_{axis}" for end in ENDS for axis in "xyz"]
    names += [f"{end}_second_{axis}" for end in ENDS for axis in "xyz"]
    names += [f"{f}_{i}{j}" for f in FAMILIES for i in range(5) for j in range(i + 1)]
    return names


CONSTANTS = tuple(_names())
