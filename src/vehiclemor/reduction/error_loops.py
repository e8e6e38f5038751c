"""Corrections of a run by the full equations, window by window: a compiled loop.

See `error_model`.  Modal coordinates stand in rows, real parts of all modes first, then imaginary
ones.
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
    *("begin_with", "shape_of", "turn", "in_modes", "slope", "integral", "place"),
    *("guess", "full_rates", "modal_sources", "propagate", "correct"),
)
# A change that is larger has gone to infinity, as one that is no number has.
LARGEST = 1e9
INFINITE = 1e300


class Shape(NamedTuple):
    """Where the shape stands in the states (n,); heading, x, y (3,); pairs that turn (pairs, 2).

    Its values at straight running are the reference (n,).
    """

    indices: IntVector
    planar: IntVector
    pairs: IntMatrix
    reference: Vector


class FullEquations(NamedTuple):
    """Addresses of the kernels of rates and violations for lanes, and their constants."""

    kernels: IntVector
    constants: Vector


class ModesOfErrors(NamedTuple):
    """Modes: coordinates of shapes (n, 2 modes), and back (2 modes, n); weights (8, modes).

    Slow (2 modes,) is one for those that start with an error; what the others add to heading and
    place while they decay follows from the start's deviation by `settling` (n, 3).  The correction
    (2 c, n) meets violations of constraints; velocity (3, n) gives psi', U, V.
    """

    coordinates: Matrix
    shapes: Matrix
    weights: Matrix
    slow: Vector
    settling: Matrix
    correction: Matrix
    velocity: Matrix


class Passes(NamedTuple):
    """Nodes of a window, passes that are made of it at most, and the change that ends them.

    Changes of the shape are measured in the ranges of its coordinates, at least in `least`.
    """

    window: Int
    most: Int
    settled: Float
    least: Float


class Scratch(NamedTuple):
    """Room for states, rates, violations, shapes, motions of all nodes; and for some in modes.

    Further for a change in modes (2 modes,), a shape, the ranges of its coordinates (n,), and what
    a start adds to heading and place (3,).
    """

    states: Matrix
    rates: Matrix
    violations: Matrix
    shapes: Matrix
    motion: Matrix
    path_rates: Matrix
    sources: Matrix
    errors: Matrix
    change: Vector
    moved: Vector
    scale: Vector
    settled: Vector


def corrected_run(
    step: Float,
    run: Matrix,
    inputs: Matrix,
    start: Vector,
    shape: Shape,
    equations: FullEquations,
    modes: ModesOfErrors,
    passes: Passes,
    scratch: Scratch,
    result: Matrix,
) -> Int:
    """Correct states of a run (nodes, n) at nodes that are a step in s apart.

    Start (n,) is that of the full model.  Returned is the number of windows that were not settled,
    or minus one if a correction has gone to infinity.
    """
    shapes, errors = scratch.shapes, scratch.errors
    begin_with(run, start, step, shape, modes, passes, scratch)
    nodes, begin, unsettled = len(shapes), 0, 0
    while begin < nodes - 1:
        end = min(begin + passes.window, nodes)
        if nodes - end < LANES:
            end = nodes
        first = begin + 1 if begin else 0
        guess(begin, first, end, modes.shapes, errors, shapes)
        change = 0.0
        for _ in range(passes.most):
            full_rates(first, end, inputs, shape, equations, scratch)
            modal_sources(begin, end, shape, modes, scratch)
            change = 0.0
            for i in range(first, end):
                propagate(i, modes.weights, scratch)
                largest = correct(i, shape, modes, scratch)
                if not largest < LARGEST:
                    return -1
                change = max(change, largest)
            if change < passes.settled:
                break
        if change >= passes.settled:
            unsettled += 1
        begin = end - 1 if end < nodes else end
    place(step, start, shape, scratch, result)
    return unsettled


def begin_with(run, start, step, shape, modes, passes, scratch):
    """Shapes of a run, their rates in modes, the error at the start, and ranges."""
    shapes, scale, moved = scratch.shapes, scratch.scale, scratch.moved
    nodes, n = shapes.shape
    for i in range(nodes):
        shape_of(run[i], shape, scratch.states[i], shapes[i])
    for j in range(n):
        low, high = shapes[1, j], shapes[1, j]
        for i in range(2, nodes):
            low, high = min(low, shapes[i, j]), max(high, shapes[i, j])
        scale[j] = max(high - low, passes.least)
        # A method may record the start itself, through which its own motion does not pass.
        near = 4.0 * shapes[1, j] - 6.0 * shapes[2, j]
        shapes[0, j] = near + 4.0 * shapes[3, j] - shapes[4, j]
    for i in range(nodes):
        for j in range(n):
            moved[j] = slope(shapes, i, j, step)
        in_modes(moved, modes.coordinates, scratch.path_rates[i])
    shape_of(start, shape, scratch.states[0], moved)
    for j in range(n):
        moved[j] -= shapes[0, j]
    in_modes(moved, modes.coordinates, scratch.errors[0])
    in_modes(moved, modes.settling, scratch.settled)
    for k in range(len(modes.slow)):
        scratch.errors[0, k] *= modes.slow[k]
    scratch.states[:] = 0.0


def shape_of(state, shape, turned, deviation):
    """Deviation of the shape of a state from straight running; `turned` is room for a state."""
    heading = state[shape.planar[0]]
    turn(state, shape, math.cos(heading), -math.sin(heading), turned)
    for j in range(len(deviation)):
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


def in_modes(deviation, coordinates, result):
    """Modal coordinates of a deviation."""
    result[:] = 0.0
    for j in range(len(deviation)):
        part, row = deviation[j], coordinates[j]
        for k in range(len(result)):
            result[k] += part * row[k]


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


def guess(begin, first, end, shapes, modal, corrected):
    """The error at the beginning of a window is a first guess of that at its other nodes."""
    known = modal[begin]
    for i in range(first, end):
        errors, into = modal[i], corrected[i]
        for k in range(len(known)):
            errors[k] = known[k]
            row = shapes[k]
            for j in range(len(into)):
                into[j] += known[k] * row[j]


def full_rates(first, end, inputs, shape, equations, scratch):
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
        arrays = scratch.states, inputs, equations.constants
        call_lanes(equations.kernels, 0, *arrays, scratch.rates, at)
        if scratch.violations.shape[1]:
            call_lanes(equations.kernels, 1, *arrays, scratch.violations, at)
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
    count = modes.weights.shape[1]
    for i in range(begin, end):
        rates, into = scratch.rates[i], scratch.sources[i]
        errors, path = scratch.errors[i], scratch.path_rates[i]
        for k in range(count):
            real, imaginary = modes.weights[RATES, k], modes.weights[RATES + 1, k]
            a, b = errors[k], errors[count + k]
            into[k] = -path[k] - (real * a - imaginary * b)
            into[count + k] = -path[count + k] - (real * b + imaginary * a)
        for j in range(len(shape.indices)):
            rate, row = rates[shape.indices[j]], modes.coordinates[j]
            for k in range(2 * count):
                into[k] += rate * row[k]


def propagate(i, weights, scratch):
    """The error at a node from that at the one before it; and its change since the last pass."""
    count, change = weights.shape[1], scratch.change
    if i == 0:
        change[:] = 0.0
        return
    before, errors = scratch.errors[i - 1], scratch.errors[i]
    begin, end = scratch.sources[i - 1], scratch.sources[i]
    for k in range(count):
        m = count + k
        real = (
            (weights[DECAY, k] * before[k] - weights[DECAY + 1, k] * before[m])
            + (weights[BEGIN, k] * begin[k] - weights[BEGIN + 1, k] * begin[m])
            + (weights[END, k] * end[k] - weights[END + 1, k] * end[m])
        )
        imaginary = (
            (weights[DECAY, k] * before[m] + weights[DECAY + 1, k] * before[k])
            + (weights[BEGIN, k] * begin[m] + weights[BEGIN + 1, k] * begin[k])
            + (weights[END, k] * end[m] + weights[END + 1, k] * end[k])
        )
        change[k], change[m] = real - errors[k], imaginary - errors[m]
        errors[k], errors[m] = real, imaginary


def correct(i, shape, modes, scratch):
    """Change the shape at a node, and write its motion; how much it changes in its scale."""
    rates, violations, change = scratch.rates[i], scratch.violations[i], scratch.change
    moved, into, largest = scratch.moved, scratch.shapes[i], 0.0
    moved[:] = 0.0
    for k in range(len(change)):
        amount, row = change[k], modes.shapes[k]
        for j in range(len(moved)):
            moved[j] += amount * row[j]
    for k in range(len(violations)):
        amount, row = violations[k], modes.correction[k]
        for j in range(len(moved)):
            moved[j] -= amount * row[j]
    for j in range(len(moved)):
        into[j] += moved[j]
        largest = max(largest, abs(moved[j]) / scratch.scale[j])
        if moved[j] != moved[j]:
            return INFINITE
    for k in range(len(shape.planar)):
        velocity = rates[shape.planar[k]]
        for j in range(len(moved)):
            velocity += modes.velocity[k, j] * moved[j]
        scratch.motion[i, k] = velocity
    return largest
