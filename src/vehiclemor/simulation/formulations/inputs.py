"""Inputs at any time, from piecewise polynomials."""

import numpy as np

INLINED = ("input_at",)


def input_at(problem, t, u):
    """Inputs at time t, by the polynomials of the span's segment also beyond its ends, into u."""
    edges, first, starts, coefficients = problem.signal
    segment = problem.segment
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
    for j in range(len(u)):
        value = coefficients[row, j, 5]
        value = coefficients[row, j, 4] + z * value
        value = coefficients[row, j, 3] + z * value
        value = coefficients[row, j, 2] + z * value
        value = coefficients[row, j, 1] + z * value
        u[j] = coefficients[row, j, 0] + z * value
