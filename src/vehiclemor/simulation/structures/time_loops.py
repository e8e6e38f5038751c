"""The time loop of structures, compiled: one sparse solution and a few port forces a step.

Generalised-alpha method of J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993), 371-375.  With
k = d e - alpha_f q, products with K follow from the matrix S = c_m M + c_d W W' + kappa K:

    q_next = k / kappa + S^-1 (M m + W W'e) + S^-1 B ((1 - alpha_f) f_next + alpha_f f)

where m, e and k are combinations of q, q' and q''.  R = S without its dampers W is factored: of a
structure in modal coordinates it is diagonal.  What the dampers add follows by the formula of
Sherman, Morrison and Woodbury; Newton's method runs in the port forces alone.

The method's q'' is of first order, that of alpha_f - alpha_m steps before (M. Arnold, O. Bruls,
Multibody Syst. Dyn. 18 (2007), 185-202); outputs are of second order.
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
from vehiclemor.simulation.integrators.dense_solves import small_solve
from vehiclemor.simulation.structures.sparse_loops import (
    Blocks,
    Columns,
    add_product,
    column_product,
    solve,
)

FINISHED, NOT_FINITE, NO_CONVERGENCE = range(3)
# Places of the counts of a run.
STEPS, PORT_EVALUATIONS, LINEAR_SOLVES = range(3)
# Newton's method ends with a step in which no force changes by more than this part of the largest
# static one: what is left then is of the order of its square.
CLOSE = 1e-6
MOST_ITERATIONS = 40
# Rows of the state: coordinates, rates, accelerations.
Q, V, A = range(3)
# Rows of the work space.
WORK_ROWS = 5
# Rows of what is known at the ports.
DEFLECTION, RATE, ACCELERATION, FORCE, NEXT_FORCE, FREE, FREE_RATE, STEP = range(8)
PORT_ROWS = 8


class Weights(NamedTuple):
    """Coefficients of the method for one step size h, see `system.weights_of`.

    The next rate is that of `slope` times the change of a coordinate, `rate_rate` of its rate and
    `rate_acceleration` of its acceleration; the next acceleration follows from `change...` in the
    same order, m from `mass_...` and e from `damped_...` of q, q' and q''.  The shares are c_m,
    c_d and 1 over kappa; after, before and earlier 1 - alpha_f, alpha_f and their ratio.
    Accelerations of the method are those `lag` = alpha_f - alpha_m steps before.
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
    lag: Float


class StepMatrices(NamedTuple):
    """A structure with one step size.

    M, L of R = L D L' without its diagonal, B and W side by side, rows in the order of L; D (n,)
    inverted; S^-1 B and R^-1 W by rows (p + k, n); B' S^-1 B (1 - alpha_f), (p, p); I - T W'R^-1 W
    and T = c_d (I + c_d W'R^-1 W)^-1, (k, k); coefficients of the method; address and hoisted
    constants of the law of the ports; deflections and forces at the static state (2, p); Cq', Cv',
    Ca' (n, outputs) and Cf' (p, outputs).
    """

    mass: Columns
    factor: Blocks
    ports: Columns
    pivots: Vector
    response: Matrix
    compliance: Matrix
    undamped: Matrix
    damping: Matrix
    weights: Weights
    law: IntVector
    constants: Vector
    static: Matrix
    positions: Columns
    rates: Columns
    accelerations: Columns
    forces: Columns


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
            scratch[i] = 0.0
        for j in range(p):
            add_row(system.compliance[j], next_force[j], scratch[:p])
        for i in range(p):
            scratch[p + i] = ports[FREE_RATE, i] + slope * scratch[i]
            scratch[i] += free[i]
        law(system, scratch, scratch[p:], inputs, scratch[2 * p :], result)
        # (I - (f_w + slope f_w') P) step = law - force
        for i in range(p):
            stiffness = result[i, 1] + slope * result[i, 2]
            for j in range(p):
                square[i, j] = -stiffness * system.compliance[i, j]
            square[i, i] += 1.0
            square[i, p] = result[i, 0] - next_force[i]
        if not small_solve(square, p):
            return -iteration
        largest = 0.0
        for i in range(p):
            next_force[i] += square[i, p]
            largest = max(largest, abs(square[i, p]))
        if not math.isfinite(largest):
            return -iteration
        if largest <= CLOSE * scale:
            return iteration
    return -MOST_ITERATIONS


def write_accelerations(system, state, row):
    """Part of the outputs that accelerations are, as the method has them."""
    for j in range(len(row)):
        row[j] = column_product(system.accelerations, j, state[A])


def write_outputs(system, state, forces, before, row):
    """Outputs of a state; the forces are those beyond the static ones.

    Accelerations lag: `before` is what a step before they were, from which they are extrapolated.
    """
    for j in range(len(row)):
        total = column_product(system.positions, j, state[Q])
        total += column_product(system.rates, j, state[V])
        lagging = column_product(system.accelerations, j, state[A])
        total += lagging + system.weights.lag * (lagging - before[j])
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
    mixed, damped, solved, beside = work[0], work[1], work[2], work[3]
    q, v, a = state[Q], state[V], state[A]
    for i in range(n):
        e = w.damped_position * q[i] - w.damped_rate * v[i] - w.damped_acceleration * a[i]
        k = w.damping_time * e - w.before * q[i]
        m = w.mass_position * q[i] + w.mass_rate * v[i] + w.mass_acceleration * a[i]
        mixed[i] = m - w.mass_share * k
        damped[i] = e - w.damping_share * k
        beside[i] = w.stiffness_share * k
        solved[i] = 0.0
    add_product(system.mass, mixed, solved)
    solve(system.factor, system.pivots, solved, work[4])
    for k in range(len(system.damping)):
        scratch[k] = column_product(system.ports, p + k, damped)
        scratch[len(system.damping) + k] = column_product(system.ports, p + k, solved)
    for i in range(n):
        solved[i] += beside[i]
    for k in range(len(system.damping)):
        factor = 0.0
        for j in range(len(system.damping)):
            factor += system.undamped[k, j] * scratch[j]
            factor -= system.damping[k, j] * scratch[len(system.damping) + j]
        add_row(system.response[p + k], factor, solved)
    for i in range(p):
        ports[FREE, i] = column_product(system.ports, i, solved)
    for j in range(p):
        add_row(system.compliance[j], w.earlier * ports[FORCE, j], ports[FREE])
    for i in range(p):
        change = ports[FREE, i] - ports[DEFLECTION, i]
        ports[FREE_RATE, i] = next_rate(w, change, ports[RATE, i], ports[ACCELERATION, i])
    iterations = port_forces(system, ports, inputs, scratch, square, result)
    counts[STEPS] += 1
    counts[LINEAR_SOLVES] += 1
    counts[PORT_EVALUATIONS] += abs(iterations)
    for j in range(p):
        force = w.after * ports[NEXT_FORCE, j] + w.before * ports[FORCE, j]
        add_row(system.response[j], force, solved)
        add_row(system.compliance[j], ports[NEXT_FORCE, j], ports[FREE])
    move(w, q, v, a, solved)
    move(w, ports[DEFLECTION], ports[RATE], ports[ACCELERATION], ports[FREE])
    for i in range(p):
        ports[FORCE, i] = ports[NEXT_FORCE, i]
    if iterations < 0:
        return NO_CONVERGENCE
    return FINISHED if math.isfinite(q[0]) else NOT_FINITE


def add_row(row, factor, total):
    """Add a row times a factor."""
    for i in range(len(total)):
        total[i] += factor * row[i]


def move(w, q, v, a, ends):
    """Replace coordinates, rates and accelerations by those at the end of a step."""
    for i in range(len(q)):
        change, rate, acceleration = ends[i] - q[i], v[i], a[i]
        v[i] = next_rate(w, change, rate, acceleration)
        a[i] = w.change * change - w.change_rate * rate - w.change_acceleration * acceleration
        q[i] = ends[i]


def next_rate(w, change, rate, acceleration):
    """Rate at the end of a step in which a coordinate changes so much."""
    return w.slope * change + w.rate_rate * rate + w.rate_acceleration * acceleration


def integrate(
    system: StepMatrices,
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
    n, p, dampers = state.shape[1], len(system.compliance), len(system.damping)
    work = matrix(buffer, 0, WORK_ROWS, n)
    ports = matrix(buffer, WORK_ROWS * n, PORT_ROWS, p)
    first = WORK_ROWS * n + PORT_ROWS * p
    square = matrix(buffer, first, p, p + 1)
    result = matrix(buffer, first + p * (p + 1), p, 3)
    scratch = vector(buffer, first + p * (p + 4), 4 * p + 2 * dampers)
    before = vector(buffer, first + p * (p + 8) + 2 * dampers, histories.shape[1])
    buffers = scratch, square, result
    write_accelerations(system, state, before)
    begin_ports(system, state, ports, inputs[0], scratch, result)
    for sample in range(len(histories)):
        write_outputs(system, state, ports[FORCE], before, histories[sample])
        if len(states):
            for i in range(n):
                states[sample, i] = state[Q, i]
        if sample + 1 < len(histories):
            last = (sample + 1) * every
            for step in range(sample * every + 1, last + 1):
                if step == last:
                    write_accelerations(system, state, before)
                reason = advance(system, state, ports, work, inputs[step], buffers, counts)
                if reason != FINISHED:
                    return reason
    return FINISHED
