"""Newton's method for Phi(q; u(t)) = 0 with the samples in vector lanes: a compiled loop.

A run is cut into as many parts as a vector has lanes.  All parts go from the design position to
their first sample, then along their samples, side by side: a kernel gives the steps of all of them
at once.  Where one does not converge as it must on the branch, see `newton_loops`, the loop gives
up: the caller solves sample by sample.
"""

from vehiclemor.codegen.loop_types import Int, IntVector, Matrix, Vector, call_lanes, matrix, vector
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.dense_solves import small_solve
from vehiclemor.simulation.newton.newton_loops import (
    CERTAIN,
    CONTRACTION,
    CONVERGED,
    CORRECTION,
    INPUTS,
    OFF_BRANCH,
    Iteration,
    Mechanism,
    N,
    Solution,
    all_below,
    largest_of,
    residual_jacobian,
    stopped,
    within,
)

# Places of the kernels: Newton steps, outputs.
STEP, RESULTS = range(2)
# Steps from the design position to the first samples.  They grow evenly, so that each begins at an
# extrapolation that is as good as between samples.
WAY = 16
INLINED = ("corrected", "extrapolated")


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
        if count == 1:
            first = largest_of(most)
            if not first <= CORRECTION:
                return -count
        elif count == 2:
            second = largest_of(most)
            if not second <= CONTRACTION * first:
                return -count
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
