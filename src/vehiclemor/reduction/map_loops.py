"""Coordinates and outputs of a mechanism as polynomials of its inputs in cells: a compiled loop.

The polynomials are a kernel that `methods/path_map.py` writes for their number and degree.
"""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.arguments import check_shapes, require
from vehiclemor.codegen.loop_types import (
    Cube,
    Int,
    IntVector,
    Matrix,
    Vector,
    call_kernel,
    matrix,
    vector,
)


class Cells(NamedTuple):
    """A box of inputs in equal cells, with a polynomial in each."""

    # The box is where all |input - centre| * scale <= 1 (INPUTS,).
    centres: Vector
    scales: Vector
    numbers: IntVector  # Number of cells along each input (INPUTS,), 1 for an input that rests.
    # Of each monomial for each quantity, padded (cells, monomials, quantities); the cells of the
    # last input stand together.
    coefficients: Cube

    @property
    def halves(self) -> np.ndarray:
        """Half of the number of cells along each input (INPUTS,)."""
        return 0.5 * self.numbers

    @property
    def tops(self) -> np.ndarray:
        """Index of the last cell along each input (INPUTS,)."""
        return self.numbers - 1.0

    def check_sizes(self) -> None:
        """Raise `ValueError` if the loop would read beyond the coefficients."""
        numbers, inputs = self.numbers.tolist(), len(self.numbers)
        require(all(type(number) is int and number > 0 for number in numbers), "numbers")
        coefficients = self.coefficients, math.prod(numbers), *self.coefficients.shape[1:3]
        check_shapes("cells", (self.centres, inputs), (self.scales, inputs), coefficients)
        # What is no number would be in a cell anywhere.
        require(bool(np.isfinite([self.centres, self.scales]).all()), "cells")


def map_path(
    inputs: Matrix, cells: Cells, polynomials: IntVector, quantities: Int, space: Vector
) -> Int:
    """Polynomials at every sample, outside of the box those of the nearest cell.

    Their kernel gives so many quantities at coordinates (inputs,) in a cell, from -1 to 1.  The
    space holds quantities of all samples, then scratch space (inputs,): one array is sooner handed
    over than two.
    """
    centres, scales, numbers, coefficients = cells
    samples, end = len(inputs), len(inputs) * quantities
    table, x = matrix(space, 0, samples, quantities), vector(space, end, len(centres))
    for sample in range(samples):
        cell = 0
        for i in range(len(centres)):
            along = ((inputs[sample, i] - centres[i]) * scales[i] + 1.0) * (0.5 * numbers[i])
            index = int(min(max(along, 0.0), numbers[i] - 1.0))
            x[i] = 2.0 * (along - index) - 1.0
            cell = cell * numbers[i] + index
        call_kernel(polynomials, 0, x, coefficients[cell], table[sample])
    return 0
