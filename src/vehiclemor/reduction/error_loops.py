"""Corrections of a run by the full equations, window by window: a compiled loop; see `error_model`.

What goes through it, and how it is laid out, see `error_arguments`.
"""

import math

from vehiclemor.codegen.loop_types import Float, Int, call_lanes, rows_product
from vehiclemor.codegen.operations import LANES
from vehiclemor.reduction.error_arguments import (
    BEGIN,
    DECAY,
    END,
    RATES,
    Bounded,
    ModesOfErrors,
    Path,
    Scratch,
    Shape,
    Violated,
)
from vehiclemor.simulation.path_loops import evaluate

INLINED = (
    *("begin_with", "shape_of", "turn", "slopes", "slope", "integral", "place"),
    *("guess", "full_rates", "modal_sources", "propagate", "correct", "change_shapes"),
    *("step_real_parts", "step_pairs", "judge"),
)
# Of these no argument overlaps one that is written.
DISJOINT = "step_real_parts", "step_pairs"
# A change that is larger has gone to infinity, as one that is no number has.
LARGEST = 1e9
# Least range of a coordinate of the shape, in which changes are measured (m, rad, m/s, rad/s).
LEAST_RANGE = 1e-3


def corrected_run(
    path: Path,
    violated: Violated,
    shape: Shape,
    modes: ModesOfErrors,
    most: Int,
    settled: Float,
    scratch: Scratch,
    bounded: Bounded,
) -> Int:
    """Correct states of a run, and write the errors of its bounded outputs.

    At most so many passes are made of a window; a change that is smaller than the settled one, in
    ranges of the coordinates, ends them.  Returned is the number of windows that were not settled,
    or minus one if a correction has gone to infinity.
    """
    begin_with(path, violated, shape, modes, scratch)
    nodes, unsettled = len(path.run), 0
    for first in range(0, nodes, LANES):
        end = min(first + LANES, nodes)
        guess(first, end, modes, scratch)
        change, expected = 0.0, LARGEST
        for _ in range(most):
            full_rates(first, end, shape, violated, scratch)
            modal_sources(first, modes, scratch)
            before = change
            for i in range(first, end):
                propagate(i, modes, scratch)
            change = correct(first, end, shape, modes, scratch)
            if not change < LARGEST:
                return -1
            # The next change, if each is smaller than the one before by the same factor.
            expected = change * change / before if change < before else change
            if expected < settled:
                break
        if expected >= settled:
            unsettled += 1
    place(path, shape, scratch)
    judge(path, bounded)
    return unsettled


def judge(path, bounded):
    """Write the largest or the root mean square error of each bounded output, in its bound."""
    evaluate(path.run, path.inputs, bounded.outputs, bounded.own)
    evaluate(path.corrected, path.inputs, bounded.outputs, bounded.full)
    nodes = len(path.run)
    for k in range(len(bounded.bounds)):
        column, largest, squares = bounded.outputs.columns[k], 0.0, 0.0
        for i in range(nodes):
            if column >= 0:
                error = path.run[i, column] - path.corrected[i, column]
            else:
                error = bounded.own[i, -1 - column] - bounded.full[i, -1 - column]
            largest = max(largest, abs(error))
            squares += error * error
        size = largest if bounded.is_peak[k] else math.sqrt(squares / nodes)
        # Also of an output that is no number somewhere.
        bounded.errors[k] = size / bounded.bounds[k] if squares < math.inf else math.inf


def begin_with(path, violated, shape, modes, scratch):
    """Shapes of a run and their slopes, the error at the start, and ranges."""
    run, inputs = path.run, path.inputs
    shapes, scale, moved = scratch.shapes, scratch.scale, scratch.moved[0]
    nodes, n = run.shape
    scratch.slopes[nodes:] = 0.0
    for i in range(len(shapes)):
        # Of the last window further nodes are like the last one.
        k = min(i, nodes - 1)
        for j in range(inputs.shape[1]):
            scratch.inputs[i, j] = inputs[k, j]
        shape_of(run[k], shape, scratch.rates[i], shapes[i])
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
        scale[j] = 1.0 / max(scale[j] - moved[j], LEAST_RANGE)
    slopes(shapes[:nodes], path.step, scratch.slopes)
    for i in range(len(violated.shapes)):
        for j in range(n):
            shapes[i, j] += violated.shapes[i, j]
            scratch.slopes[i, j] += violated.slopes[i, j]
    shape_of(path.start, shape, scratch.rates[0], moved)
    for k in range(len(scratch.settled)):
        scratch.settled[k] = violated.motion[k]
    errors = scratch.errors[0]
    errors[:] = 0.0
    for j in range(n):
        deviation, row = moved[j] - shapes[0, j], modes.coordinates[j]
        for k in range(len(scratch.settled)):
            scratch.settled[k] += deviation * modes.settling[j, k]
        for k in range(len(modes.slow)):
            errors[k] += deviation * row[k] * modes.slow[k]


def shape_of(state, shape, turned, deviation):
    """Deviation of the shape of a state from straight running; `turned` is room for a state."""
    heading = state[shape.planar[0]]
    turn(state, shape, math.cos(heading), -math.sin(heading), turned)
    for j in range(len(state)):
        deviation[j] = 0.0
    for j in shape.indices:
        deviation[j] = turned[j] - shape.reference[j]


def turn(state, shape, cosine, sine, turned):
    """A state whose pairs of components turn."""
    for j in range(len(state)):
        turned[j] = state[j]
    for p in range(len(shape.pairs)):
        a, b = shape.pairs[p, 0], shape.pairs[p, 1]
        one, other = state[a], state[b]
        turned[a] = cosine * one - sine * other
        turned[b] = sine * one + cosine * other


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


def place(path, shape, scratch):
    """Write the states of corrected shapes, with heading and position by quadratures."""
    step, start, result = path.step, path.start, path.corrected
    motion, states = scratch.motion[: len(result)], scratch.states
    heading, x, y = shape.planar[0], shape.planar[1], shape.planar[2]
    turned, ahead, aside = scratch.settled[0], scratch.settled[1], scratch.settled[2]
    for i in range(len(states)):
        state, deviation = states[i], scratch.shapes[i]
        for j in range(len(state)):
            state[j] = shape.reference[j] + deviation[j]
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
    for i in range(len(result)):
        state = states[i]
        turn(state, shape, math.cos(state[heading]), math.sin(state[heading]), result[i])


def guess(first, end, modes, scratch):
    """At first what drives the errors is guessed to stay as it is at the end of the last window."""
    shift = modes.changes.shape[0] - len(modes.slow)
    for i in range(first, end):
        errors, sources = scratch.errors[i], scratch.sources[i]
        if i:
            errors[:] = 0.0
        for k in range(len(modes.slow)):
            sources[k] = scratch.sources[i - 1, k] if first else 0.0
        propagate(i, modes, scratch)
        scratch.changes[i, :shift] = 0.0
        for k in range(len(modes.slow)):
            scratch.changes[i, shift + k] = errors[k]
    change_shapes(first, end, modes, scratch)


def full_rates(first, end, shape, violated, scratch):
    """Rates of the states at the nodes of a window, and violations of the constraints."""
    states, rates = scratch.states, scratch.rates
    for i in range(first, first + LANES):
        state, deviation = states[i], scratch.shapes[i]
        for j in range(len(state)):
            state[j] = shape.reference[j] + deviation[j]
    call_lanes(shape.kernels, 0, states, scratch.inputs, shape.constants, rates, first)
    count = violated.violations.shape[1]
    if count:
        call_lanes(
            shape.kernels, 1, states, scratch.inputs, shape.constants, scratch.changes, first
        )
    for i in range(first, min(end, len(violated.violations))):
        for k in range(count):
            scratch.changes[i, k] -= violated.violations[i, k]
    heading = shape.planar[0]
    for i in range(first, first + LANES):
        rate, state = rates[i], states[i]
        for p in range(len(shape.pairs)):
            # Components in a frame that turns.
            a, b = shape.pairs[p, 0], shape.pairs[p, 1]
            rate[a] += rate[heading] * state[b]
            rate[b] -= rate[heading] * state[a]


def modal_sources(first, modes, scratch):
    """What drives the errors at the nodes of a window, in modes."""
    weights = modes.weights
    count = weights.shape[1]
    pairs = len(modes.slow) - count
    for i in range(LANES):
        rates, slope_of_path = scratch.rates[first + i], scratch.slopes[first + i]
        left = scratch.left[i]
        for j in range(len(left)):
            left[j] = rates[j] - slope_of_path[j]
    rows_product(scratch.left, 0, modes.coordinates, scratch.sources, first)
    for i in range(first, first + LANES):
        into, errors = scratch.sources[i], scratch.errors[i]
        for k in range(count):
            into[k] -= weights[RATES, k] * errors[k]
        for k in range(pairs):
            m = count + k
            into[k] += weights[RATES + 1, k] * errors[m]
            into[m] -= weights[RATES, k] * errors[m] + weights[RATES + 1, k] * errors[k]


def propagate(i, modes, scratch):
    """The error at a node from that at the one before it; and its change since the last pass."""
    count, shift = modes.weights.shape[1], modes.changes.shape[0] - len(modes.slow)
    change, errors = scratch.changes[i, shift:], scratch.errors[i]
    if i == 0:
        change[:] = 0.0
        return
    for k in range(len(change)):
        change[k] = errors[k]
    pairs = len(change) - count
    before, begin, end = scratch.errors[i - 1], scratch.sources[i - 1], scratch.sources[i]
    real, imaginary = errors[:count], errors[count : count + pairs]
    step_real_parts(real, before, begin, end, modes.weights)
    step_pairs(
        real,
        imaginary,
        (before, before[count:]),
        (begin, begin[count:]),
        (end, end[count:]),
        modes.weights,
    )
    for k in range(len(change)):
        change[k] = errors[k] - change[k]


def step_real_parts(errors, before, begin, end, weights):
    """Real parts of errors from those at the node before, as if modes were real."""
    for k in range(len(errors)):
        part = weights[DECAY, k] * before[k] + weights[BEGIN, k] * begin[k]
        errors[k] = part + weights[END, k] * end[k]


def step_pairs(real, imaginary, before, begin, end, weights):
    """What pairs of modes add to real parts of errors, and imaginary parts."""
    for k in range(len(imaginary)):
        real[k] -= (
            weights[DECAY + 1, k] * before[1][k]
            + weights[BEGIN + 1, k] * begin[1][k]
            + weights[END + 1, k] * end[1][k]
        )
    for k in range(len(imaginary)):
        imaginary[k] = (
            (weights[DECAY, k] * before[1][k] + weights[DECAY + 1, k] * before[0][k])
            + (weights[BEGIN, k] * begin[1][k] + weights[BEGIN + 1, k] * begin[0][k])
            + (weights[END, k] * end[1][k] + weights[END + 1, k] * end[0][k])
        )


def correct(first, end, shape, modes, scratch):
    """Change the shapes of a window, and write motions; the largest change in its range."""
    change_shapes(first, end, modes, scratch)
    largest, change = scratch.largest, 0.0
    for j in range(len(largest)):
        part = largest[j] * scratch.scale[j]
        # Also one that is no number.
        change = change if part <= change else part
    for i in range(first, end):
        rates, moved = scratch.rates[i], scratch.moved[i - first]
        for k in range(len(shape.planar)):
            scratch.motion[i, k] = rates[shape.planar[k]] + moved[len(largest) + k]
    return change


def change_shapes(first, end, modes, scratch):
    """Add what changes are of shapes; the largest one of each coordinate of the shape."""
    rows_product(scratch.changes, first, modes.changes, scratch.moved, 0)
    largest = scratch.largest
    largest[:] = 0.0
    for i in range(first, end):
        moved, into = scratch.moved[i - first], scratch.shapes[i]
        for j in range(len(largest)):
            into[j] += moved[j]
            largest[j] = max(largest[j], abs(moved[j]))
