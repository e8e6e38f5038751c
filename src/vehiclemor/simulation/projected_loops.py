"""Reduced solution of algebraic equations along time: a compiled loop, linked with the kernels.

With q = mean + basis qh the reduced equations are W^T Phi(mean + basis qh; u) = 0: W is a constant
test basis (Petrov-Galerkin), or W = Phi_q basis, fresh in each iteration (least squares by
Gauss-Newton).  Bases are padded with zero columns to N x N, so that the compiler knows all sizes.
"""

import numpy as np

from vehiclemor.codegen.stubs import INPUTS, WORK, N, residual_tangent
from vehiclemor.simulation.newton_loops import all_below, failure, small_solve


def weighted(test, k, product, j):
    """Column k of the test basis times column j of the product."""
    total = 0.0
    for i in range(N):
        total += test[i, k] * product[i, j]
    return total


def lift(mean, basis, qh, r, q):
    """Full coordinates mean + basis qh into q."""
    for i in range(N):
        total = mean[i]
        for j in range(r):
            total += basis[i, j] * qh[j]
        q[i] = total


def projected_path(
    q_start,
    first_samples,
    means,
    bases,
    tests,
    ranks,
    least_squares,
    inputs,
    constants,
    tolerance,
    limit,
    path,
    counts,
):
    """Solve the reduced equations sample by sample, window by window.

    Window k holds the samples from first_samples[k] up to first_samples[k + 1].  The iteration
    starts from the previous sample, at the start of a window from its projection onto the new
    subspace.  Returns (status, sample) as the full-order loops do; 3 is a singular reduced matrix.
    """
    q, u, work = q_start.copy(), np.empty(INPUTS), np.empty(WORK)
    iterations = 0
    product = np.empty((N, N + 1))
    reduced = np.empty((N, N + 1))
    basis, mean, qh, step = np.empty((N, N)), np.empty(N), np.empty(N), np.empty(N)
    test = product if least_squares else np.empty((N, N + 1))
    for window in range(ranks.shape[0]):
        r = ranks[window]
        for i in range(N):
            mean[i] = means[window, i]
            for j in range(N):
                basis[i, j] = bases[window, i, j]
                if not least_squares:
                    test[i, j] = tests[window, i, j]
        for j in range(r):
            qh[j] = 0.0
            for i in range(N):
                qh[j] += basis[i, j] * (q[i] - mean[i])
        lift(mean, basis, qh, r, q)
        for sample in range(first_samples[window], first_samples[window + 1]):
            for i in range(INPUTS):
                u[i] = inputs[sample, i]
            converged = False
            for _ in range(limit):
                residual_tangent(q, u, constants, work, basis, r, product)
                iterations += 1
                for k in range(r):
                    for j in range(r):
                        reduced[k, j] = weighted(test, k, product, j)
                    reduced[k, N] = weighted(test, k, product, N)
                if not small_solve(reduced, r):
                    return 3, sample
                for j in range(r):
                    step[j] = reduced[j, N]
                    qh[j] -= step[j]
                lift(mean, basis, qh, r, q)
                if all_below(step, r, tolerance):
                    converged = True
                    break
            if not converged:
                return failure(q), sample
            for i in range(N):
                path[sample, i] = q[i]
    for kind in range(4):
        counts[kind] = iterations
    return 0, inputs.shape[0]
