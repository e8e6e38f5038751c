"""The full system, velocities in the vehicle's frame: one Jacobian holds at any heading.

A pair of states that turns with the heading psi is y = R(-psi) x, so y' = R(-psi) x' - psi' (y
turned by a right angle).  A model in which nothing turns stays as it is.
"""

from vehiclemor.codegen.loop_types import call_kernel
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.shared import heading_of, rotate
from vehiclemor.simulation.integrators.structures import DERIVATIVE

INLINED = ("rhs", "reconstruct")


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    input_at(problem, t, problem.u)
    equations, x = problem.equations, problem.x
    turning = equations.turning
    if len(turning) == 0:
        call_kernel(equations.kernels, DERIVATIVE, y, problem.u, equations.constants, dy)
        return
    for i in range(len(y)):
        x[i] = y[i]
    cosine, sine = heading_of(turning, y)
    rotate(x, turning, cosine, sine)
    call_kernel(equations.kernels, DERIVATIVE, x, problem.u, equations.constants, dy)
    rotate(dy, turning, cosine, -sine)
    rate = dy[turning[0]]
    for k in range(1, len(turning), 2):
        dy[turning[k]] += rate * y[turning[k + 1]]
        dy[turning[k + 1]] -= rate * y[turning[k]]


def reconstruct(problem, y, x):
    """State x (n,) of the transformed one y (n,)."""
    turning = problem.equations.turning
    for i in range(len(x)):
        x[i] = y[i]
    cosine, sine = heading_of(turning, y)
    rotate(x, turning, cosine, sine)


def project(problem, t, x, y, counts):
    """Transformed state y (n,) of a state x (n,) at time t."""
    turning = problem.equations.turning
    for i in range(len(y)):
        y[i] = x[i]
    cosine, sine = heading_of(turning, x)
    rotate(y, turning, cosine, -sine)
