"""Inputs at any time, from piecewise polynomials, and how far and how quickly they move."""

import math

import numpy as np

from vehiclemor.codegen.loop_types import Int, Matrix, Vector
from vehiclemor.sample_loops import EQUIDISTANT, Pieces

INLINED = ("input_at", "signal_at")
# Time constant (s) of the two high passes that leave what of an input is above 2 Hz.
CORNER = 0.08
# Parts that a piece is looked at in, and the longest of them (s).
PARTS, LONGEST = 8, 0.02


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


def extent(signal: Pieces, limits: Matrix, result: Matrix) -> Int:
    """Extremes of whole inputs, between samples too, and of what of them is above 2 Hz.

    Parameters
    ----------
    limits
        By input (3, inputs): smallest and largest value, largest magnitude above 2 Hz.
    result
        The same of the inputs, and the time in s at which a limit is passed first; infinite if none
        is (4, inputs).
    """
    edges, first, starts, coefficients = signal
    degree, pieces, segments = coefficients.shape[2] - 1, len(coefficients), len(edges) - 1
    for j in range(coefficients.shape[1]):
        low, high, most, since = math.inf, -math.inf, 0.0, math.inf
        least, largest, quickest = limits[0, j], limits[1, j], limits[2, j]
        # Before it begins an input is zero; `once` and `twice` have passed one and both filters.
        before, once, twice = 0.0, 0.0, 0.0
        segment, parts, length, share, inverse, decay = 0, 1, -1.0, 0.0, 0.0, 1.0
        even = (edges[1] - edges[0]) / (first[1] - first[0])
        for piece in range(pieces):
            if piece == first[segment + 1] and segment + 1 < segments:
                segment += 1
                even = (edges[segment + 1] - edges[segment]) / (first[segment + 1] - piece)
            a, long = edges[segment] + even * (piece - first[segment]), even
            if len(starts):
                a = starts[piece]
                long = (starts[piece + 1] if piece + 1 < pieces else edges[segments]) - a
            if abs(long - length) > EQUIDISTANT * long:
                parts = max(PARTS if degree > 1 else 1, math.ceil(long / LONGEST))
                length, share = long, long / parts / CORNER
                inverse, decay = 1.0 / share, math.exp(-share)
            for part in range(parts + 1):
                z = part / parts if parts > 1 else float(part)
                value = coefficients[piece, j, degree]
                for power in range(degree - 1, -1, -1):
                    value = coefficients[piece, j, power] + z * value
                change, before = value - before, value
                if part:
                    slope = change * inverse
                    twice = (twice + (slope - once) * share) * decay
                    once = slope + (once - slope) * decay
                else:
                    once, twice = once + change, twice + change
                low, high, most = min(low, value), max(high, value), max(most, abs(twice))
                if not (least <= value <= largest and abs(twice) <= quickest):
                    since = min(since, a + z * long)
        result[0, j], result[1, j], result[2, j], result[3, j] = low, high, most, since
    return 0
