"""Reduced solution of algebraic equations along time: a compiled loop with the kernels inlined.

With q = mean + basis qh the reduced equations are W^T Phi(mean + basis qh; u) = 0: W is a constant
test basis (Petrov-Galerkin), or W = Phi_q basis, fresh in each iteration (least squares by
Gauss-Newton).  Bases stand by rows, padded with zeros to N x N, so that the compiler knows all
sizes.
"""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Int, IntVector, Matrix, Vector, matrix, vector
from vehiclemor.simulation.integrators.dense_solves import small_solve
from vehiclemor.simulation.newton_loops import (
    CONVERGED,
    INPUTS,
    SAMPLE,
    SINGULAR,
    Iteration,
    N,
    Solution,
    all_below,
    failure,
    stopped,
)

# Number of entries of the Jacobian that are no structural zeros.
ENTRIES = 0
INLINED = ("weigh", "decode", "tangent_product", "enter_window")


class Windows(NamedTuple):
    """Subspaces by window."""

    first_samples: IntVector  # Window k holds the samples from entry k up to entry k + 1.
    means: Matrix  # Means (windows, N).
    # Basis and test basis by rows (windows, N, N).
    bases: Cube
    tests: Cube
    ranks: IntVector  # Rows that are used (windows,).


def tangent_parts(q: Vector, u: Vector, constants: Vector, result: Vector) -> None:
    """Entries of the Jacobian, then the residual, into result (ENTRIES + N,)."""


def tangent(parts: Vector, column: Vector, result: Vector) -> None:
    """Jacobian, by its entries, times a column (N,) into result (N,)."""


def weigh(test, r, product, reduced):
    """Rows of the test basis times those of the product: the reduced equations."""
    for k in range(r):
        for column in range(r + 1):
            j, total = column if column < r else N, 0.0
            for i in range(N):
                total += test[k, i] * product[j, i]
            reduced[k, j] = total


def decode(mean, basis, qh, r, q):
    """Full coordinates mean + qh basis into q."""
    for i in range(N):
        total = mean[i]
        for j in range(r):
            total += basis[j, i] * qh[j]
        q[i] = total


def tangent_product(parts, basis, r, product):
    """Jacobian times the rows of the basis into rows of the product, the residual into row N."""
    for k in range(r):
        tangent(parts, basis[k], product[k])
    for i in range(N):
        product[N, i] = parts[ENTRIES + i]


def enter_window(mean, basis, r, q, qh):
    """Reduced coordinates of q in a new subspace, and q projected onto it."""
    for j in range(r):
        qh[j] = 0.0
        for i in range(N):
            qh[j] += basis[j, i] * (q[i] - mean[i])
    decode(mean, basis, qh, r, q)


def projected_path(
    q_start: Vector,
    windows: Windows,
    least_squares: Int,
    inputs: Matrix,
    constants: Vector,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Solve the reduced equations sample by sample, window by window.

    The iteration starts from the previous sample, at the start of a window from its projection onto
    the new subspace.
    """
    path, counts = solution.path, solution.counts
    q, qh, step = vector(buffer, 0, N), vector(buffer, N, N), vector(buffer, 2 * N, N)
    u, parts = vector(buffer, 3 * N, INPUTS), vector(buffer, 3 * N + INPUTS, ENTRIES + N)
    first = 4 * N + INPUTS + ENTRIES
    product = matrix(buffer, first, N + 1, N)
    reduced = matrix(buffer, first + N * (N + 1), N, N + 1)
    iterations = 0
    for i in range(N):
        q[i] = q_start[i]
    for window in range(windows.ranks.shape[0]):
        r, mean, basis = windows.ranks[window], windows.means[window], windows.bases[window]
        enter_window(mean, basis, r, q, qh)
        for sample in range(windows.first_samples[window], windows.first_samples[window + 1]):
            counts[SAMPLE] = sample
            for i in range(INPUTS):
                u[i] = inputs[sample, i]
            converged = False
            for _ in range(iteration.limit):
                tangent_parts(q, u, constants, parts)
                tangent_product(parts, basis, r, product)
                iterations += 1
                if least_squares:
                    weigh(product, r, product, reduced)
                else:
                    weigh(windows.tests[window], r, product, reduced)
                if not small_solve(reduced, r):
                    return stopped(counts, iterations, iterations, SINGULAR)
                for j in range(r):
                    step[j] = reduced[j, N]
                    qh[j] -= step[j]
                decode(mean, basis, qh, r, q)
                if all_below(step, r, iteration.tolerance):
                    converged = True
                    break
            if not converged:
                return stopped(counts, iterations, iterations, failure(q))
            for i in range(N):
                path[sample, i] = q[i]
    return stopped(counts, iterations, iterations, CONVERGED)
