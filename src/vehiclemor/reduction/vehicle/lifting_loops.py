"""What the lifting of a reduced vehicle does along time, compiled."""

import math

from vehiclemor.codegen.loop_types import Int, IntVector, Matrix, Vector
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.path_loops import kernel_path, lane_path

# What has decayed to this part of what it was is nothing.
NOTHING = 1e-14
# Parts of a range in which time is counted, and below which nothing moves.
LEVELS, MOVING = 8, 0.02


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
    m, modes, step, whole, left = inputs.shape[1], len(rates), math.nan, 0.0, 1.0
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
            if left > NOTHING * whole:
                a, b = factors[k, 0] * a - factors[k, 1] * b, factors[k, 0] * b + factors[k, 1] * a
            else:
                a, b = 0.0, 0.0
            result[sample, m + 2 * k], result[sample, m + 2 * k + 1] = a, b
            reached = max(reached, abs(a), abs(b))
        whole, left = max(whole, reached), reached
    return 0


def lifted(
    path: Matrix,
    inputs: Matrix,
    kernel: IntVector,
    constants: Vector,
    states: Matrix,
    largest: Vector,
    first: IntVector,
) -> Int:
    """States by a kernel for `LANES` samples, or for one on shorter paths.

    Of the columns behind the states also the largest magnitude, and the first sample above 1.
    """
    if len(path) < LANES:
        kernel_path(path, inputs, kernel, constants, states)
    else:
        lane_path(path, inputs, kernel, constants, states)
    column = states.shape[1] - len(largest)
    for k in range(len(largest)):
        largest[k], first[k] = 0.0, len(states)
    for sample in range(len(states)):
        for k in range(len(largest)):
            size = abs(states[sample, column + k])
            if size > largest[k]:
                if size > 1.0 and not largest[k] > 1.0:
                    first[k] = sample
                largest[k] = size
    return 0


def durations(
    times: Vector, states: Matrix, column: Int, lasted: Matrix, spent: Matrix, told: Vector
) -> Int:
    """How long columns, from one on, are beyond each level, and that time's integral up to the end.

    Both have a row for each column, the integrals the later ones.  Told is the largest part spent
    of what is known to have lasted, and the first time at which a column moves.
    """
    columns, end = len(spent) // 2, times[len(times) - 1]
    told[0], told[1] = 0.0, math.inf
    for row in range(2 * columns):
        for level in range(LEVELS):
            spent[row, level] = 0.0
    for sample in range(len(times)):
        span = times[sample] - times[sample - 1] if sample else 0.0
        later = span * (end - times[sample] + span)
        for k in range(columns):
            size = abs(states[sample, column + k])
            if size > MOVING:
                told[1] = min(told[1], times[sample])
                level = int(LEVELS * size) if size < 1.0 else LEVELS - 1
                spent[k, level] += span
                spent[columns + k, level] += later
    for row in range(2 * columns):
        total = 0.0
        for level in range(LEVELS - 1, -1, -1):
            total += spent[row, level]
            told[0] = max(told[0], total / lasted[row, level])
    return 0
