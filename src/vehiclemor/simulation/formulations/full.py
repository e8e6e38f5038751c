"""The full system: y is the state x = (coordinates, speeds), dy = f(x, u)."""

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.loop_arguments import DERIVATIVE

# Each integrator calls it once for all stages of a step.
INLINED = ("rhs", "reconstruct")


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    input_at(problem, t, problem.u)
    equations = problem.equations
    call_kernel(equations.kernels, DERIVATIVE, y, problem.u, equations.constants, dy)


def reconstruct(problem, y, x):
    """State x (n,) of reduced coordinates y (dim,)."""
    for i in range(len(x)):
        x[i] = y[i]


def project(problem, t, x, y, counts):
    """Reduced coordinates y (dim,) of a state x (n,) at time t."""
    for i in range(len(y)):
        y[i] = x[i]


def error_norm(problem, error, y, tolerance):
    """Largest error of a state as a multiple of its tolerance; NaN if y is."""
    scale = problem.equations.error_scale
    largest = 0.0
    for i in range(len(y)):
        ratio = abs(error[i]) / (scale[i] + abs(y[i]))
        if not ratio <= largest:
            largest = ratio
    return largest / tolerance
