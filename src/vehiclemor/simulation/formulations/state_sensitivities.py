"""Projection of the state with its tangents: y = (a, b, ...), x = mean + V a, dx/dp = V b.

Each b has its own equation, db/dt = W (f_x V b + f_c dc/dp): see `state` and `sensitivities`.
"""

from vehiclemor.codegen.loop_types import call_kernel, call_tangent, matrix
from vehiclemor.simulation.formulations.inputs import input_at
from vehiclemor.simulation.integrators.structures import DERIVATIVE, TANGENT

INLINED = ("rhs", "lift")


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    equations, x, dx, u = problem.equations, problem.x, problem.dx, problem.u
    kernels, constants, directions = equations.kernels, equations.constants, equations.directions
    count, lanes, n = len(directions), equations.lanes, len(problem.mean)
    input_at(problem, t, u)
    lift(problem, y, x)
    call_kernel(kernels, DERIVATIVE, x, u, constants, dx)
    moved, rates = matrix(x, n, count, n), matrix(dx, n, count, n)
    for first in range(0, count, lanes):
        # The last may have been computed before.
        row = min(first, count - lanes)
        call_tangent(kernels, TANGENT, x, u, constants, moved, directions, rates, row)
    projected(problem, dx, dy)


def projected(problem, x, y):
    """Products (dim,) of the test basis with a vector and its tangents (n (1 + count),)."""
    test, n = problem.test, len(problem.mean)
    parts = len(x) // n
    r = len(y) // parts
    for part in range(parts):
        for j in range(r):
            total = 0.0
            for i in range(n):
                total += test[j, i] * x[part * n + i]
            y[part * r + j] = total


def expanded(problem, y, x):
    """Combinations (n (1 + count),) of the trial basis."""
    trial, n = problem.trial, len(problem.mean)
    parts = len(x) // n
    r = len(y) // parts
    for part in range(parts):
        for i in range(n):
            x[part * n + i] = 0.0
        for j in range(r):
            for i in range(n):
                x[part * n + i] += trial[j, i] * y[part * r + j]


def lift(problem, y, x):
    """State and tangents x (n (1 + count),) of reduced coordinates y (dim,)."""
    expanded(problem, y, x)
    for i in range(len(problem.mean)):
        x[i] += problem.mean[i]


def project(problem, t, x, y, counts):
    """Reduced coordinates y (dim,) of a state and its tangents x (n (1 + count),)."""
    for i in range(len(problem.mean)):
        x[i] -= problem.mean[i]
    projected(problem, x, y)
    for i in range(len(problem.mean)):
        x[i] += problem.mean[i]


def error_norm(problem, error, y, tolerance):
    """Largest error of a state or tangent as a multiple of its tolerance; NaN if y is."""
    scale, x, change = problem.equations.error_scale, problem.x, problem.dx
    lift(problem, y, x)
    expanded(problem, error, change)
    largest = 0.0
    for i in range(len(scale)):
        ratio = abs(change[i]) / (scale[i] + abs(x[i]))
        if not ratio <= largest:
            largest = ratio
    return largest / tolerance
