"""Projection of the equations of motion: y = (a, b), coordinates q = mean + V a, their rates V b.

V^T M V db/dt = V^T F with the model's own mass matrix; the first half of the rows of the trial
basis are V^T, those of the test basis its left inverse.
"""

import math

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.structures import DERIVATIVE, RHS_CALLS, SECOND_ORDER, SPEEDS

INLINED = ("rhs", "reconstruct", "positions_and_rates", "galerkin", "product")


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    equations, r = problem.equations, len(y) // 2
    input_at(problem, t, problem.u)
    reconstruct(problem, y, problem.x)
    call_kernel(
        equations.kernels,
        SECOND_ORDER,
        problem.x,
        problem.u,
        equations.constants,
        problem.second_order,
    )
    galerkin(r, problem.trial, problem.second_order, problem.dx, problem.small)
    for j in range(r):
        dy[j] = y[r + j]
        dy[r + j] = problem.small[j, r]


def reconstruct(problem, y, x):
    """State x (n,) of reduced coordinates y (dim,)."""
    equations, n = problem.equations, len(x) // 2
    positions_and_rates(problem, y, x)
    call_kernel(equations.kernels, SPEEDS, x, problem.u, equations.constants, problem.dx)
    for i in range(n):
        x[n + i] = problem.dx[i]


def positions_and_rates(problem, y, x):
    """Coordinates and their rates, in place of the speeds, into x (n,)."""
    mean, trial = problem.mean, problem.trial
    n, r = len(x) // 2, len(y) // 2
    for i in range(n):
        x[i] = mean[i]
        x[n + i] = 0.0
    for j in range(r):
        for i in range(n):
            x[i] += trial[j, i] * y[j]
            x[n + i] += trial[j, i] * y[r + j]


def project(problem, t, x, y, counts):
    """Reduced coordinates y (dim,) of a state x (n,) at time t."""
    equations, mean, test, dx = problem.equations, problem.mean, problem.test, problem.dx
    n, r = len(x) // 2, len(y) // 2
    input_at(problem, t, problem.u)
    counts[RHS_CALLS] += 1
    call_kernel(equations.kernels, DERIVATIVE, x, problem.u, equations.constants, dx)
    for j in range(r):
        total, rate = 0.0, 0.0
        for i in range(n):
            total += test[j, i] * (x[i] - mean[i])
            rate += test[j, i] * dx[i]
        y[j] = total
        y[r + j] = rate


def product(n, matrix, row, trial, image):
    """Product of the first n columns of a symmetric matrix with a row of trial into image (n,)."""
    for i in range(n):
        image[i] = 0.0
    # Four rows at a time: a loop over a dozen places costs as much to enter as to run.
    j = 0
    while j + 3 < n:
        a, b, c, d = trial[row, j], trial[row, j + 1], trial[row, j + 2], trial[row, j + 3]
        for i in range(n):
            image[i] += (matrix[j, i] * a + matrix[j + 1, i] * b) + (
                matrix[j + 2, i] * c + matrix[j + 3, i] * d
            )
        j += 4
    while j < n:
        a = trial[row, j]
        for i in range(n):
            image[i] += matrix[j, i] * a
        j += 1


def galerkin(r, trial, matrix, image, small):
    """Solve (V^T M V) a = V^T F; V^T are the rows of trial; a replaces column r of small."""
    n = len(matrix)
    for k in range(r):
        # M is symmetric: its rows are its columns.
        product(n, matrix, k, trial, image)
        total = 0.0
        for i in range(n):
            total += trial[k, i] * matrix[i, n]
        small[k, r] = total
        for j in range(k + 1):
            total = 0.0
            for i in range(n):
                total += trial[j, i] * image[i]
            small[k, j] = total
    # Cholesky: V^T M V is positive definite.
    for k in range(r):
        pivot = small[k, k]
        for j in range(k):
            pivot -= small[k, j] * small[k, j]
        pivot = math.sqrt(pivot)
        small[k, k] = pivot
        for i in range(k + 1, r):
            total = small[i, k]
            for j in range(k):
                total -= small[i, j] * small[k, j]
            small[i, k] = total / pivot
    for k in range(r):
        total = small[k, r]
        for j in range(k):
            total -= small[k, j] * small[j, r]
        small[k, r] = total / small[k, k]
    for k in range(r - 1, -1, -1):
        total = small[k, r]
        for j in range(k + 1, r):
            total -= small[j, k] * small[j, r]
        small[k, r] = total / small[k, k]


def error_norm(problem, error, y, tolerance):
    """Largest error of a coordinate or rate as a multiple of its tolerance; NaN if y is."""
    mean, trial, scale = problem.mean, problem.trial, problem.equations.error_scale
    n, r = len(scale) // 2, len(y) // 2
    largest = 0.0
    for i in range(n):
        value, change, rate, drift = mean[i], 0.0, 0.0, 0.0
        for j in range(r):
            value += trial[j, i] * y[j]
            change += trial[j, i] * error[j]
            rate += trial[j, i] * y[r + j]
            drift += trial[j, i] * error[r + j]
        ratio = abs(change) / (scale[i] + abs(value))
        if not ratio <= largest:
            largest = ratio
        ratio = abs(drift) / (scale[n + i] + abs(rate))
        if not ratio <= largest:
            largest = ratio
    return largest / tolerance
