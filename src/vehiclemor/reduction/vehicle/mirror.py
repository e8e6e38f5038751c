"""The mirror image of a vehicle and of its training runs: a vehicle is its own mirror image."""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.regression import largest
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.mirror_image import partners

# States that move less than this part of their range count as not moved.
STILL = 1e-6
# How often steering is followed through the equations; relative singular values that are rounding.
POWERS, RANK = 4, 1e-10


@dataclass(frozen=True, eq=False)
class MirrorBasis:
    """POD basis of data and their mirror image.

    Attributes
    ----------
    encoding, lifting
        Coordinates per deviation (r, n), with largest magnitude 1 in training, and back (n, r).
    odd
        Which coordinates change sign in the mirror (r,).
    """

    encoding: np.ndarray
    lifting: np.ndarray
    odd: np.ndarray


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


def mirror_basis(deviations: np.ndarray, image: np.ndarray, rank: int) -> MirrorBasis:
    """POD of deviations (samples, n) and their mirror image, scaled by each state's range."""
    mirrored = deviations @ image.T
    scale = np.maximum(np.abs(deviations).max(axis=0), np.abs(mirrored).max(axis=0))
    scale[scale == 0.0] = 1.0
    values, vectors, odd = [], [], []
    for sign in (-1.0, 1.0):
        # The POD of both together is that of the odd part and of the even part.
        part = 0.5 * (deviations + sign * mirrored) / scale
        _, sizes, modes = np.linalg.svd(part, full_matrices=False)
        values += list(sizes)
        vectors += list(modes)
        odd += [sign < 0.0] * len(sizes)
    chosen = np.argsort(values)[::-1][:rank]
    modes = np.array(vectors)[chosen]
    sizes = largest(deviations / scale @ modes.T)
    return MirrorBasis(
        modes / scale / sizes[:, None], (modes * scale).T * sizes, np.array(odd)[chosen]
    )


def term_parity(odd: np.ndarray, inputs: int, degree: int) -> np.ndarray:
    """Which terms of `polynomial_features` change sign in the mirror; all inputs do."""
    parity = [False, *(bool(o) for o in odd), *[True] * inputs]
    for power in range(2, degree + 1):
        products = combinations_with_replacement(odd, power)
        parity += [sum(product) % 2 == 1 for product in products]
    return np.array(parity)


def with_mirrored(training: Training) -> list[TrainingRun]:
    """Training runs, and the same with steering to the other side.

    The vehicle is its own mirror image.  Without these runs modes mix what is symmetric with what
    is lateral, and a car that is dropped leaves its lane.
    """
    others = []
    for run in training:
        factors = run.maneuver.frequency_factor, -run.maneuver.amplitude_factor
        others.append(replace(run, maneuver=run.maneuver.perturbed(*factors)))
    return [*training, *others]
