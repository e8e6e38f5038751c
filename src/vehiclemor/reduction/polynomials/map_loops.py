"""Coordinates of a mechanism as polynomials in its travel: a compiled loop.

Samples are taken in blocks.  The number of powers is known to the compiler: they are unrolled, and
what is left is a loop over a block, which becomes vector code.
"""

from vehiclemor.codegen.loop_types import Float, Int, Matrix, Vector, matrix, vector
from vehiclemor.simulation.newton_loops import CONVERGED, SAMPLE, Solution

BLOCK = 64
OUTSIDE = 1
# Sizes that the compiler knows: coordinates, degree.
N, DEGREE = 0, 0


def map_path(
    inputs: Matrix,
    centre: Float,
    scale: Float,
    limits: Vector,
    coefficients: Matrix,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Polynomials at every sample, by Horner's scheme; stops where an input is outside the limits.

    Parameters
    ----------
    inputs
        Travel (m) and rack displacement (m) at the samples (samples, 2).
    centre, scale, coefficients
        As of `PathMapModel`.
    limits
        Lowest and highest travel, lowest and highest rack displacement (4,) in m.
    buffer
        Scratch space (BLOCK (N + 1),), zero at first.
    """
    path, counts = solution.path, solution.counts
    low, high, left, right = limits[0], limits[1], limits[2], limits[3]
    arguments, results = vector(buffer, 0, BLOCK), matrix(buffer, BLOCK, N, BLOCK)
    samples, first = inputs.shape[0], 0
    while first < samples:
        count = 0
        for sample in range(first, min(first + BLOCK, samples)):
            travel, rack = inputs[sample, 0], inputs[sample, 1]
            if not (low <= travel <= high and left <= rack <= right):
                break
            arguments[count] = (travel - centre) * scale
            count += 1
        # Places beyond the count are computed, and not used: so every sample meets the same code.
        for i in range(N):
            for place in range(BLOCK):
                x, total = arguments[place], coefficients[0, i]
                for power in range(1, DEGREE + 1):
                    total = total * x + coefficients[power, i]
                results[i, place] = total
        for place in range(count):
            for i in range(N):
                path[first + place, i] = results[i, place]
        first += count
        if count < BLOCK and first < samples:
            counts[SAMPLE] = first
            return OUTSIDE
    return CONVERGED
