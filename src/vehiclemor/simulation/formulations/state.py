"""Projection of the state: x = mean + V y, dy = W f(x, u) (paper, section 3).

The rows of the trial basis are V^T, those of the test basis W.
"""

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.loop_arguments import DERIVATIVE

INLINED = ("rhs", "reconstruct", "origin", "add_motion")


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
    origin(problem, x)
    add_motion(problem, y, x)


def origin(problem, x):
    """The origin of the subspace into x (n,)."""
    for i in range(len(x)):
        x[i] = problem.mean[i]


def add_motion(problem, y, x):
    """Add the state that reduced coordinates y (dim,) move it by to x (n,)."""
    trial = problem.trial
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
    x, change, scale = problem.x, problem.dx, problem.equations.error_scale
    for i in range(len(x)):
        change[i] = 0.0
    origin(problem, x)
    add_motion(problem, y, x)
    add_motion(problem, error, change)
    largest = 0.0
    for i in range(len(x)):
        ratio = abs(change[i]) / (scale[i] + abs(x[i]))
        if not ratio <= largest:
            largest = ratio
    return largest / tolerance
