"""Corrections of a run by the full equations, window by window: a compiled loop.

See `error_model`.  Modal coordinates stand in rows: real parts of all modes, those of pairs first,
then imaginary parts of pairs.  Rows and columns of matrices are filled up with zeros to fours.
"""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import (
    Float,
    Int,
    IntMatrix,
    IntVector,
    Matrix,
    Vector,
    call_lanes,
)
from vehiclemor.codegen.operations import LANES

# Rows of the weights of a step, real and imaginary parts by mode: of the error before it, of what
# drives the error at its beginning and at its end; then the rates of the modes.
DECAY, BEGIN, END, RATES = 0, 2, 4, 6

INLINED = (
    *("begin_with", "shape_of", "turn", "product", "slopes", "slope", "integral", "place"),
    *("guess", "full_rates", "modal_sources", "propagate", "correct"),
)
# A change that is larger has gone to infinity, as one that is no number has.
LARGEST = 1e9
INFINITE = 1e300


class Shape(NamedTuple):
    """Where the shape stands in the states (n,); heading, x, y (3,); pairs that turn (pairs, 2).

    Its values at straight running are the reference (n,).  Further addresses of the full model's
    kernels of rates and violations for lanes, and their constants.
    """

    indices: IntVector
    planar: IntVector
    pairs: IntMatrix
    reference: Vector
    kernels: IntVector
    constants: Vector


class ModesOfErrors(NamedTuple):
    """Modes: coordinates of shapes and back (rows, columns), filled up; weights (8, modes).

    Three further columns of shapes, and of the correction that meets violations of constraints,
    are changes of psi', U, V.  Slow (modal coordinates,) is one for those that start with an error;
    what the others add to heading and place while they decay follows from the start's deviation by
    `settling` (n, 3).
    """

    coordinates: Matrix
    shapes: Matrix
    weights: Matrix
    slow: Vector
    settling: Matrix
    correction: Matrix


class Violated(NamedTuple):
    """Constraints that the start violates: at some first nodes violations and rates, filled up.

    Shapes that move with them and these shapes' slopes (nodes, n), and what of heading and place
    the nodes miss (3,).
    """

    violations: Matrix
    shapes: Matrix
    slopes: Matrix
    motion: Vector


class Passes(NamedTuple):
    """Nodes of a window, passes that are made of it at most, and the change that ends them.

    Changes of the shape are measured in the ranges of its coordinates, at least in `least`.
    """

    window: Int
    most: Int
    settled: Float
    least: Float


class Scratch(NamedTuple):
    """Room for all nodes: states, their rates, violations, shapes, slopes of the path, motions.

    Then in modes, filled up, what drives errors, and the errors; further for a change of these, a
    shape and its motion, what meets violations (both filled up), one over the ranges of the
    coordinates (n,), and what a start adds to heading and place (3,).
    """

    states: Matrix
    rates: Matrix
    violations: Matrix
    shapes: Matrix
    slopes: Matrix
    motion: Matrix
    sources: Matrix
    errors: Matrix
    change: Vector
    moved: Vector
    met: Vector
    scale: Vector
    settled: Vector


def corrected_run(
    step: Float,
    run: Matrix,
    inputs: Matrix,
    start: Vector,
    violated: Violated,
    shape: Shape,
    modes: ModesOfErrors,
    passes: Passes,
    scratch: Scratch,
    result: Matrix,
) -> Int:
    """Correct states of a run (nodes, n) at nodes that are a step in s apart.

    Start (n,) is that of the full model.  Returned is the number of windows that were not settled,
    or minus one if a correction has gone to infinity.
    """
    begin_with(run, (start, violated), step, shape, modes, passes, scratch)
    nodes, begin, unsettled = len(scratch.shapes), 0, 0
    while begin < nodes - 1:
        end = min(begin + passes.window, nodes)
        if nodes - end < LANES:
            end = nodes
        first = begin + 1 if begin else 0
        guess(begin, first, end, modes, scratch)
        change, expected = 0.0, LARGEST
        for _ in range(passes.most):
            full_rates(first, end, inputs, shape, scratch)
            for i in range(first, min(end, len(violated.violations))):
                for k in range(violated.violations.shape[1]):
                    scratch.violations[i, k] -= violated.violations[i, k]
            modal_sources(begin, end, shape, modes, scratch)
            before, change = change, 0.0
            for i in range(first, end):
                propagate(i, modes, scratch)
                largest = correct(i, shape, modes, scratch)
                if not largest < LARGEST:
                    return -1
                change = max(change, largest)
            # The next change, if each is smaller than the one before by the same factor.
            expected = change * change / before if change < before else change
            if expected < passes.settled:
                break
        if expected >= passes.settled:
            unsettled += 1
        begin = end - 1 if end < nodes else end
    place(step, start, shape, scratch, result)
    return unsettled


def begin_with(run, begin, step, shape, modes, passes, scratch):
    """Shapes of a run and their slopes, the error at the start, and ranges."""
    start, violated = begin
    shapes, scale, moved = scratch.shapes, scratch.scale, scratch.moved
    nodes, n = shapes.shape
    for i in range(nodes):
        shape_of(run[i], shape, scratch.states[i], shapes[i])
    moved[:] = 0.0
    for j in range(n):
        # A method may record the first state as it was given.
        near = 4.0 * shapes[1, j] - 6.0 * shapes[2, j]
        shapes[0, j] = near + 4.0 * shapes[3, j] - shapes[4, j]
        moved[j] = scale[j] = shapes[1, j]
    for i in range(2, nodes):
        for j in range(n):
            scale[j] = max(scale[j], shapes[i, j])
            moved[j] = min(moved[j], shapes[i, j])
    for j in range(n):
        scale[j] = 1.0 / max(scale[j] - moved[j], passes.least)
    slopes(shapes, step, scratch.slopes)
    for i in range(len(violated.shapes)):
        for j in range(n):
            shapes[i, j] += violated.shapes[i, j]
            scratch.slopes[i, j] += violated.slopes[i, j]
    shape_of(start, shape, scratch.states[0], moved)
    for k in range(len(scratch.settled)):
        scratch.settled[k] = violated.motion[k]
    for j in range(n):
        moved[j] -= shapes[0, j]
        for k in range(len(scratch.settled)):
            scratch.settled[k] += moved[j] * modes.settling[j, k]
    product(modes.coordinates, moved, scratch.errors[0])
    for k in range(len(modes.slow)):
        scratch.errors[0, k] *= modes.slow[k]
    scratch.states[:] = 0.0


def shape_of(state, shape, turned, deviation):
    """Deviation of the shape of a state from straight running; `turned` is room for a state."""
    heading = state[shape.planar[0]]
    turn(state, shape, math.cos(heading), -math.sin(heading), turned)
    for j in range(len(shape.indices)):
        deviation[j] = turned[shape.indices[j]] - shape.reference[j]


def turn(state, shape, cosine, sine, turned):
    """A state whose pairs of components turn."""
    for j in range(len(state)):
        turned[j] = state[j]
    for p in range(len(shape.pairs)):
        a, b = shape.pairs[p, 0], shape.pairs[p, 1]
        one, other = state[a], state[b]
        turned[a] = cosine * one - sine * other
        turned[b] = sine * one + cosine * other


def product(matrix, values, result):
    """Linear combination of the rows of a matrix, four of them at once."""
    for k in range(len(result)):
        result[k] = 0.0
    for j in range(0, len(matrix) - 3, 4):
        a, b, c, d = values[j], values[j + 1], values[j + 2], values[j + 3]
        one, two, three, four = matrix[j], matrix[j + 1], matrix[j + 2], matrix[j + 3]
        for k in range(len(result)):
            result[k] += (a * one[k] + b * two[k]) + (c * three[k] + d * four[k])


def slopes(values, step, result):
    """Derivatives of all columns at all nodes."""
    last, scale = len(values) - 1, 1.0 / (12.0 * step)
    for i in range(2, last - 1):
        before, after, row = values[i - 1], values[i + 1], result[i]
        first, final = values[i - 2], values[i + 2]
        for j in range(len(row)):
            row[j] = scale * (8.0 * (after[j] - before[j]) - final[j] + first[j])
    for i in (0, 1, last - 1, last):
        for j in range(values.shape[1]):
            result[i, j] = slope(values, i, j, step)


def slope(values, i, j, step):
    """Derivative of a column at a node, by five nodes."""
    last = len(values) - 1
    # At the ends of a path the same backwards.
    at, sign = (i, 1.0) if i < 2 else (last - i, -1.0)
    if i >= 2 and i <= last - 2:
        inner = 8.0 * (values[i + 1, j] - values[i - 1, j])
        return (inner - values[i + 2, j] + values[i - 2, j]) / (12.0 * step)
    e, d = (0, 1) if sign > 0.0 else (last, -1)
    a, b, c = values[e, j], values[e + d, j], values[e + 2 * d, j]
    f, g = values[e + 3 * d, j], values[e + 4 * d, j]
    if at == 0:
        change = -25.0 * a + 48.0 * b - 36.0 * c + 16.0 * f - 3.0 * g
    else:
        change = -3.0 * a - 10.0 * b + 18.0 * c - 6.0 * f + g
    return sign * change / (12.0 * step)


def integral(values, j, step, first, result, into):
    """Integrals of a column from a first value on, by trapezoids that are corrected."""
    begins, total = slope(values, 0, j, step), first
    result[0, into] = first
    for i in range(1, len(values)):
        total += 0.5 * step * (values[i - 1, j] + values[i, j])
        change = slope(values, i, j, step) - begins
        result[i, into] = total - step * step / 12.0 * change


def place(step, start, shape, scratch, result):
    """Write the states of corrected shapes, with heading and position by quadratures."""
    motion, states = scratch.motion, scratch.states
    heading, x, y = shape.planar[0], shape.planar[1], shape.planar[2]
    turned, ahead, aside = scratch.settled[0], scratch.settled[1], scratch.settled[2]
    cosine, sine = math.cos(start[heading]), math.sin(start[heading])
    integral(motion, 0, step, start[heading] + turned, states, heading)
    first_x = start[x] + cosine * ahead - sine * aside
    first_y = start[y] + sine * ahead + cosine * aside
    for i in range(len(motion)):
        cosine, sine = math.cos(states[i, heading]), math.sin(states[i, heading])
        forward, sideward = motion[i, 1], motion[i, 2]
        motion[i, 1] = cosine * forward - sine * sideward
        motion[i, 2] = sine * forward + cosine * sideward
    integral(motion, 1, step, first_x, states, x)
    integral(motion, 2, step, first_y, states, y)
    for i in range(len(states)):
        state = states[i]
        for j in range(len(shape.indices)):
            state[shape.indices[j]] = shape.reference[j] + scratch.shapes[i, j]
        turn(state, shape, math.cos(state[heading]), math.sin(state[heading]), result[i])


def guess(begin, first, end, modes, scratch):
    """At first what drives the errors is guessed to stay as it is at the beginning of a window."""
    moved = scratch.moved
    for i in range(first, end):
        errors, into = scratch.errors[i], scratch.shapes[i]
        sources, known = scratch.sources[i], scratch.sources[begin]
        for k in range(len(errors)):
            sources[k] = known[k] if begin else 0.0
            errors[k] = errors[k] if i == 0 else 0.0
        propagate(i, modes, scratch)
        product(modes.shapes, errors, moved)
        for j in range(into.shape[0]):
            into[j] += moved[j]


def full_rates(first, end, inputs, shape, scratch):
    """Rates of the states at the nodes of a window, and violations of the constraints."""
    n = len(shape.indices)
    for i in range(first, end):
        state, deviation = scratch.states[i], scratch.shapes[i]
        for j in range(n):
            state[shape.indices[j]] = shape.reference[j] + deviation[j]
    last = end - LANES
    for start in range(first, end, LANES):
        # The last lanes overlap those before; of the first window all nodes are its own.
        at = max(min(start, last), 0)
        arrays = scratch.states, inputs, shape.constants
        call_lanes(shape.kernels, 0, *arrays, scratch.rates, at)
        if scratch.violations.shape[1]:
            call_lanes(shape.kernels, 1, *arrays, scratch.violations, at)
    heading = shape.planar[0]
    for i in range(first, end):
        rates, state = scratch.rates[i], scratch.states[i]
        for p in range(len(shape.pairs)):
            # Components in a frame that turns.
            a, b = shape.pairs[p, 0], shape.pairs[p, 1]
            rates[a] += rates[heading] * state[b]
            rates[b] -= rates[heading] * state[a]


def modal_sources(begin, end, shape, modes, scratch):
    """What drives the errors at the nodes of a window, in modes."""
    moved, weights = scratch.moved, modes.weights
    count = weights.shape[1]
    pairs = len(modes.slow) - count
    for i in range(begin, end):
        rates, slope_of_path = scratch.rates[i], scratch.slopes[i]
        into, errors = scratch.sources[i], scratch.errors[i]
        for j in range(len(shape.indices)):
            moved[j] = rates[shape.indices[j]] - slope_of_path[j]
        product(modes.coordinates, moved, into)
        for k in range(count):
            into[k] -= weights[RATES, k] * errors[k]
        for k in range(pairs):
            m = count + k
            into[k] += weights[RATES + 1, k] * errors[m]
            into[m] -= weights[RATES, k] * errors[m] + weights[RATES + 1, k] * errors[k]


def propagate(i, modes, scratch):
    """The error at a node from that at the one before it; and its change since the last pass."""
    weights, change = modes.weights, scratch.change
    count = weights.shape[1]
    if i == 0:
        change[:] = 0.0
        return
    before, errors = scratch.errors[i - 1], scratch.errors[i]
    begin, end = scratch.sources[i - 1], scratch.sources[i]
    for k in range(len(modes.slow)):
        change[k] = -errors[k]
    for k in range(count):
        part = weights[DECAY, k] * before[k] + weights[BEGIN, k] * begin[k]
        errors[k] = part + weights[END, k] * end[k]
    for k in range(len(modes.slow) - count):
        m = count + k
        errors[k] -= (
            weights[DECAY + 1, k] * before[m]
            + weights[BEGIN + 1, k] * begin[m]
            + weights[END + 1, k] * end[m]
        )
        errors[m] = (
            (weights[DECAY, k] * before[m] + weights[DECAY + 1, k] * before[k])
            + (weights[BEGIN, k] * begin[m] + weights[BEGIN + 1, k] * begin[k])
            + (weights[END, k] * end[m] + weights[END + 1, k] * end[k])
        )
    for k in range(len(modes.slow)):
        change[k] += errors[k]


def correct(i, shape, modes, scratch):
    """Change the shape at a node, and write its motion; how much it changes in its ranges."""
    rates, violations, change = scratch.rates[i], scratch.violations[i], scratch.change
    moved, into, largest = scratch.moved, scratch.shapes[i], 0.0
    product(modes.shapes, change, moved)
    if len(violations):
        product(modes.correction, violations, scratch.met)
    for j in range(len(moved)):
        moved[j] -= scratch.met[j]
    for j in range(len(into)):
        into[j] += moved[j]
        largest = max(largest, abs(moved[j]) * scratch.scale[j])
        if moved[j] != moved[j]:
            return INFINITE
    for k in range(len(shape.planar)):
        scratch.motion[i, k] = rates[shape.planar[k]] + moved[len(into) + k]
    return largest
