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

INLINED = ("read_point", "weights_of", "entry", "cubics_within", "point_of", "note_outside")


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


def observed(
    states: Matrix,
    inputs: Matrix,
    places: Matrix,
    observer: Observer,
    space: Vector,
    first: IntVector,
) -> Int:
    """States and outputs side by side at the points of a run: the space, as a table.

    The first sample at which each limited output is outside of its range is found too, if any; else
    it is the number of samples.

    Parameters
    ----------
    states
        At the points (points, n or more); only the first n are read.
    places
        See `structures.Output`; where there are none the points are the samples.
    space
        As long as the table and a row more.
    """
    n, width = observer.states, observer.width
    points = matrix(space, 0, len(states), width)
    for row in range(len(states)):
        for i in range(n):
            points[row, i] = states[row, i]
        # What happens to stand behind the outputs may take a hundred times as long to add.
        for i in range(max(n, width - LANES + 1), width):
            points[row, i] = 0.0
    outputs = matrix(space, n, len(states), width)
    if len(states) >= LANES:
        lane_path(states, inputs, observer.kernel, observer.constants, outputs)
    else:
        kernel_path(states, inputs, observer.kernel, observer.constants, outputs)
    samples = len(places) if len(places) else len(states)
    for k in range(len(first)):
        first[k] = samples
    known, within = -1, False
    for sample in range(samples):
        row, z = point_of(places, sample)
        if z < 0.0:
            within = False
        elif row != known:
            within = cubics_within(points, row, observer)
        known = row
        if not within:
            note_outside(points, row, z, observer, sample, samples, first)
    return 0


def sampled(points: Matrix, places: Matrix, columns: IntVector, result: Matrix) -> Int:
    """Some columns of the table at the samples; all, in whole vectors, where none are named."""
    for sample in range(len(result)):
        row, z = point_of(places, sample)
        if not len(columns):
            read_point(points, row, z, result[sample])
        else:
            for k in range(len(columns)):
                result[sample, k] = entry(points, row, z, columns[k])
    return 0


def point_of(places, sample):
    """Row of the point of a sample, and the part of its step that has passed, see `Output`."""
    if len(places):
        return int(places[sample, 0]), places[sample, 1]
    return sample, -1.0


def note_outside(points, row, z, observer, sample, samples, first):
    """Note which limited outputs are outside of their ranges for the first time."""
    for k in range(len(first)):
        value = entry(points, row, z, observer.states + observer.limited[k])
        # What is no number lies outside too.
        inside = observer.ranges[k, 0] <= value <= observer.ranges[k, 1]
        if not inside and first[k] == samples:
            first[k] = sample


def weights_of(z):
    """Weights of the points of a step where its part z has passed: Lagrange's polynomials."""
    a, b, c, d = z - NODE_1, z - NODE_2, z - 1.0 + NODE_2, z - 1.0 + NODE_1
    return b * c * d * OUTER, a * c * d * INNER, -a * b * d * INNER, -a * b * c * OUTER


def entry(points, row, z, column):
    """A column of the table at a point of a run, or where the part z of a step has passed."""
    if row < 0:
        return math.nan
    if z < 0.0:
        return points[row, column]
    p, q, r, s = weights_of(z)
    return (p * points[row, column] + q * points[row + 1, column]) + (
        r * points[row + 2, column] + s * points[row + 3, column]
    )


def read_point(points, row, z, into):
    """All columns of the table, as `entry`."""
    if row < 0:
        for i in range(len(into)):
            into[i] = math.nan
    elif z < 0.0:
        for i in range(len(into)):
            into[i] = points[row, i]
    else:
        mixed_rows(points[row:], weights_of(z), into)


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
