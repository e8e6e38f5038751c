"""Projection of the state: x = mean + V y, dy = W f(x, u) (paper, section 3).

The rows of the trial basis are V^T, those of the test basis W.
"""

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.structures import DERIVATIVE

INLINED = ("rhs", "reconstruct")


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    x, dx, test, equations = problem.x, problem.dx, problem.test, problem.equations
    input_at(problem, t, problem.u)
    reconstruct(problem, y, x)
    call_kernel(equations.kernels, DERIVATIVE, x, problem.u, equations.constants, dx)
    for j in range(len(y)):
        total = 0.0
        for i in range(len(dx)):
            total += test[j, i] * dx[i]
        dy[j] = total


def reconstruct(problem, y, x):
    """State x (n,) of reduced coordinates y (dim,)."""
    mean, trial = problem.mean, problem.trial
    for i in range(len(x)):
        x[i] = mean[i]
    for j in range(len(y)):
        for i in range(len(x)):
            x[i] += trial[j, i] * y[j]


def project(problem, t, x, y, counts):
    """Reduced coordinates y (dim,) of a state x (n,) at time t."""
    mean, test = problem.mean, problem.test
    for j in range(len(y)):
        total = 0.0
        for i in range(len(x)):
            total += test[j, i] * (x[i] - mean[i])
        y[j] = total


def error_norm(problem, error, y, tolerance):
    """Largest error of a state as a multiple of its tolerance; NaN if y is.

    The error is reconstructed first, so that a tolerance means the same in every formulation.
    """
    mean, trial, scale = problem.mean, problem.trial, problem.equations.error_scale
    largest = 0.0
    for i in range(len(scale)):
        value, change = mean[i], 0.0
        for j in range(len(y)):
            value += trial[j, i] * y[j]
            change += trial[j, i] * error[j]
        ratio = abs(change) / (scale[i] + abs(value))
        if not ratio <= largest:
            largest = ratio
    return largest / tolerance
