"""Corrections of a run by the full equations, window by window: a compiled loop.

See `error_model`.  Modal coordinates stand in rows, real parts of all modes first, then imaginary
ones.
"""

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

INLINED = ("guess", "full_rates", "modal_sources", "propagate", "correct")
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

    The correction (2 c, n) meets violations of constraints; velocity (3, n) gives psi', U, V.
    """

    coordinates: Matrix
    shapes: Matrix
    weights: Matrix
    correction: Matrix
    velocity: Matrix


class Passes(NamedTuple):
    """Nodes of a window, passes that are made of it at most, and the change that ends them.

    Changes of the shape are measured in its scale (n,).
    """

    window: Int
    most: Int
    settled: Float
    scale: Vector


class Scratch(NamedTuple):
    """Room for states, rates, violations of all nodes; sources and errors in modes; one change."""

    states: Matrix
    rates: Matrix
    violations: Matrix
    sources: Matrix
    errors: Matrix
    change: Vector
    moved: Vector


def corrected_run(
    inputs: Matrix,
    path_rates: Matrix,
    shape: Shape,
    equations: FullEquations,
    modes: ModesOfErrors,
    passes: Passes,
    scratch: Scratch,
    corrected: Matrix,
    motion: Matrix,
) -> Int:
    """Correct shapes (nodes, n), and write psi', U, V (nodes, 3) of them.

    The error at the first node stands in its row of the scratch's errors.  Returned is the number
    of windows that were not settled, or minus one if a correction has gone to infinity.
    """
    nodes, begin, unsettled = len(corrected), 0, 0
    while begin < nodes - 1:
        end = min(begin + passes.window, nodes)
        if nodes - end < LANES:
            end = nodes
        first = begin + 1 if begin else 0
        guess(begin, first, end, modes.shapes, scratch, corrected)
        change = 0.0
        for _ in range(passes.most):
            full_rates(first, end, corrected, inputs, shape, equations, scratch)
            modal_sources(begin, end, path_rates, shape, modes, scratch)
            change = 0.0
            for i in range(first, end):
                propagate(i, modes.weights, scratch)
                largest = correct(i, shape, modes, passes, scratch, corrected, motion)
                if not largest < LARGEST:
                    return -1
                change = max(change, largest)
            if change < passes.settled:
                break
        if change >= passes.settled:
            unsettled += 1
        begin = end - 1 if end < nodes else end
    return unsettled


def guess(begin, first, end, shapes, scratch, corrected):
    """The error at the beginning of a window is a first guess of that at its other nodes."""
    known = scratch.errors[begin]
    for i in range(first, end):
        errors, into = scratch.errors[i], corrected[i]
        for k in range(len(known)):
            errors[k] = known[k]
            row = shapes[k]
            for j in range(len(into)):
                into[j] += known[k] * row[j]


def full_rates(first, end, corrected, inputs, shape, equations, scratch):
    """Rates of the states at the nodes of a window, and violations of the constraints."""
    n = len(shape.indices)
    for i in range(first, end):
        state, deviation = scratch.states[i], corrected[i]
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


def modal_sources(begin, end, path_rates, shape, modes, scratch):
    """What drives the errors at the nodes of a window, in modes."""
    count, heading = modes.weights.shape[1], shape.planar[0]
    for i in range(begin, end):
        rates, state, into = scratch.rates[i], scratch.states[i], scratch.sources[i]
        errors, path = scratch.errors[i], path_rates[i]
        turn = rates[heading]
        for p in range(len(shape.pairs)):
            # Components in a frame that turns.
            a, b = shape.pairs[p, 0], shape.pairs[p, 1]
            if i > begin or begin == 0:
                rates[a] += turn * state[b]
                rates[b] -= turn * state[a]
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


def correct(i, shape, modes, passes, scratch, corrected, motion):
    """Change the shape at a node, and write its motion; how much it changes in its scale."""
    rates, violations, change = scratch.rates[i], scratch.violations[i], scratch.change
    moved, into, largest = scratch.moved, corrected[i], 0.0
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
        largest = max(largest, abs(moved[j]) / passes.scale[j])
        if moved[j] != moved[j]:
            return INFINITE
    for k in range(len(shape.planar)):
        velocity = rates[shape.planar[k]]
        for j in range(len(moved)):
            velocity += modes.velocity[k, j] * moved[j]
        motion[i, k] = velocity
    return largest
