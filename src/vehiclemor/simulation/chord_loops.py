"""Full-order solution along time by the chord method: a compiled loop with the kernels inlined."""

from vehiclemor.codegen.loop_types import Int, Matrix, Vector, matrix, vector
from vehiclemor.simulation.newton_loops import (
    CONVERGED,
    CORRECTION,
    INPUTS,
    OFF_BRANCH,
    SAMPLE,
    Iteration,
    Mechanism,
    N,
    Solution,
    all_below,
    approach,
    increments,
    largest_of,
    residual,
    residual_jacobian,
    scratch,
    small_solve,
    stopped,
    within,
)

# Largest ratio of the first two corrections: the same inverse across a fold can't contract.
CHORD_CONTRACTION = 0.5
INLINED = ("chord",)


def chord(q, u, constants, inverse, iteration, step, phi):
    """Simplified iteration from q, which it changes: evaluations, negative where it has failed."""
    bound = CORRECTION
    for count in range(1, iteration.limit + 1):
        residual(q, u, constants, phi)
        for i in range(N):
            step[i] = 0.0
        for j in range(N):
            for i in range(N):
                step[i] += inverse[j, i] * phi[j]
        for i in range(N):
            q[i] -= step[i]
        if all_below(step, N, iteration.tolerance):
            return count
        if count <= 2:
            largest = largest_of(step)
            if not largest <= bound:
                return -count
            bound = CHORD_CONTRACTION * largest
    return -iteration.limit


def chord_path(
    mechanism: Mechanism,
    inputs: Matrix,
    inverse_t: Matrix,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Chord method: one constant inverse Jacobian, started from a quadratic extrapolation in time.

    `inverse_t` is the transposed inverse Jacobian at the design position.  Only the residual is
    evaluated.  The extrapolation assumes equidistant samples; where they are not, it is just a
    worse start.  One of higher order would start nearer, but multiplies the errors of earlier
    samples by more than one iteration takes away (15 times, cubic, against 7).

    A sample at which the iteration does not contract is tried again with the inverse at the sample
    before, which is then kept; if that fails too, it is solved as by `newton_path`.
    """
    path, counts = solution.path, solution.counts
    start, constants = mechanism.start, mechanism.constants
    q, u, previous, target, work = scratch(start, buffer)
    first = 4 * N + 3 * INPUTS + N * (N + 1)
    phi, inverse = vector(buffer, first - N, N), matrix(buffer, first, N, N)
    for j in range(N):
        for i in range(N):
            inverse[j, i] = inverse_t[j, i]
    evaluations, jacobians, smooth, status = 0, 1, 0, CONVERGED
    for sample in range(inputs.shape[0]):
        counts[SAMPLE] = sample
        for i in range(INPUTS):
            target[i] = inputs[sample, i]
        substeps = increments(previous, target, iteration.largest_increment)
        # An extrapolation over a jump of the input could end on another branch.
        smooth = smooth + 1 if substeps == 1 else 0
        if smooth > 3:
            for i in range(N):
                q[i] = 3.0 * (path[sample - 1, i] - path[sample - 2, i]) + path[sample - 3, i]
        taken = 0
        for attempt in range(2):
            if attempt == 1:
                for i in range(N):
                    q[i] = path[sample - 1, i] if sample else start[i]
                jacobians += 1
                if not inverted(q, previous, constants, work.full, inverse):
                    break
            for substep in range(1, substeps + 1):
                for i in range(INPUTS):
                    u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
                taken = chord(q, u, constants, inverse, iteration, work.step, phi)
                evaluations += abs(taken)
                if taken < 0:
                    break
            if taken > 0:
                break
        if taken < 0:
            taken = approach(q, u, target, mechanism, iteration, work)
            evaluations += abs(taken)
            jacobians += abs(taken)
        if taken < 0 or not within(q, mechanism.stops):
            status = OFF_BRANCH
            break
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    return stopped(counts, evaluations, jacobians, status)


def inverted(q, u, constants, full, inverse):
    """Transposed inverse of the Jacobian at a position; False if it is singular."""
    for j in range(N):
        residual_jacobian(q, u, constants, full)
        for i in range(N):
            full[i, N] = 1.0 if i == j else 0.0
        if not small_solve(full, N):
            return False
        for i in range(N):
            inverse[j, i] = full[i, N]
    return True
