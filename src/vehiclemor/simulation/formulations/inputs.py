"""Inputs at any time, from piecewise polynomials."""

import numpy as np

from vehiclemor.codegen.loop_types import Int, Matrix, Vector
from vehiclemor.sample_loops import Pieces

INLINED = ("input_at", "signal_at")


def input_at(problem, t, u):
    """Inputs at time t, by the polynomials of the span's segment also beyond its ends, into u."""
    signal_at(problem.signal, problem.segment, t, u)


def signal_at(signal, segment, t, u):
    """The same of a segment of a signal."""
    edges, first, starts, coefficients = signal
    row, end = first[segment], first[segment + 1]
    a, b = edges[segment], edges[segment + 1]
    if len(starts):
        while end - row > 1:
            middle = (row + end) // 2
            if starts[middle] <= t:
                row = middle
            else:
                end = middle
        a = starts[row]
        if row + 1 < first[segment + 1]:
            b = starts[row + 1]
        z = (t - a) / (b - a)
    else:
        place = (t - a) / (b - a) * (end - row)
        i = int(np.floor(place))
        i = max(i, 0)
        i = min(i, end - row - 1)
        z = place - i
        row += i
    degree = coefficients.shape[2] - 1
    for j in range(len(u)):
        value = coefficients[row, j, degree]
        for power in range(degree - 1, -1, -1):
            value = coefficients[row, j, power] + z * value
        u[j] = value


def sampled(signal: Pieces, times: Vector, inputs: Matrix) -> Int:
    """Inputs (samples, inputs) at increasing times (samples,) in s; at a jump those after it."""
    segment, last = 0, len(signal.edges) - 2
    for sample in range(len(times)):
        # Times that differ by rounding are one.
        reached = times[sample] + 1e-12 * (1.0 + times[sample])
        while segment < last and signal.edges[segment + 1] <= reached:
            segment += 1
        signal_at(signal, segment, times[sample], inputs[sample])
    return 0
