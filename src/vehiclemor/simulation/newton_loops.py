"""Full-order solution of Phi(q; u(t)) = 0 along time: compiled loops with the kernels inlined.

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
    call_lanes,
    matrix,
    vector,
)
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.dense_solves import small_solve

CONVERGED, TOO_MANY_ITERATIONS, NOT_FINITE, SINGULAR, OFF_BRANCH = range(5)
# Places of the counts; behind them the sample at which a loop has stopped.
ITERATIONS, RESIDUALS, JACOBIANS, LINEAR_SOLVES, SAMPLE = range(5)
# Largest first correction (rad or m), and largest ratio of the second to it, on the branch.
CORRECTION, CONTRACTION = 0.1, 1.0 / 16.0
# A second correction (rad or m) below which the iteration can't have crossed a fold.
CERTAIN = 1e-5
# Substeps that an increment is cut into at most; beyond, any mechanism is torn apart.
MOST_SUBSTEPS = 1e4
# Places of the kernels: Newton steps, outputs.
STEP, RESULTS = range(2)
# Steps from the design position to the first samples.  They grow evenly, so that each begins at an
# extrapolation that is as good as between samples.
WAY = 16
# Sizes that the compiler knows: coordinates, inputs.
N, INPUTS = 0, 0


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
    """What is solved.

    It starts at coordinates (N,) of the design position, where the inputs are zero.  Stops are the
    largest magnitudes (N,) of coordinates, constants those of the kernels.  The orientation is the
    sign of the Jacobian's determinant at the design position: it changes at a fold.
    """

    start: Vector
    stops: Vector
    constants: Vector
    orientation: Int


class Samples(NamedTuple):
    """Inputs at the samples (samples, INPUTS), to be made ready once."""

    inputs: Matrix


class Work(NamedTuple):
    """Scratch space: a step (N,), coordinates to return to (N,), a matrix (N, N + 1)."""

    step: Vector
    kept: Vector
    full: Matrix


class Solution(NamedTuple):
    """Where a solution is recorded: coordinates (samples, n), counts by place (5,), see above."""

    path: Matrix
    counts: IntVector


# Short functions: their arrays would cost as much to pass as they take.
INLINED = (
    *("all_below", "failure", "increments", "scratch", "newton", "largest_of", "stopped"),
    *("within", "corrected", "extrapolated"),
)


def residual_jacobian(q: Vector, u: Vector, constants: Vector, result: Matrix) -> None:
    """Jacobian into result[:, :N], residual into result[:, N]: a kernel that stands in the loop."""


def newton_step(q: Vector, u: Vector, constants: Vector, result: Vector) -> None:
    """Newton step Phi_q^-1 Phi into result (N,), by straight-line elimination."""


def increments(u, target, largest):
    """Number of substeps from inputs u to target, none longer than `largest`."""
    distance = 0.0
    for i in range(INPUTS):
        distance = max(distance, abs(target[i] - u[i]))
    if distance <= largest:
        return 1
    return math.ceil(min(distance / largest, MOST_SUBSTEPS) - 1e-9)


def all_below(step, size, tolerance):
    """Whether the first entries of a step are all below a tolerance; never if one is no number."""
    below = True
    for i in range(size):
        below &= abs(step[i]) < tolerance
    return below


def largest_of(step):
    """Magnitude of the largest component (N,) of a step."""
    largest = 0.0
    for i in range(N):
        largest = max(largest, abs(step[i]))
    return largest


def failure(q):
    """Status of an iteration that has used up its limit."""
    for i in range(N):
        if not math.isfinite(q[i]):
            return NOT_FINITE
    return TOO_MANY_ITERATIONS


def stopped(counts, iterations, jacobians, status):
    """The status of a loop that ends, its counts written down."""
    counts[ITERATIONS], counts[RESIDUALS], counts[LINEAR_SOLVES] = (
        iterations,
        iterations,
        iterations,
    )
    counts[JACOBIANS] = jacobians
    return status


def newton(q, u, mechanism, iteration, work):
    """Newton's method from q, which it changes: its iterations, negative where it has failed."""
    constants, step, full = mechanism.constants, work.step, work.full
    first, second = 0.0, 0.0
    for count in range(1, iteration.limit + 1):
        newton_step(q, u, constants, step)
        for i in range(N):
            q[i] -= step[i]
        if all_below(step, N, iteration.tolerance):
            if second <= CERTAIN:
                return count
            residual_jacobian(q, u, constants, full)
            same = small_solve(full, N) == mechanism.orientation
            return count + 1 if same else -count - 1
        if count <= 2:
            size = largest_of(step)
            if not size <= (CORRECTION if count == 1 else CONTRACTION * first):
                return -count
            first, second = (size, second) if count == 1 else (first, size)
    return -iteration.limit


def moved(q, u, place, target, mechanism, iteration, work):
    """Move one input of a solved position to a target in steps that stay on the branch: iterations.

    They are negative where not even the shortest step goes further, since the branch or a stop is
    near: q and u are then those of the last position.
    """
    length, iterations = iteration.largest_increment, 0
    while u[place] != target:
        before = u[place]
        for i in range(N):
            work.kept[i] = q[i]
        u[place] = target
        if abs(target - before) > length:
            u[place] = before + math.copysign(length, target - before)
        taken = newton(q, u, mechanism, iteration, work)
        iterations += abs(taken)
        if taken > 0 and within(q, mechanism.stops):
            length = min(2.0 * length, iteration.largest_increment)
            continue
        length = 0.5 * abs(u[place] - before)
        u[place] = before
        for i in range(N):
            q[i] = work.kept[i]
        if not length >= iteration.shortest_step:
            return -iterations
    return iterations


def within(q, stops):
    """Whether no coordinate is beyond its stop."""
    inside = True
    for i in range(N):
        inside &= abs(q[i]) <= stops[i]
    return inside


def approach(q, u, target, mechanism, iteration, work):
    """From the design position to the inputs of a target, one after the other, the height last.

    Gives iterations, negative where the branch ends before.
    """
    for i in range(N):
        q[i] = mechanism.start[i]
    for i in range(INPUTS):
        u[i] = 0.0
    iterations = 0
    for place in range(INPUTS - 1, -1, -1):
        taken = moved(q, u, place, target[place], mechanism, iteration, work)
        iterations += abs(taken)
        if taken < 0:
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
    q, u, previous, target, work = scratch(mechanism.start, buffer)
    iterations = 0
    for sample in range(inputs.shape[0]):
        counts[SAMPLE] = sample
        for i in range(INPUTS):
            target[i] = inputs[sample, i]
        substeps = increments(previous, target, iteration.largest_increment)
        for substep in range(1, substeps + 1):
            for i in range(INPUTS):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            taken = newton(q, u, mechanism, iteration, work)
            iterations += abs(taken)
            if taken < 0:
                taken = approach(q, u, target, mechanism, iteration, work)
                iterations += abs(taken)
                if taken < 0:
                    return stopped(counts, iterations, iterations, OFF_BRANCH)
                break
        if not within(q, mechanism.stops):
            return stopped(counts, iterations, iterations, OFF_BRANCH)
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    return stopped(counts, iterations, iterations, CONVERGED)


def travel_limit(
    mechanism: Mechanism, target: Vector, iteration: Iteration, reached: Vector, buffer: Vector
) -> Int:
    """How far the branch goes to a target, one input after the other, the height last.

    `reached` are the inputs (INPUTS,) at which it ends; the status is that of all inputs but the
    height.
    """
    q, u, _, _, work = scratch(mechanism.start, buffer)
    status = CONVERGED
    for place in range(INPUTS - 1, -1, -1):
        if moved(q, u, place, target[place], mechanism, iteration, work) < 0 and place:
            status = OFF_BRANCH
            break
    for i in range(INPUTS):
        reached[i] = u[i]
    return status


def scratch(start, buffer):
    """Coordinates and inputs of a loop: now, at the sample before, at the next; what it works in.

    They are parts of the buffer, set to the design position.
    """
    q, step, kept = vector(buffer, 0, N), vector(buffer, N, N), vector(buffer, 2 * N, N)
    full = matrix(buffer, 3 * N, N, N + 1)
    first = 3 * N + N * (N + 1)
    u, previous = vector(buffer, first, INPUTS), vector(buffer, first + INPUTS, INPUTS)
    for i in range(N):
        q[i] = start[i]
    for i in range(INPUTS):
        u[i], previous[i] = 0.0, 0.0
    target = vector(buffer, first + 2 * INPUTS, INPUTS)
    return q, u, previous, target, Work(step, kept, full)


def corrected(q, u, mechanism, kernels, iteration, work):
    """Newton's method in all lanes from q, which it changes: steps, negative where one failed."""
    step, most = matrix(work, 0, LANES, N), vector(work, N * LANES, N)
    full = matrix(work, N * (LANES + 1), N, N + 1)
    first, second = 0.0, 0.0
    for count in range(1, iteration.limit + 1):
        call_lanes(kernels, STEP, q, u, mechanism.constants, step, 0)
        for i in range(N):
            most[i] = 0.0
        for lane in range(LANES):
            for i in range(N):
                q[lane, i] -= step[lane, i]
                change = abs(step[lane, i])
                # What is no number stays: it is below nothing.
                most[i] = most[i] if change <= most[i] else change
        if all_below(most, N, iteration.tolerance):
            for lane in range(LANES):
                if second > CERTAIN:
                    residual_jacobian(q[lane], u[lane], mechanism.constants, full)
                    if small_solve(full, N) != mechanism.orientation:
                        return -count
            return count
        if count <= 2:
            size = largest_of(most)
            if not size <= (CORRECTION if count == 1 else CONTRACTION * first):
                return -count
            first, second = (size, second) if count == 1 else (first, size)
    return -iteration.limit


def extrapolated(q, first, second, third, known):
    """Where the next iteration begins in all lanes, from as many positions as are known."""
    for lane in range(LANES):
        for i in range(N):
            third[lane, i] = second[lane, i]
            second[lane, i] = first[lane, i]
            first[lane, i] = q[lane, i]
            if known == 2:
                q[lane, i] = 2.0 * first[lane, i] - second[lane, i]
            elif known > 2:
                q[lane, i] = 3.0 * (first[lane, i] - second[lane, i]) + third[lane, i]


def lane_path(
    mechanism: Mechanism,
    inputs: Matrix,
    kernels: IntVector,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Path of coordinates and outputs side by side; there are as many samples as lanes at least.

    Each iteration begins at a quadratic extrapolation in time.  The last part overlaps the one
    before it.
    """
    path, counts = solution.path, solution.counts
    size, samples, columns = N * LANES, inputs.shape[0], path.shape[1] - N
    q, first = matrix(buffer, 0, LANES, N), matrix(buffer, size, LANES, N)
    second, third = matrix(buffer, 2 * size, LANES, N), matrix(buffer, 3 * size, LANES, N)
    u, place = matrix(buffer, 4 * size, LANES, INPUTS), 4 * size + LANES * INPUTS
    results = matrix(buffer, place, LANES, columns)
    work = vector(buffer, place + LANES * columns, N * (LANES + 1) + N * (N + 1))
    length = -(-samples // LANES)
    for lane in range(LANES):
        for i in range(N):
            q[lane, i] = mechanism.start[i]
    iterations, known, inside = 0, 1, True
    for step in range(1 - WAY, length):
        share = (min(step, 0) + WAY) / WAY
        for lane in range(LANES):
            sample = min(lane * length, samples - length) + max(step, 0)
            for i in range(INPUTS):
                u[lane, i] = share * share * inputs[sample, i]
        # From there on it is time that goes evenly.
        known = 1 if step == 1 else known
        extrapolated(q, first, second, third, known)
        known += 1
        taken = corrected(q, u, mechanism, kernels, iteration, work)
        iterations += abs(taken) * LANES
        if taken < 0:
            return stopped(counts, iterations, iterations, OFF_BRANCH)
        if step < 0:
            continue
        call_lanes(kernels, RESULTS, q, u, mechanism.constants, results, 0)
        for lane in range(LANES):
            sample = min(lane * length, samples - length) + step
            inside &= within(q[lane], mechanism.stops)
            for i in range(N):
                path[sample, i] = q[lane, i]
            for i in range(columns):
                path[sample, N + i] = results[lane, i]
    return stopped(counts, iterations, iterations, CONVERGED if inside else OFF_BRANCH)
