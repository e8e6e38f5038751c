"""What reduced vehicles do along time, compiled: decoding, and the variation of a run."""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Float, Int, IntVector, Matrix, Vector
from vehiclemor.codegen.operations import LANES
from vehiclemor.simulation.path_loops import kernel_path, lane_path

# What has decayed to this part of what it was is nothing.
NOTHING = 1e-14
# Parts of a range in which time is counted, and what of it is hardly moving, and not at all.
PARTS, MOVING, STILL = 8, 0.02, 1e-4
LEVELS = PARTS + 1
# Number of reasons besides ranges, and a time (s) that is hardly after the start.
BESIDES, SOON = 5, 1e-3


def with_decay(
    times: Vector,
    inputs: Matrix,
    rates: Matrix,
    amplitudes: Matrix,
    factors: Matrix,
    result: Matrix,
) -> Int:
    """Inputs (samples, m), and behind them real and imaginary part of a exp(rate t) of each mode.

    Rates and amplitudes a have a row of these two parts for each mode; factors are scratch space.
    """
    m, modes, step, largest, latest = inputs.shape[1], len(rates), math.nan, 0.0, 1.0
    for sample in range(len(times)):
        for j in range(m):
            result[sample, j] = inputs[sample, j]
        if sample == 0 or not abs(times[sample] - times[sample - 1] - step) < 1e-12:
            step = times[sample] - times[sample - 1] if sample else times[0]
            for k in range(modes):
                size = math.exp(rates[k, 0] * step)
                factors[k, 0] = size * math.cos(rates[k, 1] * step)
                factors[k, 1] = size * math.sin(rates[k, 1] * step)
        reached = 0.0
        for k in range(modes):
            a, b = amplitudes[k, 0], amplitudes[k, 1]
            if sample:
                a, b = result[sample - 1, m + 2 * k], result[sample - 1, m + 2 * k + 1]
            if latest > NOTHING * largest:
                a, b = factors[k, 0] * a - factors[k, 1] * b, factors[k, 0] * b + factors[k, 1] * a
            else:
                a, b = 0.0, 0.0
            result[sample, m + 2 * k], result[sample, m + 2 * k + 1] = a, b
            reached = max(reached, abs(a), abs(b))
        largest, latest = max(largest, reached), reached
    return 0


class Known(NamedTuple):
    """What is known of durations and of a run's start, see `training_reach`."""

    times: Vector  # Of the samples, s.
    # Times (2 columns, levels) that are known, and scratch space alike.
    lasted: Matrix
    spent: Matrix
    # When (s) what it excites has settled, how unlike known starts it is, and 1, all zero where the
    # first sample is no start; how far the inputs go, and when (s) they are beyond.
    start: Vector
    sideways: Float  # How far known starts use the ranges of lateral motion.


def decoded(
    path: Matrix,
    inputs: Matrix,
    kernel: IntVector,
    constants: Vector,
    states: Matrix,
    known: Known,
    largest: Vector,
    first: IntVector,
) -> Int:
    """States by a kernel for `LANES` samples, or for one on shorter paths.

    Of the columns behind the states also the largest magnitude, and the first sample above 1; and
    behind these the same of what is known besides.
    """
    if len(path) < LANES:
        kernel_path(path, inputs, kernel, constants, states)
    else:
        lane_path(path, inputs, kernel, constants, states)
    watched = max(len(largest) - BESIDES, 0)
    column = states.shape[1] - watched
    for k in range(len(largest)):
        largest[k], first[k] = 0.0, len(states)
    for sample in range(len(states)):
        for k in range(watched):
            size = abs(states[sample, column + k])
            if size > largest[k]:
                if size > 1.0 and not largest[k] > 1.0:
                    first[k] = sample
                largest[k] = size
    if watched and len(known.lasted):
        exceed(states, column, known, largest[watched:], first[watched:])
    return 0


def exceed(states, column, known, largest, first):
    """How far a run goes in durations and its start in known ones, and the first samples beyond."""
    times, columns = known.times, len(known.spent) // 2
    longest, moving = durations(times, states, column, known.lasted, known.spent)
    largest[0] = longest
    if longest > 1.0:
        first[0] = lasted_until(times, states, column, known.lasted, known.spent)
    if moving < len(times):
        largest[1] = known.start[0] / max(times[moving], SOON)
        first[1] = moving if largest[1] > 1.0 else first[1]
    if moving == 0 and known.start[2] > 0.0:
        for k in range(columns):
            largest[2] = max(largest[2], abs(states[0, column + k]) / known.sideways)
        first[2] = 0 if largest[2] > 1.0 else first[2]
    largest[3] = known.start[1]
    first[3] = 0 if largest[3] > 1.0 else first[3]
    largest[4] = known.start[3]
    if largest[4] > 1.0:
        # What passes between two samples counts from the second on.
        first[4] = len(times) - 1
        for sample in range(len(times)):
            if times[sample] >= known.start[4]:
                first[4] = min(first[4], sample)


def durations(times, states, column, lasted, spent):
    """Largest part of known times that columns, from one on, spend beyond levels; when they move.

    Seconds beyond each level have a row for each column, and then so have their integrals.
    """
    columns, end, moving, longest = len(spent) // 2, times[len(times) - 1], len(times), 0.0
    spent[:, :] = 0.0
    for sample in range(len(times)):
        span = times[sample] - times[sample - 1] if sample else 0.0
        later = span * (end - times[sample] + span)
        for k in range(columns):
            size = abs(states[sample, column + k])
            if size > STILL:
                level = 0
                if size > MOVING:
                    moving = min(moving, sample)
                    level = 1 + int(PARTS * size) if size < 1.0 else PARTS
                spent[k, level] += span
                spent[columns + k, level] += later
    for row in range(2 * columns):
        total = 0.0
        for level in range(LEVELS - 1, -1, -1):
            total += spent[row, level]
            longest = max(longest, total / lasted[row, level])
    return longest, moving


def lasted_until(times, states, column, lasted, spent):
    """The first sample at which columns have spent more than known times beyond a level."""
    columns, last = len(spent) // 2, len(times) - 1
    spent[:, :] = 0.0
    for sample in range(1, last):
        span = times[sample] - times[sample - 1]
        for k in range(columns):
            size, seconds, integral = abs(states[sample, column + k]), spent[k], spent[columns + k]
            for level in range(LEVELS):
                beyond = MOVING if level == 1 else max((level - 1) / PARTS, STILL)
                if size > beyond:
                    seconds[level] += span
                integral[level] += span * seconds[level]
                known = seconds[level] <= lasted[k, level]
                if not known or integral[level] > lasted[columns + k, level]:
                    return sample
    return last


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
