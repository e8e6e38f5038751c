"""Kernels along a path of states, compiled."""

import math

from vehiclemor.codegen.loop_types import (
    Cube,
    Int,
    IntVector,
    Matrix,
    Vector,
    call_kernel,
    call_lanes,
)
from vehiclemor.codegen.operations import LANES
from vehiclemor.simulation.loop_arguments import NODE_1, NODE_2, NODES, Outputs

# Of Lagrange's polynomials at the outer and inner points: 1 over their products of differences.
OUTER = 1.0 / ((NODE_1 - NODE_2) * (NODE_1 + NODE_2 - 1.0) * (2.0 * NODE_1 - 1.0))
INNER = 1.0 / ((NODE_2 - NODE_1) * (2.0 * NODE_2 - 1.0) * (NODE_1 + NODE_2 - 1.0))
# Of the distances of inner and outer points from the middle of a step: square, and difference.
INNER_SQUARE = (0.5 - NODE_2) ** 2
SQUARES = (0.5 - NODE_1) ** 2 - INNER_SQUARE

INLINED = (
    *("entry", "value_at", "cubic_of", "cubic_at"),
    *("cubics_within", "point_of", "note_outside"),
)


def kernel_path(
    path: Matrix, inputs: Matrix, kernel: IntVector, constants: Vector, result: Matrix
) -> Int:
    """Results (samples, size) of a kernel at every sample of a path of states.

    It takes `LANES` samples at once where there are so many.
    """
    if len(path) < LANES:
        for sample in range(len(path)):
            call_kernel(kernel, 0, path[sample], inputs[sample], constants, result[sample])
        return 0
    last = len(path) - LANES
    for first in range(0, len(path), LANES):
        # The last lanes overlap those before.
        call_lanes(kernel, 0, path, inputs, constants, result, min(first, last))
    return 0


def watched(
    states: Matrix,
    inputs: Matrix,
    node_of_sample: Matrix,
    outputs: Outputs,
    results: Matrix,
    result: IntVector,
) -> Int:
    """The first sample at which each of some outputs is outside of its range; else their number.

    States are those at the points of a run (points, n or more).  Without `node_of_sample`, see
    `loop_arguments.Output`, the points are the samples.  Results (points, results) of the kernel
    are scratch space.
    """
    samples = len(node_of_sample) if len(node_of_sample) else len(states)
    for k in range(len(result)):
        result[k] = samples
    evaluate(states, inputs, outputs, results)
    known, within = -1, False
    for sample in range(samples):
        row, z = point_of(node_of_sample, sample)
        if z < 0.0:
            within = False
        elif row != known:
            within = cubics_within(states, results, row, outputs)
        known = row
        if not within:
            note_outside(states, results, (row, z), outputs, sample, samples, result)
    return 0


def chosen(
    states: Matrix,
    inputs: Matrix,
    node_of_sample: Matrix,
    outputs: Outputs,
    results: Matrix,
    result: Matrix,
) -> Int:
    """Histories (outputs, samples) of some outputs, see `watched`."""
    evaluate(states, inputs, outputs, results)
    samples = result.shape[1]
    for k in range(len(outputs.columns)):
        column, sample = outputs.columns[k], 0
        table, index = (states, column) if column >= 0 else (results, -1 - column)
        while sample < samples:
            row, z = point_of(node_of_sample, sample)
            if row < 0 or z < 0.0:
                result[k, sample] = value_at(table, row, z, index)
                sample += 1
                continue
            cubic, end = cubic_of(table, row, index), sample + 1
            while end < samples and node_of_sample[end, 0] == node_of_sample[sample, 0]:
                end += 1
            for i in range(sample, end):
                result[k, i] = cubic_at(cubic, node_of_sample[i, 1])
            sample = end
    return 0


def evaluate(states, inputs, outputs, results):
    """Write the results of a kernel, if it has any."""
    if results.shape[1]:
        kernel_path(states, inputs, outputs.kernel, outputs.constants, results)


def sampled(points: Matrix, node_of_sample: Matrix, histories: Matrix) -> Int:
    """All columns of a table at the samples, which are not its points."""
    for sample in range(len(histories)):
        row, z = point_of(node_of_sample, sample)
        if row < 0 or z < 0.0:
            for i in range(histories.shape[1]):
                histories[sample, i] = points[row, i] if row >= 0 else math.nan
            continue
        a, b, c, d = z - NODE_1, z - NODE_2, z - 1.0 + NODE_2, z - 1.0 + NODE_1
        p, q, r, s = b * c * d * OUTER, a * c * d * INNER, -a * b * d * INNER, -a * b * c * OUTER
        first, second = points[row], points[row + 1]
        third, fourth = points[row + 2], points[row + 3]
        into = histories[sample]
        for i in range(len(into)):
            into[i] = (p * first[i] + q * second[i]) + (r * third[i] + s * fourth[i])
    return 0


def point_of(node_of_sample, sample):
    """Row of the point of a sample, and the part of its step that has passed, see `Output`."""
    if len(node_of_sample):
        return int(node_of_sample[sample, 0]), node_of_sample[sample, 1]
    return sample, -1.0


def note_outside(states, results, point, outputs, sample, samples, first):
    """Note which outputs are outside of their ranges for the first time."""
    ranges = outputs.ranges
    for k in range(len(first)):
        value = entry(states, results, point[0], point[1], outputs.columns[k])
        # What is no number lies outside too.
        inside = ranges[k, 0] <= value <= ranges[k, 1]
        if not inside and first[k] == samples:
            first[k] = sample


def entry(states, results, row, z, column):
    """An output at a point of a run, or where the part z of a step has passed, see `Outputs`."""
    if column >= 0:
        return value_at(states, row, z, column)
    return value_at(results, row, z, -1 - column)


def value_at(table, row, z, column):
    """A column of a table at a point, or where the part z of a step has passed."""
    if row < 0:
        return math.nan
    if z < 0.0:
        return table[row, column]
    return cubic_at(cubic_of(table, row, column), z)


def cubic_of(table, row, column):
    """A cubic through the points of a step, as even and odd part about its middle."""
    first, second = table[row, column], table[row + 1, column]
    third, fourth = table[row + 2, column], table[row + 3, column]
    even, odd = 0.5 * (second + third), (third - second) / (1.0 - 2.0 * NODE_2)
    even_slope = (0.5 * (first + fourth) - even) / SQUARES
    odd_slope = ((fourth - first) / (1.0 - 2.0 * NODE_1) - odd) / SQUARES
    return even, even_slope, odd, odd_slope


def cubic_at(cubic, z):
    """Such a cubic where the part z of the step has passed."""
    even, even_slope, odd, odd_slope = cubic
    y = z - 0.5
    w = y * y - INNER_SQUARE
    return (even + w * even_slope) + y * (odd + w * odd_slope)


def cubics_within(states, results, row, outputs):
    """Whether no cubic of a step can leave its limits: each is sampled only if it could.

    Between its ends a cubic stays within 1.85 times what its Chebyshev points span.
    """
    ranges = outputs.ranges
    for k in range(len(ranges)):
        low, high = math.inf, -math.inf
        for node in range(NODES):
            value = entry(states, results, row + node, -1.0, outputs.columns[k])
            if not math.isfinite(value):
                return False
            low, high = min(low, value), max(high, value)
        margin = 0.5 * (high - low)
        if low - margin < ranges[k, 0] or high + margin > ranges[k, 1]:
            return False
    return True


def recurrence(matrices: Cube, forcing: Cube, result: Cube) -> Int:
    """From its first entry on, x' = A x + g: matrices, forcing and result (samples, n, m)."""
    for sample in range(len(matrices)):
        before, now = result[sample], result[sample + 1]
        for i in range(before.shape[0]):
            for f in range(before.shape[1]):
                now[i, f] = forcing[sample, i, f]
            for j in range(before.shape[0]):
                weight = matrices[sample, i, j]
                for f in range(before.shape[1]):
                    now[i, f] += weight * before[j, f]
    return 0
