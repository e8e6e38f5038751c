"""Full-order solution of Phi(q; u(t)) = 0 along time: compiled loops with the kernels inlined.

Every entry returns why it has stopped, and writes the sample at which to `Solution.counts`.
"""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import Float, Int, IntVector, Matrix, Vector, matrix, vector

CONVERGED, TOO_MANY_ITERATIONS, NOT_FINITE, SINGULAR = range(4)
# Places of the counts; behind them the sample at which a loop has stopped.
ITERATIONS, RESIDUALS, JACOBIANS, LINEAR_SOLVES, SAMPLE = range(5)
# Sizes that the compiler knows: coordinates, inputs.
N, INPUTS = 0, 0


class Iteration(NamedTuple):
    """When an iteration ends.

    Attributes
    ----------
    tolerance
        Largest component of the last step.
    limit
        Most iterations for a sample.
    largest_increment
        Increment of an input above which its step is cut into substeps.
    """

    tolerance: Float
    limit: Int
    largest_increment: Float


class Solution(NamedTuple):
    """Where a solution is recorded.

    Attributes
    ----------
    path
        Coordinates (samples, n).
    counts
        By place, see above (5,).
    """

    path: Matrix
    counts: IntVector


# Short functions: their arrays would cost as much to pass as they take.
INLINED = ("all_below", "failure", "small_solve", "increments", "scratch")


def residual(q: Vector, u: Vector, constants: Vector, result: Vector) -> None:
    """Residual Phi(q; u) into result (N,): a kernel that stands in the loop."""


def residual_jacobian(q: Vector, u: Vector, constants: Vector, result: Matrix) -> None:
    """Jacobian into result[:, :N] and residual into result[:, N]."""


def newton_step(q: Vector, u: Vector, constants: Vector, result: Vector) -> None:
    """Newton step Phi_q^-1 Phi into result (N,), by straight-line elimination."""


def increments(u, target, largest):
    """Number of substeps from inputs u to target, none longer than `largest`."""
    distance = 0.0
    for i in range(INPUTS):
        change = abs(target[i] - u[i])
        if change > distance:
            distance = change
    if distance <= largest:
        return 1
    return math.ceil(distance / largest - 1e-9)


def all_below(step, size, tolerance):
    """Whether the first entries of a step are all below a tolerance; never if one is no number."""
    below = True
    for i in range(size):
        below &= abs(step[i]) < tolerance
    return below


def failure(q):
    """Status of an iteration that has used up its limit."""
    for i in range(N):
        if not math.isfinite(q[i]):
            return NOT_FINITE
    return TOO_MANY_ITERATIONS


def small_solve(a, r):
    """Solve the leading r x r block of a for column N by elimination with partial pivoting.

    The solution replaces column N.  False if a pivot is zero or not finite.
    """
    for k in range(r):
        pivot = k
        for i in range(k + 1, r):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if a[pivot, k] == 0.0 or not math.isfinite(a[pivot, k]):
            return False
        if pivot != k:
            for j in range(k, r):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            a[k, N], a[pivot, N] = a[pivot, N], a[k, N]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, r):
            factor = a[i, k] * inverse
            for j in range(k + 1, r):
                a[i, j] -= factor * a[k, j]
            a[i, N] -= factor * a[k, N]
    for k in range(r - 1, -1, -1):
        total = a[k, N]
        for j in range(k + 1, r):
            total -= a[k, j] * a[j, N]
        a[k, N] = total / a[k, k]
    return True


def newton_path(
    q_start: Vector,
    inputs: Matrix,
    constants: Vector,
    dense: Int,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Newton's method with a fresh Jacobian in every iteration, started at the previous sample.

    The step comes from the generated straight-line elimination or, if `dense`, from elimination
    with partial pivoting, as a solver that knows nothing about the model would do it.

    Inputs begin at zero.  An increment above the largest is cut into substeps, so that the
    iteration can't jump to another branch of solutions.
    """
    path, counts = solution.path, solution.counts
    q, step, u, previous, target = scratch(q_start, buffer)
    full = matrix(buffer, 2 * N + 3 * INPUTS, N, N + 1)
    iterations = 0
    for sample in range(inputs.shape[0]):
        counts[SAMPLE] = sample
        for i in range(INPUTS):
            target[i] = inputs[sample, i]
        substeps = increments(previous, target, iteration.largest_increment)
        for substep in range(1, substeps + 1):
            for i in range(INPUTS):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            converged = False
            for _ in range(iteration.limit):
                if dense:
                    residual_jacobian(q, u, constants, full)
                    if not small_solve(full, N):
                        return SINGULAR
                    for i in range(N):
                        step[i] = full[i, N]
                else:
                    newton_step(q, u, constants, step)
                iterations += 1
                for i in range(N):
                    q[i] -= step[i]
                if all_below(step, N, iteration.tolerance):
                    converged = True
                    break
            if not converged:
                return failure(q)
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    for kind in range(4):
        counts[kind] = iterations
    return CONVERGED


def scratch(q_start, buffer):
    """Coordinates, step and inputs in the buffer: now, at the sample before and at the next."""
    q, step = vector(buffer, 0, N), vector(buffer, N, N)
    u, previous = vector(buffer, 2 * N, INPUTS), vector(buffer, 2 * N + INPUTS, INPUTS)
    for i in range(N):
        q[i] = q_start[i]
    for i in range(INPUTS):
        u[i], previous[i] = 0.0, 0.0
    return q, step, u, previous, vector(buffer, 2 * N + 2 * INPUTS, INPUTS)


def chord_path(
    q_start: Vector,
    inputs: Matrix,
    constants: Vector,
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
    """
    path, counts = solution.path, solution.counts
    q, step, u, previous, target = scratch(q_start, buffer)
    phi = vector(buffer, 2 * N + 3 * INPUTS, N)
    evaluations, smooth = 0, 0
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
        for substep in range(1, substeps + 1):
            for i in range(INPUTS):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            converged = False
            for _ in range(iteration.limit):
                residual(q, u, constants, phi)
                evaluations += 1
                for i in range(N):
                    step[i] = 0.0
                for j in range(N):
                    for i in range(N):
                        step[i] += inverse_t[j, i] * phi[j]
                for i in range(N):
                    q[i] -= step[i]
                if all_below(step, N, iteration.tolerance):
                    converged = True
                    break
            if not converged:
                return failure(q)
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    counts[ITERATIONS], counts[RESIDUALS] = evaluations, evaluations
    counts[LINEAR_SOLVES] = evaluations
    return CONVERGED
