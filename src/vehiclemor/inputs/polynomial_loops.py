"""Inputs as piecewise polynomials, compiled: at any time, and their extent."""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Cube, Int, IntVector, Matrix, Vector

INLINED = ("input_at", "signal_at")
# Parts of a curved piece between evaluations, and the longest of them (s).
PARTS, LONGEST = 4, 0.01
# Inputs from which on they are evaluated side by side.
MANY = 8
# Samples whose spacings differ by less, relative to them, are equidistant.
EQUIDISTANT = 1e-8


class Pieces(NamedTuple):
    """Piecewise polynomials.

    Ends of the smooth segments (segments + 1,) in s; number of the first piece of each (segments +
    1,); times (pieces,) in s at which pieces begin, empty if those of a segment are of one length;
    coefficients (pieces, degree + 1, inputs) in the part of the piece that has passed, lowest power
    first.
    """

    edges: Vector
    first: IntVector
    starts: Vector
    coefficients: Cube


def input_at(problem, t, u):
    """Inputs at time t, into u, by the segment of the current span, also beyond its ends."""
    signal_at(problem.signal, problem.segment, t, u)


def signal_at(signal, segment, t, u):
    """Inputs at time t in one smooth segment, into u."""
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
        position = (t - a) / (b - a) * (end - row)
        i = int(np.floor(position))
        i = max(i, 0)
        i = min(i, end - row - 1)
        z = position - i
        row += i
    degree = coefficients.shape[1] - 1
    if len(u) < MANY:
        for j in range(len(u)):
            value = coefficients[row, degree, j]
            for power in range(degree - 1, -1, -1):
                value = coefficients[row, power, j] + z * value
            u[j] = value
        return
    # Side by side: the compiler takes several at once.
    for j in range(len(u)):
        u[j] = coefficients[row, degree, j]
    for power in range(degree - 1, -1, -1):
        for j in range(len(u)):
            u[j] = coefficients[row, power, j] + z * u[j]


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
    """Smallest and largest values of inputs over a run, between samples too.

    Limits (2, inputs) are such values by input.  The result (3, inputs) is the same of the inputs,
    and the time in s at which a limit is passed first; infinite if none is.
    """
    edges, first, starts, coefficients = signal
    degree, pieces, segments = coefficients.shape[1] - 1, len(coefficients), len(edges) - 1
    for j in range(coefficients.shape[2]):
        low, high, since = math.inf, -math.inf, math.inf
        segment = 0
        even = (edges[1] - edges[0]) / (first[1] - first[0])
        for piece in range(pieces):
            if piece == first[segment + 1] and segment + 1 < segments:
                segment += 1
                even = (edges[segment + 1] - edges[segment]) / (first[segment + 1] - piece)
            begin, long = edges[segment] + even * (piece - first[segment]), even
            if len(starts):
                begin = starts[piece]
                long = (starts[piece + 1] if piece + 1 < pieces else edges[segments]) - begin
            parts = max(PARTS if degree > 1 else 1, math.ceil(long / LONGEST))
            span, share = long / parts, 1.0 / parts
            for part in range(parts + 1):
                value = coefficients[piece, degree, j]
                for power in range(degree - 1, -1, -1):
                    value = coefficients[piece, power, j] + part * share * value
                low, high = min(low, value), max(high, value)
                if not limits[0, j] <= value <= limits[1, j]:
                    since = min(since, begin + part * span)
        result[0, j], result[1, j], result[2, j] = low, high, since
    return 0
