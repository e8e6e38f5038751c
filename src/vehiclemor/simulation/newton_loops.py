"""Full-order solution of Phi(q; u(t)) = 0 along time: compiled loops for all mechanisms.

Every entry returns why it has stopped, and writes the sample at which to `Solution.counts`.

A solution is on the branch of the design position if it is joined to it by steps of the inputs in
each of which Newton's method contracts: then it is the only one near, and the Jacobian is regular
on the way (Newton-Kantorovich; P. Deuflhard, Newton Methods for Nonlinear Problems, 2011, sections
2.1 and 5.1).  The first two corrections only estimate that.  Beside a fold they can be small by
chance, so that the sign of the Jacobian's determinant is looked at too, but where they are tiny.

With the samples in vector lanes a run is cut into as many parts as a vector has lanes.  All parts
go from the design position to their first sample, then along their samples, side by side: a kernel
gives the steps of all of them at once.  Where one does not converge as it must on the branch, the
loop gives up: the caller solves sample by sample.
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
    call_lanes,
    matrix,
    vector,
)
from vehiclemor.codegen.operations import LANES
from vehiclemor.simulation.integrators.dense_solves import small_solve

CONVERGED, TOO_MANY_ITERATIONS, NOT_FINITE, SINGULAR, OFF_BRANCH = range(5)
# Index of the sample at which a loop has stopped, behind `trajectory.ALGEBRAIC_COUNTS`.
SAMPLE = 4
# Largest first correction (rad or m), and largest ratio of the second to it, on the branch.
CORRECTION, CONTRACTION = 0.1, 1.0 / 16.0
# A second correction (rad or m) below which the iteration can't have crossed a fold.
CERTAIN = 1e-5
# Substeps that an increment is cut into at most; beyond, any mechanism is torn apart.
MOST_SUBSTEPS = 1e4
# Indices of a mechanism's kernels: the Newton step Phi_q^-1 Phi by straight-line elimination; the
# Jacobian beside the residual.
STEP, JACOBIAN = range(2)
# Indices of the kernels that take several samples at once.
LANE_STEP, LANE_OUTPUTS = range(2)
# Steps from the design position to the first samples.  They grow evenly, so that each begins at an
# extrapolation that is as good as between samples.
WAY = 16


class Iteration(NamedTuple):
    """When an iteration ends.

    The largest component of the last step is below the tolerance, after so many iterations for a
    sample at most.  A step of the input is cut into substeps above the largest increment; below the
    shortest step the way to a position is given up.
    """

    tolerance: Float
    limit: Int
    largest_increment: Float
    shortest_step: Float = 0.0


class Mechanism(NamedTuple):
    """Equations of a mechanism with n coordinates.

    They are solved from coordinates (n,) of the design position, where the inputs are zero.  Stops
    are the largest magnitudes (n,) of coordinates.  Kernels are addresses by index, see above, and
    take the constants.  The orientation is the sign of the Jacobian's determinant at the design
    position: it changes at a fold.
    """

    start: Vector
    stops: Vector
    constants: Vector
    kernels: IntVector
    orientation: Int


class Samples(NamedTuple):
    """Inputs at the samples (samples, inputs)."""

    inputs: Matrix


class Work(NamedTuple):
    """Scratch space: step (n,), coordinates to return to (n,), Jacobian and residual (n, n + 1)."""

    step: Vector
    saved: Vector
    full: Matrix


class Solution(NamedTuple):
    """Coordinates (samples, n) that a loop writes, and its counts (5,) by index, see above."""

    path: Matrix
    counts: IntVector


# Short functions: their arrays would cost as much to pass as they take.
INLINED = (
    *("all_below", "failure", "increments", "scratch", "newton", "largest_of", "stopped"),
    *("within", "corrected", "extrapolated"),
)


def increments(u, target, largest):
    """Number of substeps from inputs u to target, none longer than `largest`."""
    distance = 0.0
    for i in range(len(target)):
        distance = max(distance, abs(target[i] - u[i]))
    if distance <= largest:
        return 1
    return math.ceil(min(distance / largest, MOST_SUBSTEPS) - 1e-9)


def all_below(step, size, tolerance):
    """Whether the first entries of a step are all below a tolerance; no if one is no number."""
    below = True
    for i in range(size):
        below &= abs(step[i]) < tolerance
    return below


def largest_of(step):
    """Magnitude of the largest component of a step."""
    largest = 0.0
    for i in range(len(step)):
        largest = max(largest, abs(step[i]))
    return largest


def failure(q):
    """Status of an iteration that has used up its limit."""
    for i in range(len(q)):
        if not math.isfinite(q[i]):
            return NOT_FINITE
    return TOO_MANY_ITERATIONS


def stopped(counts, iterations, status):
    """Status of a loop that ends; writes its counts, each of which an iteration raises by one."""
    for count in range(SAMPLE):
        counts[count] = iterations
    return status


def newton(q, u, mechanism, iteration, work):
    """Newton's method from q, which it changes: its iterations, negative where it has failed."""
    n, constants, step, full = len(q), mechanism.constants, work.step, work.full
    first, second = 0.0, 0.0
    for count in range(1, iteration.limit + 1):
        call_kernel(mechanism.kernels, STEP, q, u, constants, step)
        for i in range(n):
            q[i] -= step[i]
        if all_below(step, n, iteration.tolerance):
            if second <= CERTAIN:
                return count
            call_kernel(mechanism.kernels, JACOBIAN, q, u, constants, full)
            same = small_solve(full, n) == mechanism.orientation
            return count + 1 if same else -count - 1
        if count <= 2:
            size = largest_of(step)
            if not size <= (CORRECTION if count == 1 else CONTRACTION * first):
                return -count
            first, second = (size, second) if count == 1 else (first, size)
    return -iteration.limit


def moved(q, u, index, target, mechanism, iteration, work):
    """Move one input of a solved position to a target in steps that stay on the branch: iterations.

    They are negative where not even the shortest step goes further, since the end of the branch or
    a stop is near: q and u are then those of the last position.
    """
    n = len(q)
    length, iterations = iteration.largest_increment, 0
    while u[index] != target:
        before = u[index]
        for i in range(n):
            work.saved[i] = q[i]
        u[index] = target
        if abs(target - before) > length:
            u[index] = before + math.copysign(length, target - before)
        count = newton(q, u, mechanism, iteration, work)
        iterations += abs(count)
        if count > 0 and within(q, mechanism.stops):
            length = min(2.0 * length, iteration.largest_increment)
            continue
        length = 0.5 * abs(u[index] - before)
        u[index] = before
        for i in range(n):
            q[i] = work.saved[i]
        if not length >= iteration.shortest_step:
            return -iterations
    return iterations


def within(q, stops):
    """Whether no coordinate is beyond its stop."""
    inside = True
    for i in range(len(q)):
        inside &= abs(q[i]) <= stops[i]
    return inside


def approach(q, u, target, mechanism, iteration, work):
    """Move the inputs from the design position to a target one by one, the height last: iterations.

    They are negative where the branch ends before.
    """
    for i in range(len(q)):
        q[i] = mechanism.start[i]
    for i in range(len(u)):
        u[i] = 0.0
    iterations = 0
    for index in range(len(u) - 1, -1, -1):
        count = moved(q, u, index, target[index], mechanism, iteration, work)
        iterations += abs(count)
        if count < 0:
            return -iterations
    return iterations


def newton_path(
    mechanism: Mechanism, inputs: Matrix, iteration: Iteration, solution: Solution, buffer: Vector
) -> Int:
    """Newton's method with a fresh Jacobian in every iteration, started at the previous sample.

    Inputs begin at zero.  An increment above the largest is cut into substeps.  Where Newton's
    method does not contract, the sample is approached from the design position instead.
    """
    path, counts = solution.path, solution.counts
    q, u, previous, work = scratch(mechanism.start, inputs.shape[1], buffer)
    iterations = 0
    for sample in range(len(inputs)):
        counts[SAMPLE] = sample
        target = inputs[sample]
        substeps = increments(previous, target, iteration.largest_increment)
        for substep in range(1, substeps + 1):
            for i in range(len(u)):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            count = newton(q, u, mechanism, iteration, work)
            iterations += abs(count)
            if count < 0:
                count = approach(q, u, target, mechanism, iteration, work)
                iterations += abs(count)
                if count < 0:
                    return stopped(counts, iterations, OFF_BRANCH)
                break
        if not within(q, mechanism.stops):
            return stopped(counts, iterations, OFF_BRANCH)
        previous = target
        for i in range(len(q)):
            path[sample, i] = q[i]
    return stopped(counts, iterations, CONVERGED)


def travel_limit(
    mechanism: Mechanism, target: Vector, iteration: Iteration, reached: Vector, buffer: Vector
) -> Int:
    """How far the branch goes to a target, see `approach`; `reached` are the inputs at its end."""
    q, u, _, work = scratch(mechanism.start, len(target), buffer)
    approach(q, u, target, mechanism, iteration, work)
    for i in range(len(u)):
        reached[i] = u[i]
    return CONVERGED


def scratch(start, inputs, buffer):
    """Coordinates; inputs now and at the previous sample; scratch space of Newton.

    They are parts of the buffer.  Coordinates and inputs are those of the design position.
    """
    n = len(start)
    q, step, saved = vector(buffer, 0, n), vector(buffer, n, n), vector(buffer, 2 * n, n)
    full = matrix(buffer, 3 * n, n, n + 1)
    first = 3 * n + n * (n + 1)
    u, previous = vector(buffer, first, inputs), vector(buffer, first + inputs, inputs)
    for i in range(n):
        q[i] = start[i]
    for i in range(inputs):
        u[i], previous[i] = 0.0, 0.0
    return q, u, previous, Work(step, saved, full)


def same_side(q, u, mechanism, full):
    """Whether no lane has passed a fold: there the Jacobian's determinant changes its sign."""
    same = True
    for lane in range(len(q)):
        call_kernel(mechanism.kernels, JACOBIAN, q[lane], u[lane], mechanism.constants, full)
        same &= small_solve(full, q.shape[1]) == mechanism.orientation
    return same


def corrected(positions, u, mechanism, lane_kernels, iteration, work):
    """Newton's method in all lanes, which changes the positions: steps, negative if one failed."""
    n, size, constants = len(mechanism.start), len(positions), mechanism.constants
    q = matrix(positions, 0, LANES, n)
    step, full = matrix(work, 0, LANES, n), matrix(work, size, n, n + 1)
    steps = vector(work, 0, size)
    first, second = 0.0, 0.0
    for count in range(1, iteration.limit + 1):
        call_lanes(lane_kernels, LANE_STEP, q, u, constants, step, 0)
        for i in range(size):
            positions[i] -= steps[i]
        if all_below(steps, size, iteration.tolerance):
            return count if second <= CERTAIN or same_side(q, u, mechanism, full) else -count
        if count <= 2:
            largest = largest_of(steps)
            if not largest <= (CORRECTION if count == 1 else CONTRACTION * first):
                return -count
            first, second = (largest, second) if count == 1 else (first, largest)
    return -iteration.limit


def extrapolated(q, first, second, third, known):
    """Where the next iteration begins, from as many positions as are known."""
    for i in range(len(q)):
        third[i] = second[i]
        second[i] = first[i]
        first[i] = q[i]
        if known == 2:
            q[i] = 2.0 * first[i] - second[i]
        elif known > 2:
            q[i] = 3.0 * (first[i] - second[i]) + third[i]


def lane_path(
    mechanism: Mechanism,
    inputs: Matrix,
    lane_kernels: IntVector,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Path of coordinates and outputs side by side; there are as many samples as lanes at least.

    Each iteration begins at a quadratic extrapolation in time.  The last part overlaps the one
    before it.
    """
    path, counts = solution.path, solution.counts
    samples, n = len(inputs), len(mechanism.start)
    size, columns = n * LANES, path.shape[1] - n
    q, positions = matrix(buffer, 0, LANES, n), vector(buffer, 0, size)
    first, second = vector(buffer, size, size), vector(buffer, 2 * size, size)
    third = vector(buffer, 3 * size, size)
    u = matrix(buffer, 4 * size, LANES, inputs.shape[1])
    offset = 4 * size + LANES * inputs.shape[1]
    results = matrix(buffer, offset, LANES, columns)
    work = vector(buffer, offset + LANES * columns, size + n * (n + 1))
    length = -(-samples // LANES)
    for lane in range(LANES):
        for i in range(n):
            q[lane, i] = mechanism.start[i]
    iterations, known, inside = 0, 1, True
    for step in range(1 - WAY, length):
        share = (min(step, 0) + WAY) / WAY
        for lane in range(LANES):
            sample = min(lane * length, samples - length) + max(step, 0)
            for i in range(u.shape[1]):
                u[lane, i] = share * share * inputs[sample, i]
        # From there on it is time that goes evenly.
        known = 1 if step == 1 else known
        extrapolated(positions, first, second, third, known)
        known += 1
        count = corrected(positions, u, mechanism, lane_kernels, iteration, work)
        iterations += abs(count) * LANES
        if count < 0:
            return stopped(counts, iterations, OFF_BRANCH)
        if step < 0:
            continue
        call_lanes(lane_kernels, LANE_OUTPUTS, q, u, mechanism.constants, results, 0)
        for lane in range(LANES):
            sample = min(lane * length, samples - length) + step
            inside &= within(q[lane], mechanism.stops)
            for i in range(n):
                path[sample, i] = q[lane, i]
            for i in range(columns):
                path[sample, n + i] = results[lane, i]
    return stopped(counts, iterations, CONVERGED if inside else OFF_BRANCH)
