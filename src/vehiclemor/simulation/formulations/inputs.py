"""Inputs at any time, from piecewise polynomials."""

import numpy as np

INLINED = ("input_at",)


def input_at(problem, t, u):
    """Inputs at time t, by the polynomials of the span's segment also beyond its ends, into u."""
    edges, first, coefficients = problem.signal
    segment = problem.segment
    pieces = first[segment + 1] - first[segment]
    a = edges[segment]
    place = (t - a) / (edges[segment + 1] - a) * pieces
    i = int(np.floor(place))
    i = max(i, 0)
    i = min(i, pieces - 1)
    z = place - i
    row = first[segment] + i
    for j in range(len(u)):
        value = coefficients[row, j, 5]
        value = coefficients[row, j, 4] + z * value
        value = coefficients[row, j, 3] + z * value
        value = coefficients[row, j, 2] + z * value
        value = coefficients[row, j, 1] + z * value
        u[j] = coefficients[row, j, 0] + z * value
