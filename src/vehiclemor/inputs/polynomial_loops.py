"""Inputs as piecewise polynomials, compiled: at any time, their extent, and through samples."""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Cube, Int, IntMatrix, IntVector, Matrix, Vector

INLINED = ("input_at", "signal_at", "passed")
# Time constants (s) of two high passes, one after the other, that leave what is above 2 and 8 Hz.
CORNER, HIGHER = 0.08, 0.02
# Parts that a piece is looked at in, and the longest of them (s).
PARTS, LONGEST = 4, 0.01
# Samples whose spacings differ by less, relative to them, are equidistant.
EQUIDISTANT = 1e-8
# Change of slope beside that of the neighbouring samples, times the spacing or `FINE` (s), relative
# to the largest value: from here on a sample is a break point.  Without it, steps of a loose
# tolerance pass over noise that they do not see.
KINK, FINE = 1e-3, 0.01
# A stretch of equal samples is quiet from so long (s) on: a run at rest could step over its end.
QUIET = 0.1
# What a spline may swing within such a stretch, relative to the largest value.
SWING = 1e-6
# What else `through` returns: times that don't increase, a run (this less its number) that is not
# finite.
DISORDERED, NOT_FINITE = -1, -2
# Rows of scratch space: lengths of intervals, slopes, what bends, pivots of the spline, marks.
ROWS = 5


class Pieces(NamedTuple):
    """Piecewise polynomials.

    Ends of the smooth segments (segments + 1,) in s; number of the first piece of each (segments +
    1,); times (pieces,) in s at which pieces begin, empty if those of a segment are of one length;
    coefficients (pieces, inputs, degree + 1) in the part of the piece that has passed, lowest power
    first.
    """

    edges: Vector
    first: IntVector
    starts: Vector
    coefficients: Cube


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
    """Extremes of whole inputs, between samples too, and of what of them is quick.

    Parameters
    ----------
    limits
        By input (4, inputs): smallest and largest value, largest magnitude above 2 Hz, and the root
        of the integral over time of the square of what is above 8 Hz.
    result
        The same of the inputs, and the time in s at which a limit is passed first; infinite if none
        is (5, inputs).
    """
    edges, first, starts, coefficients = signal
    degree, pieces, segments = coefficients.shape[2] - 1, len(coefficients), len(edges) - 1
    for j in range(coefficients.shape[1]):
        low, high, most, since = math.inf, -math.inf, 0.0, math.inf
        # Before it begins an input is zero.  What has passed one filter and both, of each corner.
        before, once, twice, high_once, high_twice, squares = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        segment, parts, length, span, share = 0, 1, -1.0, 1.0, 1.0
        decay, high_decay, half_decay = 1.0, 1.0, 1.0
        even = (edges[1] - edges[0]) / (first[1] - first[0])
        for piece in range(pieces):
            if piece == first[segment + 1] and segment + 1 < segments:
                segment += 1
                even = (edges[segment + 1] - edges[segment]) / (first[segment + 1] - piece)
            begin, long = edges[segment] + even * (piece - first[segment]), even
            if len(starts):
                begin = starts[piece]
                long = (starts[piece + 1] if piece + 1 < pieces else edges[segments]) - begin
            if abs(long - length) > EQUIDISTANT * long:
                parts = max(PARTS if degree > 1 else 1, math.ceil(long / LONGEST))
                length, span, share = long, long / parts, 1.0 / parts
                decay, high_decay = math.exp(-span / CORNER), math.exp(-span / HIGHER)
                half_decay = math.sqrt(high_decay)
            for part in range(parts + 1):
                value = coefficients[piece, j, degree]
                for power in range(degree - 1, -1, -1):
                    value = coefficients[piece, j, power] + part * share * value
                change, before = value - before, value
                if part:
                    left = high_once, high_twice
                    once, twice = passed(once, twice, change, span / CORNER, decay)
                    high_once, high_twice = passed(
                        high_once, high_twice, change, span / HIGHER, high_decay
                    )
                    # By Simpson's rule, where half the change has passed.
                    _, half = passed(*left, 0.5 * change, 0.5 * span / HIGHER, half_decay)
                    sides = left[1] * left[1] + high_twice * high_twice
                    squares += span / 6.0 * (sides + 4.0 * half * half)
                else:
                    once, twice = once + change, twice + change
                    high_once, high_twice = high_once + change, high_twice + change
                low, high, most = min(low, value), max(high, value), max(most, abs(twice))
                inside = limits[0, j] <= value <= limits[1, j] and abs(twice) <= limits[2, j]
                if not (inside and squares <= limits[3, j] * limits[3, j]):
                    since = min(since, begin + part * span)
        result[0, j], result[1, j], result[2, j] = low, high, most
        result[3, j], result[4, j] = math.sqrt(squares), since
    return 0


def passed(once, twice, change, time, decay):
    """What has passed a high pass once and twice after a linear change; time is in its constant."""
    steady = change / time
    return steady + (once - steady) * decay, (twice + change - once * time) * decay


def through(
    times: Vector,
    samples: Cube,
    work: Matrix,
    coefficients: Cube,
    first: IntMatrix,
    counts: IntVector,
) -> Int:
    """Polynomials in the part of an interval that has passed, lowest power first.

    Their degree is 0 (each sample until the next), 1 or 3 (the spline with continuous second
    derivatives, not-a-knot at its ends).

    Parameters
    ----------
    times, samples
        Times (n,) in s, inputs (runs, n, inputs).
    work
        Scratch space (ROWS, n).
    coefficients
        By run and interval (runs (n - 1), inputs, degree + 1).
    first, counts
        Where smooth segments of each run end (runs, n), of which so many count (runs,): 0, the
        samples that are break points, n - 1.

    Returns
    -------
    int
        1 if the times are equidistant, 0 if not, or what is wrong.
    """
    n, degree, lengths = len(times), coefficients.shape[2] - 1, work[0]
    least, most = math.inf, 0.0
    for i in range(n - 1):
        lengths[i] = times[i + 1] - times[i]
        # What is no number is none either.
        if not 0.0 < lengths[i] < math.inf:
            return DISORDERED
        least, most = min(least, lengths[i]), max(most, lengths[i])
    if degree == 3:
        eliminate(work)
    for run in range(len(samples)):
        values = samples[run]
        own = coefficients[run * (n - 1) : (run + 1) * (n - 1)]
        for i in range(n):
            work[4, i] = 0.0
        for j in range(values.shape[1]):
            if degree == 0:
                hold(values, j, work, own)
            else:
                slopes(values, j, work)
                bend(values, j, work)
                if degree == 1:
                    straight(values, j, own)
                else:
                    spline(values, j, work, own)
            for i in range(n - 1):
                for power in range(degree + 1):
                    if not math.isfinite(own[i, j, power]):
                        return NOT_FINITE - run
            if not math.isfinite(values[n - 1, j]):
                return NOT_FINITE - run
        if degree > 0:
            rest(times, values, work[4], own)
        first[run, 0], count = 0, 1
        for i in range(1, n - 1):
            if work[4, i] > 0.0:
                first[run, count] = i
                count += 1
        first[run, count] = n - 1
        counts[run] = count + 1
    return 1 if most - least <= EQUIDISTANT * lengths[0] else 0


def hold(values, j, work, own):
    """Each sample until the next; jumps are break points, the last sample only ends the run."""
    for i in range(len(own)):
        own[i, j, 0] = values[i, j]
        if i and values[i, j] != values[i - 1, j]:
            work[4, i] = 1.0


def slopes(values, j, work):
    """Slopes of the intervals."""
    for i in range(len(values) - 1):
        work[1, i] = (values[i + 1, j] - values[i, j]) / work[0, i]


def straight(values, j, own):
    """Straight lines between samples."""
    for i in range(len(own)):
        own[i, j, 0] = values[i, j]
        own[i, j, 1] = values[i + 1, j] - values[i, j]


def bend(values, j, work):
    """Mark the samples at which the slope changes otherwise than beside them.

    A curve that is sampled finely bends by as much from sample to sample; what is left of noise,
    corners and coarse samples is what an integrator must not step over.
    """
    last, lengths, slope, bends = len(values) - 1, work[0], work[1], work[2]
    largest = 0.0
    for i in range(last + 1):
        largest = max(largest, abs(values[i, j]))
    bends[0] = bends[last] = 0.0
    for i in range(1, last):
        bends[i] = 2.0 * (slope[i] - slope[i - 1]) / (lengths[i] + lengths[i - 1])
    for i in range(1, last):
        spacing = 0.5 * (lengths[i] + lengths[i - 1])
        # A sample beside a corner doesn't bend itself.
        off = min(abs(bends[i] - 0.5 * (bends[i - 1] + bends[i + 1])), abs(bends[i]))
        if off * spacing * max(spacing, FINE) > KINK * largest:
            work[4, i] = 1.0


def rest(times, values, marks, own):
    """Mark where stretches begin and end in which no input moves.

    A spline that sets off from rest swings between the samples before: these are marked too.
    """
    n, begin, moved = len(values), 0, False
    for i in range(n):
        moves = False
        if i < n - 1:
            for j in range(values.shape[1]):
                moves = moves or values[i + 1, j] != values[i, j]
        if i == 0:
            moved = moves
        elif moves != moved or i == n - 1:
            if not moved and times[i] - times[begin] >= QUIET:
                marks[begin] = marks[i] = 1.0
                mark_swings(values, marks, own, begin, i)
            begin, moved = i, moves


def mark_swings(values, marks, own, begin, end):
    """Mark the samples beside which a polynomial moves though they are equal."""
    for j in range(values.shape[1]):
        largest = 0.0
        for i in range(len(values)):
            largest = max(largest, abs(values[i, j]))
        for k in range(begin, end):
            for power in range(1, own.shape[2]):
                if abs(own[k, j, power]) > SWING * largest:
                    marks[k] = marks[k + 1] = 1.0


def eliminate(work):
    """Pivots of the equations for the slopes of a spline; three samples have none."""
    lengths, pivots, last = work[0], work[3], work.shape[1] - 1
    if last < 3:
        return
    pivots[0], above = lengths[1], lengths[0] + lengths[1]
    for i in range(1, last):
        factor = lengths[i] / pivots[i - 1]
        pivots[i] = 2.0 * (lengths[i - 1] + lengths[i]) - factor * above
        above = lengths[i - 1]
    factor = (lengths[last - 2] + lengths[last - 1]) / pivots[last - 1]
    pivots[last] = lengths[last - 2] - factor * above


def spline(values, j, work, own):
    """The spline: its slopes at the samples by elimination, its pieces by Hermite's formula."""
    lengths, slope, rates, pivots, last = work[0], work[1], work[2], work[3], len(own)
    if last == 1:
        rates[0] = rates[1] = slope[0]
    elif last == 2:
        # A parabola.
        curve = (slope[1] - slope[0]) / (lengths[0] + lengths[1])
        rates[0] = slope[0] - curve * lengths[0]
        rates[1] = slope[0] + curve * lengths[0]
        rates[2] = slope[1] + curve * lengths[1]
    else:
        a, b = lengths[0], lengths[1]
        rates[0] = ((3.0 * a + 2.0 * b) * b * slope[0] + a * a * slope[1]) / (a + b)
        for i in range(1, last):
            a, b = lengths[i - 1], lengths[i]
            rates[i] = 3.0 * (b * slope[i - 1] + a * slope[i]) - b / pivots[i - 1] * rates[i - 1]
        a, b = lengths[last - 2], lengths[last - 1]
        right = (b * b * slope[last - 2] + (2.0 * a + 3.0 * b) * a * slope[last - 1]) / (a + b)
        rates[last] = (right - (a + b) / pivots[last - 1] * rates[last - 1]) / pivots[last]
        for i in range(last - 1, 0, -1):
            rates[i] = (rates[i] - lengths[i - 1] * rates[i + 1]) / pivots[i]
        rates[0] = (rates[0] - (lengths[0] + lengths[1]) * rates[1]) / pivots[0]
    for i in range(last):
        h, rise = lengths[i], values[i + 1, j] - values[i, j]
        left, right = h * rates[i], h * rates[i + 1]
        own[i, j, 0], own[i, j, 1] = values[i, j], left
        own[i, j, 2] = 3.0 * rise - 2.0 * left - right
        own[i, j, 3] = left + right - 2.0 * rise
