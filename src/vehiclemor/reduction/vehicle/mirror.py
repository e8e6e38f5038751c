"""The mirror image of a vehicle: it is its own mirror image."""

import numpy as np

from vehiclemor.reduction.vehicle.regression import largest
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.mirror_image import partners

# States that move less than this part of their range count as not moved.
STILL = 1e-6
# How often steering is followed through the equations; relative singular values that are rounding.
POWERS, RANK = 4, 1e-10


def mirror(shape: VehicleShape) -> np.ndarray:
    """Signed permutation (n, n): the deviation of the shape in the vehicle's mirror image.

    Names tell the partners.  Signs follow from what steering moves, which changes its sign in the
    mirror: of a state without a partner, and against its partner's of any other.
    """
    # Not its modes: a symmetric one of the same frequency would be mixed with a lateral one.
    linear = shape.linearised
    parts = [np.linalg.lstsq(linear.a, linear.b[:, :1], rcond=RANK)[0], linear.b]
    for _ in range(POWERS):
        parts.append(linear.a @ parts[-1])
    moved = np.hstack(parts)
    moved /= largest(moved)
    partner = partners(shape.names)
    matrix = np.zeros((len(partner), len(partner)))
    for i, j in enumerate(partner):
        if i == j:
            matrix[i, i] = -1.0 if np.abs(moved[i]).max() > STILL else 1.0
        else:
            matrix[i, j] = -1.0 if moved[i] @ moved[j] > 0.0 else 1.0
    return matrix
