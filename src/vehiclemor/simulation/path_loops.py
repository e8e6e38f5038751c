"""Kernels along a path of states, and Jacobians by differences, compiled."""

from vehiclemor.codegen.loop_types import Int, IntVector, Matrix, Vector, call_kernel, call_lanes
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.structures import DERIVATIVE, Equations, Observer


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
    path: Matrix, inputs: Matrix, observer: Observer, outputs: Matrix, first: IntVector
) -> Int:
    """Outputs along a path, and the first sample at which each of the limits is passed, if any."""
    if len(path) < LANES:
        kernel_path(path, inputs, observer.kernel, observer.constants, outputs)
    else:
        lane_path(path, inputs, observer.kernel, observer.constants, outputs)
    for k in range(len(observer.places)):
        place, low, high = observer.places[k], observer.ranges[k, 0], observer.ranges[k, 1]
        first[k] = len(outputs)
        for sample in range(len(outputs)):
            # What is no number lies outside too.
            if not low <= outputs[sample, place] <= high:
                first[k] = sample
                break
    return 0


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
