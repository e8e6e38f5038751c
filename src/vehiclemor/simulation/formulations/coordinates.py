"""Projection of the equations of motion: y = (a, b), coordinates q = mean + V a, their rates V b.

V^T M V db/dt = V^T F with the mass matrix of the model; the first half of the rows of the trial
basis are V^T, those of the test basis its left inverse.
"""

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.dense_solves import small_solve
from vehiclemor.simulation.loop_arguments import DERIVATIVE, RHS_CALLS, SECOND_ORDER, SPEEDS

INLINED = ("rhs", "reconstruct", "origin", "add_motion", "galerkin", "product")


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
        dy[r + j] = problem.small[j, problem.small.shape[1] - 1]


def reconstruct(problem, y, x):
    """State x (n,) of reduced coordinates y (dim,)."""
    equations, n = problem.equations, len(x) // 2
    origin(problem, x)
    add_motion(problem, y, x)
    call_kernel(equations.kernels, SPEEDS, x, problem.u, equations.constants, problem.dx)
    for i in range(n):
        x[n + i] = problem.dx[i]


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
    # Four rows at a time: a loop over a dozen numbers costs as much to enter as to run.
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
    """Solve (V^T M V) a = V^T F; V^T are the rows of trial; a replaces the last column of small."""
    n, last = len(matrix), small.shape[1] - 1
    for k in range(r):
        # M is symmetric: its rows are its columns.
        product(n, matrix, k, trial, image)
        total = 0.0
        for i in range(n):
            total += trial[k, i] * matrix[i, n]
        small[k, last] = total
        for j in range(k + 1):
            total = 0.0
            for i in range(n):
                total += trial[j, i] * image[i]
            small[k, j], small[j, k] = total, total
    small_solve(small, r)


def add_motion(problem, y, x):
    """Add coordinates and their rates, instead of the speeds, to x (n,)."""
    trial, n, r = problem.trial, len(x) // 2, len(y) // 2
    for j in range(r):
        for i in range(n):
            x[i] += trial[j, i] * y[j]
            x[n + i] += trial[j, i] * y[r + j]


def origin(problem, x):
    """The origin of the subspace, at rest, into x (n,)."""
    n = len(x) // 2
    for i in range(n):
        x[i], x[n + i] = problem.mean[i], 0.0
