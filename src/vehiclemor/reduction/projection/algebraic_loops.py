"""Reduced solution of algebraic equations along time: a compiled loop.

With q = mean + basis qh the reduced equations are W^T Phi(mean + basis qh; u) = 0: W is a constant
test basis (Petrov-Galerkin), or W = Phi_q basis, fresh in each iteration (least squares by
Gauss-Newton).  Bases of n coordinates stand by rows, padded with zeros to n x n.
"""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import (
    Cube,
    Int,
    IntVector,
    Matrix,
    Vector,
    call_kernel,
    matrix,
    vector,
)
from vehiclemor.simulation.integrators.dense_solves import small_solve
from vehiclemor.simulation.newton_loops import (
    CONVERGED,
    SAMPLE,
    SINGULAR,
    Iteration,
    Solution,
    all_below,
    failure,
    stopped,
)

# Indices of the kernels: residual and entries of the Jacobian; the product with these.
ENTRIES, PRODUCT = range(2)
INLINED = ("weigh", "decode", "basis_product", "enter_window")


class Windows(NamedTuple):
    """Subspaces by window."""

    first_samples: IntVector  # Window k holds the samples from entry k up to entry k + 1.
    means: Matrix  # Means (windows, n).
    # Basis and test basis by rows (windows, n, n).
    bases: Cube
    tests: Cube
    ranks: IntVector  # Rows that are used (windows,).
    least_squares: Int  # Whether least squares are solved, without the test basis.


def weigh(test, r, product, reduced):
    """Rows of the test basis times those of the product: the reduced equations."""
    n = test.shape[1]
    for k in range(r):
        for column in range(r + 1):
            j, total = column if column < r else n, 0.0
            for i in range(n):
                total += test[k, i] * product[j, i]
            reduced[k, j] = total


def decode(mean, basis, qh, r, q):
    """Full coordinates mean + qh basis into q."""
    for i in range(len(q)):
        total = mean[i]
        for j in range(r):
            total += basis[j, i] * qh[j]
        q[i] = total


def basis_product(kernels, entries, basis, r, product):
    """Jacobian times the rows of the basis into rows of the product, the residual into the last."""
    n = basis.shape[1]
    for k in range(r):
        call_kernel(kernels, PRODUCT, entries, basis[k], product[k])
    for i in range(n):
        product[n, i] = entries[i]


def enter_window(mean, basis, r, q, qh):
    """Reduced coordinates of q in a new subspace, and q projected onto it."""
    for j in range(r):
        qh[j] = 0.0
        for i in range(len(q)):
            qh[j] += basis[j, i] * (q[i] - mean[i])
    decode(mean, basis, qh, r, q)


def projected_path(
    q_start: Vector,
    windows: Windows,
    inputs: Matrix,
    constants: Vector,
    kernels: IntVector,
    iteration: Iteration,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Solve the reduced equations sample by sample, window by window.

    The iteration starts from the previous sample, at the start of a window from its projection onto
    the new subspace.
    """
    path, counts = solution.path, solution.counts
    n, size = len(q_start), len(q_start) * (len(q_start) + 1)
    q, qh, step = vector(buffer, 0, n), vector(buffer, n, n), vector(buffer, 2 * n, n)
    product, reduced = matrix(buffer, 3 * n, n + 1, n), matrix(buffer, 3 * n + size, n, n + 1)
    # As many as a Jacobian without zeros has.
    entries = vector(buffer, 3 * n + 2 * size, size)
    u = vector(buffer, 3 * n + 3 * size, inputs.shape[1])
    iterations = 0
    for i in range(n):
        q[i] = q_start[i]
    for window in range(windows.ranks.shape[0]):
        r, mean, basis = windows.ranks[window], windows.means[window], windows.bases[window]
        enter_window(mean, basis, r, q, qh)
        for sample in range(windows.first_samples[window], windows.first_samples[window + 1]):
            counts[SAMPLE] = sample
            for i in range(len(u)):
                u[i] = inputs[sample, i]
            converged = False
            for _ in range(iteration.limit):
                call_kernel(kernels, ENTRIES, q, u, constants, entries)
                basis_product(kernels, entries, basis, r, product)
                iterations += 1
                if windows.least_squares:
                    weigh(product, r, product, reduced)
                else:
                    weigh(windows.tests[window], r, product, reduced)
                if not small_solve(reduced, r):
                    return stopped(counts, iterations, SINGULAR)
                for j in range(r):
                    step[j] = reduced[j, n]
                    qh[j] -= step[j]
                decode(mean, basis, qh, r, q)
                if all_below(step, r, iteration.tolerance):
                    converged = True
                    break
            if not converged:
                return stopped(counts, iterations, failure(q))
            for i in range(n):
                path[sample, i] = q[i]
    return stopped(counts, iterations, CONVERGED)
