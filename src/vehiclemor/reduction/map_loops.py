"""Coordinates and outputs of a mechanism as polynomials of its inputs in cells: a compiled loop.

The polynomials are a kernel that `methods/path_map.py` writes for their number and degree.
"""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Cube, Int, IntVector, Matrix, Vector, matrix, vector
from vehiclemor.simulation.newton_loops import CONVERGED
from vehiclemor.sizes import require, shaped

# Sizes that the compiler knows.
INPUTS, QUANTITIES = 0, 0
# Places of what a run tells: the largest indicator, and the first sample at which it is above 1, or
# the number of samples; how much that is.
INDICATOR, LEFT, TOLD = range(3)


class Cells(NamedTuple):
    """A box of inputs in equal cells, with a polynomial in each.

    Attributes
    ----------
    centres, scales
        The box is where all |input - centre| * scale <= 1 (INPUTS,); the largest is the indicator.
    halves, tops
        Half of the number of cells along each input, and one less than that number (INPUTS,).
    numbers
        The number itself (INPUTS,), 1 for an input that rests.
    coefficients
        Of each monomial for each quantity, padded (cells, monomials, quantities); the cells of the
        last input stand together.
    """

    centres: Vector
    scales: Vector
    halves: Vector
    tops: Vector
    numbers: IntVector
    coefficients: Cube

    def check_sizes(self) -> None:
        """Raise `ValueError` if the loop would read beyond the coefficients."""
        numbers, inputs = self.numbers.tolist(), len(self.numbers)
        require(all(type(number) is int and number > 0 for number in numbers), "numbers")
        shaped("cells", *((array, inputs) for array in self[:4]))
        shaped("cells", (self.coefficients, math.prod(numbers), *self.coefficients.shape[1:3]))
        require(np.array_equal(self.tops, self.numbers - 1.0), "tops")
        require(np.array_equal(self.halves, 0.5 * self.numbers), "halves")
        # What is no number would be a place anywhere.
        require(bool(np.isfinite([self.centres, self.scales]).all()), "cells")


def polynomials(x: Vector, coefficients: Matrix, result: Vector) -> None:
    """Quantities at a place x (INPUTS,) of a cell, from -1 to 1: a kernel inside of the loop."""


def map_path(inputs: Matrix, cells: Cells, space: Vector) -> Int:
    """Polynomials at every sample, outside of the box those of the nearest cell.

    Parameters
    ----------
    inputs
        At the samples (samples, INPUTS).
    space
        Quantities of all samples, then what the run tells, by place, see above, then scratch space
        (INPUTS,): one array is sooner handed over than three.
    """
    centres, scales, halves, tops, numbers, coefficients = cells
    samples = inputs.shape[0]
    table, end = matrix(space, 0, samples, QUANTITIES), samples * QUANTITIES
    told, x = vector(space, end, TOLD), vector(space, end + TOLD, INPUTS)
    largest, left = 0.0, samples
    for sample in range(samples):
        indicator, cell = 0.0, 0
        for i in range(INPUTS):
            place = (inputs[sample, i] - centres[i]) * scales[i]
            indicator = max(indicator, abs(place))
            place = (place + 1.0) * halves[i]
            number = int(min(max(place, 0.0), tops[i]))
            x[i] = 2.0 * (place - number) - 1.0
            cell = cell * numbers[i] + number
        largest = max(largest, indicator)
        if indicator > 1.0 and sample < left:
            left = sample
        polynomials(x, coefficients[cell], table[sample])
    told[INDICATOR], told[LEFT] = largest, left
    return CONVERGED
