"""Kernels along a path of states, and Jacobians by differences, compiled."""

import math

from vehiclemor.codegen.loop_types import Int, IntVector, Matrix, Vector, call_kernel, call_lanes
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.structures import (
    DERIVATIVE,
    NODE_1,
    NODE_2,
    Equations,
    Observer,
)


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
    scratch: Matrix,
    all_states: Matrix,
    outputs: Matrix,
    first: IntVector,
) -> Int:
    """States and outputs at the samples of a run from its states (points, 2 n or more).

    Where there are no places the points are the samples, and the states stay where they are.
    The first sample at which each limited output is outside of its range is found too, if any.
    """
    if len(places):
        lane_path(states, inputs, observer.kernel, observer.constants, scratch)
    elif len(states) < LANES:
        kernel_path(states, inputs, observer.kernel, observer.constants, outputs)
    else:
        lane_path(states, inputs, observer.kernel, observer.constants, outputs)
    for k in range(len(first)):
        first[k] = len(outputs)
    for sample in range(len(outputs)):
        if len(places):
            row, z = int(places[sample, 0]), places[sample, 1]
            read_point(states, row, z, all_states[sample])
            read_point(scratch, row, z, outputs[sample])
        for k in range(len(first)):
            value = outputs[sample, observer.limited[k]]
            # What is no number lies outside too.
            inside = observer.ranges[k, 0] <= value <= observer.ranges[k, 1]
            if not inside and first[k] == len(outputs):
                first[k] = sample
    return 0


def read_point(points, row, z, into):
    """What is known at the points of a run, at the part z of a step, or at a row itself."""
    if row < 0:
        for i in range(len(into)):
            into[i] = math.nan
        return
    if z < 0.0:
        for i in range(len(into)):
            into[i] = points[row, i]
        return
    # Lagrange's polynomials at the points.
    a, b, c, d = z - NODE_1, z - NODE_2, z - 1.0 + NODE_2, z - 1.0 + NODE_1
    outer = (NODE_1 - NODE_2) * (NODE_1 + NODE_2 - 1.0) * (2.0 * NODE_1 - 1.0)
    inner = (NODE_2 - NODE_1) * (2.0 * NODE_2 - 1.0) * (NODE_1 + NODE_2 - 1.0)
    p, q, r, s = b * c * d / outer, a * c * d / inner, -a * b * d / inner, -a * b * c / outer
    for i in range(len(into)):
        into[i] = (p * points[row, i] + q * points[row + 1, i]) + (
            r * points[row + 2, i] + s * points[row + 3, i]
        )


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
