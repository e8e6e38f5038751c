"""Coordinates and outputs of a mechanism as polynomials of its inputs in cells: a compiled loop.

The polynomials are a kernel that `kernels.py` writes for their number and degree.
"""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Int, IntVector, Matrix, Vector, matrix, vector
from vehiclemor.simulation.newton_loops import CONVERGED

# Sizes that the compiler knows: inputs, those of them that move, quantities.
INPUTS, MOVING, QUANTITIES = 0, 0, 0
# Places of what a run tells: the largest indicator, and the first sample at which it is above 1, or
# the number of samples; how much that is.
INDICATOR, LEFT, TOLD = range(3)


class Cells(NamedTuple):
    """A box of inputs in equal cells, with a polynomial in each.

    Attributes
    ----------
    centres, scales
        The indicator of inputs is the largest |input - centre| * scale (INPUTS,).
    moving, numbers
        Which inputs move (MOVING,), and the number of cells along each.
    lowest, rates
        Of these: the lowest value, and cells by unit (MOVING,).
    coefficients
        Of each monomial for each quantity, padded (cells, monomials, quantities); the cells of the
        last input stand together.
    """

    centres: Vector
    scales: Vector
    moving: IntVector
    numbers: IntVector
    lowest: Vector
    rates: Vector
    coefficients: Cube


def polynomials(x: Vector, coefficients: Matrix, result: Vector) -> None:
    """Quantities at a place x (MOVING,) of a cell, from -1 to 1: a kernel inside of the loop."""


def map_path(inputs: Matrix, cells: Cells, space: Vector) -> Int:
    """Polynomials at every sample, outside of the box those of the nearest cell.

    Parameters
    ----------
    inputs
        At the samples (samples, INPUTS).
    space
        Quantities of all samples, then what the run tells, by place, see above, then scratch space
        (MOVING,): one array is sooner handed over than three.
    """
    centres, scales, moving, numbers, lowest, rates, coefficients = cells
    samples = inputs.shape[0]
    table, end = matrix(space, 0, samples, QUANTITIES), samples * QUANTITIES
    told, x = vector(space, end, TOLD), vector(space, end + TOLD, MOVING)
    largest, left = 0.0, samples
    for sample in range(samples):
        indicator = 0.0
        for i in range(INPUTS):
            indicator = max(indicator, abs(inputs[sample, i] - centres[i]) * scales[i])
        largest = max(largest, indicator)
        if indicator > 1.0 and sample < left:
            left = sample
        cell = 0
        for k in range(MOVING):
            place = (inputs[sample, moving[k]] - lowest[k]) * rates[k]
            number = int(min(max(place, 0.0), numbers[k] - 1.0))
            x[k] = 2.0 * (place - number) - 1.0
            cell = cell * numbers[k] + number
        polynomials(x, coefficients[cell], table[sample])
    told[INDICATOR], told[LEFT] = largest, left
    return CONVERGED
