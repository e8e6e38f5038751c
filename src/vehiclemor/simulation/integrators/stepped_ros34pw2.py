"""The W-method: a whole step is one kernel, see `step_kernels.w_step`.

What is not here is as in `ros34pw2`.
"""

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.step_grid import index_above
from vehiclemor.simulation.integrators.structures import LINEAR_SOLVES, RHS_CALLS, STEP_KERNEL, Work

ALPHA = 8
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("step",)


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on; what the step needs besides is last."""
    given = vector(buffer, first, 2 * dim + 1 + 3 * inputs)
    rows = matrix(buffer, first + len(given), 5, dim)
    stride = (dim + 3) // 4 * 4
    result = vector(buffer, first + len(given) + 5 * dim, 2 * stride)
    end, error = result[:dim], result[stride : stride + dim]
    states = given[:dim], given[dim : 2 * dim], end, rows[0], error, rows[1]
    values, whole = given[2 * dim + 1 :], (integers, integers)
    return Work(*states, rows, rows[2:], rows, rows, *whole, result, given, values, result)


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    given, values, u = work.given, work.values, problem.u
    work.places[0] = index_above(method.grid, work.places[0], h)
    given[2 * len(work.y)] = h
    for stage in range(3):
        input_at(problem, t + method.tableau[ALPHA, stage + 1] * h, u)
        for i in range(len(u)):
            values[stage * len(u) + i] = u[i]
    equations, operator = problem.equations, method.operators[work.places[0]]
    call_kernel(equations.kernels, STEP_KERNEL, given, operator, equations.constants, work.result)
    counts[RHS_CALLS] += 3
    counts[LINEAR_SOLVES] += 4
    return True
