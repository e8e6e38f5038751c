"""The time loop of structures, compiled: one sparse solution and a few port forces a step.

Generalised-alpha method of J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993), 371-375.  With
k = d e - alpha_f q, products with K follow from the factored matrix S = c_m M + c_d E + kappa K:

    q_next = k / kappa + S^-1 (M m + E e) + S^-1 B ((1 - alpha_f) f_next + alpha_f f)

where m, e and k are combinations of q, q' and q''.  Newton's method runs in the port forces alone.
"""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import (
    Float,
    Int,
    IntVector,
    Matrix,
    Vector,
    call_kernel,
    matrix,
    vector,
)

FINISHED, NOT_FINITE, NO_CONVERGENCE = range(3)
# Places of the counts of a run.
STEPS, PORT_EVALUATIONS, LINEAR_SOLVES = range(3)
# Newton's method ends where no force changes by more than this part of the largest static one.
CLOSE = 1e-10
MOST_ITERATIONS = 40
# Rows of the state: coordinates, rates, accelerations.
Q, V, A = range(3)
# Rows of the work space.
WORK_ROWS = 4
# Rows of what is known at the ports.
DEFLECTION, RATE, ACCELERATION, FORCE, NEXT_FORCE, FREE, FREE_RATE, STEP = range(8)
PORT_ROWS = 8


class Columns(NamedTuple):
    """A sparse matrix by columns, each in pieces of consecutive rows.

    Attributes
    ----------
    pieces
        First piece of each column and, last, their number (columns + 1,).
    rows
        First row of each piece, then the place of its first value (2 (pieces + 1),).
    values
        Entries, piece by piece.
    """

    pieces: IntVector
    rows: IntVector
    values: Vector


class Weights(NamedTuple):
    """Coefficients of the method for one step size h, see `structural.weights_of`.

    Attributes
    ----------
    slope, rate_rate, rate_acceleration
        Next rate: of the change of a coordinate, of its rate and of its acceleration.
    change, change_rate, change_acceleration
        Next acceleration, in the same order.
    mass_position, mass_rate, mass_acceleration
        m, of q, q' and q''.
    damped_position, damped_rate, damped_acceleration
        e, in the same order.
    mass_share, damping_share, stiffness_share
        c_m / kappa, c_d / kappa, 1 / kappa.
    after, before, earlier
        1 - alpha_f, alpha_f, alpha_f / (1 - alpha_f).
    damping_time
        d of the structure.
    """

    slope: Float
    rate_rate: Float
    rate_acceleration: Float
    change: Float
    change_rate: Float
    change_acceleration: Float
    mass_position: Float
    mass_rate: Float
    mass_acceleration: Float
    damped_position: Float
    damped_rate: Float
    damped_acceleration: Float
    mass_share: Float
    damping_share: Float
    stiffness_share: Float
    after: Float
    before: Float
    earlier: Float
    damping_time: Float


class Marching(NamedTuple):
    """A structure with one step size.

    Attributes
    ----------
    mass, damping, factor, ports
        M, E, L of S = L D L' without its diagonal, and B; rows and columns in the order of L.
    pivots
        Diagonal (n,) of D, inverted.
    response
        S^-1 B (n, p).
    compliance
        B' S^-1 B (1 - alpha_f), (p, p).
    weights
        Coefficients of the method.
    law
        Address of the kernel of the port forces.
    constants
        Hoisted constants of the law.
    static
        Deflections and forces at the static state (2, p).
    positions, rates, accelerations, forces
        Cq', Cv', Ca' (n, outputs) and Cf' (p, outputs).
    """

    mass: Columns
    damping: Columns
    factor: Columns
    ports: Columns
    pivots: Vector
    response: Matrix
    compliance: Matrix
    weights: Weights
    law: IntVector
    constants: Vector
    static: Matrix
    positions: Columns
    rates: Columns
    accelerations: Columns
    forces: Columns


def add_product(a, x, y):
    """Add a x to y."""
    for j in range(len(a.pieces) - 1):
        factor = x[j]
        if factor != 0.0:
            for piece in range(a.pieces[j], a.pieces[j + 1]):
                row, first = a.rows[2 * piece], a.rows[2 * piece + 1]
                for k in range(a.rows[2 * piece + 3] - first):
                    y[row + k] += a.values[first + k] * factor


def column_product(a, j, x):
    """Column j of a times x."""
    total = 0.0
    for piece in range(a.pieces[j], a.pieces[j + 1]):
        row, first = a.rows[2 * piece], a.rows[2 * piece + 1]
        size = a.rows[2 * piece + 3] - first
        s0 = s1 = s2 = s3 = 0.0
        k = 0
        while k + 3 < size:
            s0 += a.values[first + k] * x[row + k]
            s1 += a.values[first + k + 1] * x[row + k + 1]
            s2 += a.values[first + k + 2] * x[row + k + 2]
            s3 += a.values[first + k + 3] * x[row + k + 3]
            k += 4
        while k < size:
            s0 += a.values[first + k] * x[row + k]
            k += 1
        total += (s0 + s2) + (s1 + s3)
    return total


def solve(system, x):
    """Solve S x = b in place, S = L D L'."""
    low, n = system.factor, len(x)
    for j in range(n):
        factor = x[j]
        for piece in range(low.pieces[j], low.pieces[j + 1]):
            row, first = low.rows[2 * piece], low.rows[2 * piece + 1]
            for k in range(low.rows[2 * piece + 3] - first):
                x[row + k] -= low.values[first + k] * factor
    for j in range(n - 1, -1, -1):
        x[j] = x[j] * system.pivots[j] - column_product(low, j, x)


def law(system, deflections, rates, inputs, x, result):
    """Port forces beyond the static ones, with derivatives (p, 3)."""
    p = len(result)
    for i in range(p):
        x[i] = system.static[0, i] + deflections[i]
        x[p + i] = rates[i]
    call_kernel(system.law, 0, x, inputs, system.constants, result)
    for i in range(p):
        result[i, 0] -= system.static[1, i]


def port_forces(system, ports, inputs, scratch, square, result):
    """Newton's method for the next port forces; iterations, negative where it has failed."""
    p = len(system.compliance)
    free, slope = ports[FREE], system.weights.slope
    next_force, scale = ports[NEXT_FORCE], 1.0
    for i in range(p):
        scale = max(scale, abs(system.static[1, i]))
        next_force[i] = ports[FORCE, i]
    for iteration in range(1, MOST_ITERATIONS + 1):
        for i in range(p):
            moved = 0.0
            for j in range(p):
                moved += system.compliance[i, j] * next_force[j]
            scratch[i] = free[i] + moved
            scratch[p + i] = ports[FREE_RATE, i] + slope * moved
        law(system, scratch, scratch[p:], inputs, scratch[2 * p :], result)
        # (I - (f_w + slope f_w') P) step = law - force
        for i in range(p):
            stiffness = result[i, 1] + slope * result[i, 2]
            for j in range(p):
                square[i, j] = -stiffness * system.compliance[i, j]
            square[i, i] += 1.0
            square[i, p] = result[i, 0] - next_force[i]
        eliminate(square, p)
        largest = 0.0
        for i in range(p):
            next_force[i] += square[i, p]
            largest = max(largest, abs(square[i, p]))
        if not math.isfinite(largest):
            return -iteration
        if largest <= CLOSE * scale:
            return iteration
    return -MOST_ITERATIONS


def eliminate(a, size):
    """Solve the square block of a for its last column, which the solution replaces."""
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, size + 1):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, size):
            factor = a[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, size + 1):
                    a[i, j] -= factor * a[k, j]
    for k in range(size - 1, -1, -1):
        total = a[k, size]
        for j in range(k + 1, size):
            total -= a[k, j] * a[j, size]
        a[k, size] = total / a[k, k]


def write_outputs(system, state, forces, row):
    """Outputs of a state; the forces are those beyond the static ones."""
    for j in range(len(row)):
        total = column_product(system.positions, j, state[Q])
        total += column_product(system.rates, j, state[V])
        total += column_product(system.accelerations, j, state[A])
        total += column_product(system.forces, j, forces)
        row[j] = total + column_product(system.forces, j, system.static[1])


def begin_ports(system, state, ports, inputs, scratch, result):
    """What is known at the ports of a state."""
    for i in range(len(system.compliance)):
        ports[DEFLECTION, i] = column_product(system.ports, i, state[Q])
        ports[RATE, i] = column_product(system.ports, i, state[V])
        ports[ACCELERATION, i] = column_product(system.ports, i, state[A])
    law(system, ports[DEFLECTION], ports[RATE], inputs, scratch, result)
    for i in range(len(system.compliance)):
        ports[FORCE, i] = result[i, 0]


def advance(system, state, ports, work, inputs, buffers, counts):
    """One step of the state and of what is known at the ports; one of the reasons above."""
    scratch, square, result = buffers
    n, p, w = state.shape[1], len(system.compliance), system.weights
    mixed, damped, solved = work[0], work[1], work[2]
    q, v, a = state[Q], state[V], state[A]
    for i in range(n):
        e = w.damped_position * q[i] - w.damped_rate * v[i] - w.damped_acceleration * a[i]
        k = w.damping_time * e - w.before * q[i]
        mixed[i] = w.mass_position * q[i] + w.mass_rate * v[i] + w.mass_acceleration * a[i] - w.mass_share * k
        damped[i] = e - w.damping_share * k
        # Until it is solved for, what stands beside the solution.
        solved[i] = 0.0
        work[3, i] = w.stiffness_share * k
    add_product(system.mass, mixed, solved)
    add_product(system.damping, damped, solved)
    solve(system, solved)
    for i in range(n):
        solved[i] += work[3, i]
    for i in range(p):
        free = column_product(system.ports, i, solved)
        for j in range(p):
            free += w.earlier * system.compliance[i, j] * ports[FORCE, j]
        ports[FREE, i] = free
        ports[FREE_RATE, i] = next_rate(w, free - ports[DEFLECTION, i], ports[RATE, i], ports[ACCELERATION, i])
    iterations = port_forces(system, ports, inputs, scratch, square, result)
    counts[STEPS] += 1
    counts[LINEAR_SOLVES] += 1
    counts[PORT_EVALUATIONS] += abs(iterations)
    for i in range(p):
        ports[STEP, i] = w.after * ports[NEXT_FORCE, i] + w.before * ports[FORCE, i]
    for i in range(n):
        total = solved[i]
        for j in range(p):
            total += system.response[i, j] * ports[STEP, j]
        change = total - q[i]
        rate, acceleration = v[i], a[i]
        v[i] = next_rate(w, change, rate, acceleration)
        a[i] = next_acceleration(w, change, rate, acceleration)
        q[i] = total
    for i in range(p):
        total = ports[FREE, i]
        for j in range(p):
            total += system.compliance[i, j] * ports[NEXT_FORCE, j]
        change = total - ports[DEFLECTION, i]
        rate, acceleration = ports[RATE, i], ports[ACCELERATION, i]
        ports[RATE, i] = next_rate(w, change, rate, acceleration)
        ports[ACCELERATION, i] = next_acceleration(w, change, rate, acceleration)
        ports[DEFLECTION, i], ports[FORCE, i] = total, ports[NEXT_FORCE, i]
    if iterations < 0:
        return NO_CONVERGENCE
    return FINISHED if math.isfinite(q[0]) else NOT_FINITE


def next_rate(w, change, rate, acceleration):
    """Rate at the end of a step in which a coordinate changes so much."""
    return w.slope * change + w.rate_rate * rate + w.rate_acceleration * acceleration


def next_acceleration(w, change, rate, acceleration):
    """Acceleration at the end of such a step."""
    return w.change * change - w.change_rate * rate - w.change_acceleration * acceleration


def march(
    system: Marching,
    state: Matrix,
    inputs: Matrix,
    every: Int,
    histories: Matrix,
    states: Matrix,
    buffer: Vector,
    counts: IntVector,
) -> Int:
    """Outputs (samples, outputs) at every so many steps, from a state (3, n), which moves along.

    Inputs are those at all steps (steps + 1, inputs).  Coordinates (samples, n) are recorded where
    `states` has rows.  Gives one of the reasons above; samples that are not reached stay as they
    are.
    """
    n, p = state.shape[1], len(system.compliance)
    work = matrix(buffer, 0, WORK_ROWS, n)
    ports = matrix(buffer, WORK_ROWS * n, PORT_ROWS, p)
    first = WORK_ROWS * n + PORT_ROWS * p
    scratch = vector(buffer, first, 4 * p)
    square = matrix(buffer, first + 4 * p, p, p + 1)
    result = matrix(buffer, first + 4 * p + p * (p + 1), p, 3)
    buffers = scratch, square, result
    begin_ports(system, state, ports, inputs[0], scratch, result)
    for sample in range(len(histories)):
        write_outputs(system, state, ports[FORCE], histories[sample])
        if len(states):
            for i in range(n):
                states[sample, i] = state[Q, i]
        if sample + 1 < len(histories):
            for step in range(sample * every + 1, (sample + 1) * every + 1):
                reason = advance(system, state, ports, work, inputs[step], buffers, counts)
                if reason != FINISHED:
                    return reason
    return FINISHED
