"""Full-order solution of Phi(q; u(t)) = 0 along time: compiled loops, linked with the kernels.

Every loop returns (status, sample): 0 and the number of samples, or why and where it stopped.
"""

import math

import numpy as np

from vehiclemor.codegen.stubs import (
    INPUTS,
    OUTPUTS,
    WORK,
    N,
    newton_step,
    outputs,
    residual,
    residual_jacobian,
)

CONVERGED = 0
TOO_MANY_ITERATIONS = 1
NOT_FINITE = 2
SINGULAR = 3


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
            return 2
    return 1


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
    q_start, u_start, inputs, constants, dense, tolerance, limit, largest, path, counts
):
    """Newton's method with a fresh Jacobian in every iteration, started at the previous sample.

    The step comes from the generated straight-line elimination or, if `dense`, from elimination
    with partial pivoting, as a solver that knows nothing about the model would do it.

    An input increment above `largest` is cut into substeps, so that the iteration can't jump to
    another branch of solutions.
    """
    q, step, work = q_start.copy(), np.empty(N), np.empty(WORK)
    u, previous, target = u_start.copy(), u_start.copy(), np.empty(INPUTS)
    full = np.empty((N, N + 1))
    iterations = 0
    for sample in range(inputs.shape[0]):
        for i in range(INPUTS):
            target[i] = inputs[sample, i]
        substeps = increments(previous, target, largest)
        for substep in range(1, substeps + 1):
            for i in range(INPUTS):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            converged = False
            for _ in range(limit):
                if dense:
                    residual_jacobian(q, u, constants, work, full)
                    if not small_solve(full, N):
                        return 3, sample
                    for i in range(N):
                        step[i] = full[i, N]
                else:
                    newton_step(q, u, constants, work, step)
                iterations += 1
                for i in range(N):
                    q[i] -= step[i]
                if all_below(step, N, tolerance):
                    converged = True
                    break
            if not converged:
                return failure(q), sample
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    for kind in range(4):
        counts[kind] = iterations
    return 0, inputs.shape[0]


def chord_path(
    q_start, u_start, inputs, constants, inverse_t, tolerance, limit, largest, path, counts
):
    """Chord method: one constant inverse Jacobian, started from a quadratic extrapolation in time.

    `inverse_t` is the transposed inverse Jacobian at the design position.  Only the residual is
    evaluated.  The extrapolation assumes equidistant samples; where they are not, it is just a
    worse start.  One of higher order would start nearer, but multiplies the errors of earlier
    samples by more than one iteration takes away (15 times, cubic, against 7).
    """
    q, phi, step, work = q_start.copy(), np.empty(N), np.empty(N), np.empty(WORK)
    u, previous, target = u_start.copy(), u_start.copy(), np.empty(INPUTS)
    evaluations, smooth = 0, 0
    for sample in range(inputs.shape[0]):
        for i in range(INPUTS):
            target[i] = inputs[sample, i]
        substeps = increments(previous, target, largest)
        # An extrapolation over a jump of the input could end on another branch.
        smooth = smooth + 1 if substeps == 1 else 0
        if smooth > 3:
            for i in range(N):
                q[i] = 3.0 * (path[sample - 1, i] - path[sample - 2, i]) + path[sample - 3, i]
        for substep in range(1, substeps + 1):
            for i in range(INPUTS):
                u[i] = previous[i] + (target[i] - previous[i]) * (substep / substeps)
            converged = False
            for _ in range(limit):
                residual(q, u, constants, work, phi)
                evaluations += 1
                for i in range(N):
                    step[i] = 0.0
                for j in range(N):
                    for i in range(N):
                        step[i] += inverse_t[j, i] * phi[j]
                for i in range(N):
                    q[i] -= step[i]
                if all_below(step, N, tolerance):
                    converged = True
                    break
            if not converged:
                return failure(q), sample
        for i in range(INPUTS):
            previous[i] = target[i]
        for i in range(N):
            path[sample, i] = q[i]
    counts[0], counts[1], counts[3] = evaluations, evaluations, evaluations
    return 0, inputs.shape[0]


def output_path(path, inputs, constants, result):
    """Outputs at every sample of a path of coordinates into result (samples, OUTPUTS)."""
    q, u, y, work = np.empty(N), np.empty(INPUTS), np.empty(OUTPUTS), np.empty(WORK)
    for sample in range(path.shape[0]):
        for i in range(N):
            q[i] = path[sample, i]
        for i in range(INPUTS):
            u[i] = inputs[sample, i]
        outputs(q, u, constants, work, y)
        for i in range(OUTPUTS):
            result[sample, i] = y[i]


def residual_path(path, inputs, constants, result):
    """Residuals at every sample of a path of coordinates into result (samples, N)."""
    q, u, phi, work = np.empty(N), np.empty(INPUTS), np.empty(N), np.empty(WORK)
    for sample in range(path.shape[0]):
        for i in range(N):
            q[i] = path[sample, i]
        for i in range(INPUTS):
            u[i] = inputs[sample, i]
        residual(q, u, constants, work, phi)
        for i in range(N):
            result[sample, i] = phi[i]
