"""The full system with its tangents: y = (x, dx/dp, ...), one tangent for each direction.

Each is integrated by its own equation, d/dt dx/dp = f_x dx/dp + f_c dc/dp with the constants c, and
the steps are short enough for all of them.
"""

from vehiclemor.codegen.loop_types import call_kernel, call_tangent, matrix
from vehiclemor.simulation.formulations.inputs import input_at
from vehiclemor.simulation.integrators.structures import DERIVATIVE, TANGENT

INLINED = ("rhs",)


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    input_at(problem, t, problem.u)
    kernels, constants, u = problem.equations.kernels, problem.equations.constants, problem.u
    directions, lanes = problem.equations.directions, problem.equations.lanes
    count = len(directions)
    n = len(y) // (1 + count)
    call_kernel(kernels, DERIVATIVE, y, u, constants, dy)
    moved, rates = matrix(y, n, count, n), matrix(dy, n, count, n)
    for first in range(0, count, lanes):
        # The last may have been computed before.
        row = min(first, count - lanes)
        call_tangent(kernels, TANGENT, y, u, constants, moved, directions, rates, row)
