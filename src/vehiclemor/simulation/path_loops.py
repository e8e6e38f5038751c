"""Kernels along a path of states, and Jacobians by differences, compiled."""

import math

from vehiclemor.codegen.loop_types import (
    Int,
    IntVector,
    Matrix,
    Vector,
    call_kernel,
    call_lanes,
    matrix,
    mixed_rows,
)
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.structures import (
    DERIVATIVE,
    NODE_1,
    NODE_2,
    NODES,
    Equations,
    Observer,
)

# Of Lagrange's polynomials at the outer and inner points: 1 over their products of differences.
OUTER = 1.0 / ((NODE_1 - NODE_2) * (NODE_1 + NODE_2 - 1.0) * (2.0 * NODE_1 - 1.0))
INNER = 1.0 / ((NODE_2 - NODE_1) * (2.0 * NODE_2 - 1.0) * (NODE_1 + NODE_2 - 1.0))

INLINED = ("read_point", "cubics_within", "point_of", "note_outside")


def kernel_path(
    path: Matrix, inputs: Matrix, kernel: IntVector, constants: Vector, result: Matrix
) -> Int:
    """Results (samples, size) of one kernel at every sample of a path of states."""
    for sample in range(len(path)):
        call_kernel(kernel, 0, path[sample], inputs[sample], constants, result[sample])
    return 0


def lane_path(
    path: Matrix, inputs: Matrix, kernel: IntVector, constants: Vector, result: Matrix
) -> Int:
    """The same by a kernel that takes `LANES` samples at once, which there must be."""
    last = len(path) - LANES
    for first in range(0, len(path), LANES):
        # The last may have been computed before.
        call_lanes(kernel, 0, path, inputs, constants, result, min(first, last))
    return 0


def delivered(
    states: Matrix,
    inputs: Matrix,
    places: Matrix,
    observer: Observer,
    scratch: Vector,
    result: Matrix,
    first: IntVector,
) -> Int:
    """States and outputs side by side at the samples of a run, from its states at points.

    Where there are no places the points are the samples.  The first sample at which each limited
    output is outside of its range is found too, if any.

    Parameters
    ----------
    states
        At the points (points, n or more); only the first n are read.
    places
        See `structures.Output`.
    scratch
        As long as a result for the points.
    result
        Rows of n states, of the outputs and of what fills up to a whole number of vectors.
    """
    samples = len(result)
    points = matrix(scratch, 0, len(states), result.shape[1])
    observed(states, inputs, observer, scratch, points)
    for k in range(len(first)):
        first[k] = samples
    known, within = -1, False
    for sample in range(samples):
        row, z = point_of(places, sample)
        read_point(points, row, z, result[sample])
        if z < 0.0:
            within = False
        elif row != known:
            within = cubics_within(points, row, observer)
        known = row
        if not within:
            note_outside(result[sample], observer, sample, samples, first)
    return 0


def observed(states, inputs, observer, scratch, points):
    """States and outputs side by side at the points, the scratch space."""
    n, width = observer.states, points.shape[1]
    for row in range(len(states)):
        for i in range(n):
            points[row, i] = states[row, i]
        # What happens to stand behind the outputs may take a hundred times as long to add.
        for i in range(max(n, width - LANES + 1), width):
            points[row, i] = 0.0
    outputs = matrix(scratch, n, len(states), width)
    if len(states) >= LANES:
        lane_path(states, inputs, observer.kernel, observer.constants, outputs)
    else:
        kernel_path(states, inputs, observer.kernel, observer.constants, outputs)


def point_of(places, sample):
    """Row of the point of a sample, and the part of its step that has passed, see `Output`."""
    if len(places):
        return int(places[sample, 0]), places[sample, 1]
    return sample, -1.0


def note_outside(row, observer, sample, samples, first):
    """Note which limited outputs are outside of their ranges for the first time."""
    for k in range(len(first)):
        value = row[observer.states + observer.limited[k]]
        # What is no number lies outside too.
        inside = observer.ranges[k, 0] <= value <= observer.ranges[k, 1]
        if not inside and first[k] == samples:
            first[k] = sample


def read_point(points, row, z, into):
    """What is known at a point of a run, or where the part z of a step has passed."""
    if row < 0:
        for i in range(len(into)):
            into[i] = math.nan
    elif z < 0.0:
        for i in range(len(into)):
            into[i] = points[row, i]
    else:
        # Lagrange's polynomials at the points.
        a, b, c, d = z - NODE_1, z - NODE_2, z - 1.0 + NODE_2, z - 1.0 + NODE_1
        p, q, r, s = b * c * d * OUTER, a * c * d * INNER, -a * b * d * INNER, -a * b * c * OUTER
        mixed_rows(points[row:], (p, q, r, s), into)


def cubics_within(points, row, observer):
    """Whether no cubic of a step can leave its limits: each is sampled only if it could.

    Between its ends a cubic stays within 1.85 times what its Chebyshev points span.
    """
    for k in range(len(observer.limited)):
        column = observer.states + observer.limited[k]
        low, high = math.inf, -math.inf
        for node in range(NODES):
            value = points[row + node, column]
            if not math.isfinite(value):
                return False
            low, high = min(low, value), max(high, value)
        margin = 0.5 * (high - low)
        if low - margin < observer.ranges[k, 0] or high + margin > observer.ranges[k, 1]:
            return False
    return True


def jacobian_at(
    x: Vector, u: Vector, equations: Equations, active: IntVector, work: Matrix, result: Matrix
) -> Int:
    """Columns of df/dx (n, n) by central differences; inactive ones are zero."""
    size, kernels, constants = len(x), equations.kernels, equations.constants
    shifted, above, below = work[0], work[1], work[2]
    for i in range(size):
        for j in range(size):
            result[i, j] = 0.0
    for column in active:
        change = 6e-6 * max(abs(x[column]), 1.0)
        for i in range(size):
            shifted[i] = x[i]
        shifted[column] = x[column] + change
        call_kernel(kernels, DERIVATIVE, shifted, u, constants, above)
        shifted[column] = x[column] - change
        call_kernel(kernels, DERIVATIVE, shifted, u, constants, below)
        for i in range(size):
            result[i, column] = (above[i] - below[i]) / (2.0 * change)
    return 0
