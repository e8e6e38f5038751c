"""The exponential method: a whole step is one kernel.

See `step_kernels.exponential_step`.
"""

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.etdrk4 import quadrature_weights
from vehiclemor.simulation.integrators.step_grid import nearest_index
from vehiclemor.simulation.integrators.structures import RHS_CALLS, STEP_KERNEL, Work

# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step", "keep_past")


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on; what the step needs besides is last."""
    given = vector(buffer, first, 4 * dim + 6 + 2 * inputs)
    place = first + len(given)
    rows = matrix(buffer, place, 4, dim)
    memory = vector(buffer, place + 4 * dim, 4)
    stride = (dim + 3) // 4 * 4
    result = vector(buffer, place + 4 * dim + 4, 3 * stride)
    end, rates, error = result[:dim], result[stride : stride + dim], result[2 * stride :]
    states = given[:dim], given[dim : 2 * dim], end, rates, error[:dim], rows[0]
    values, whole = given[4 * dim + 6 :], (integers, integers)
    return Work(*states, rows, rows[1:], rows, rows, *whole, memory, given, values, result)


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span; there is no step before."""
    rhs(problem, t, work.y, work.f)
    work.places[0], work.memory[0] = len(method.grid) // 2, 0.0
    keep_past(work)


def keep_past(work):
    """Copy state and right-hand side to where the kernel looks for those of the step before."""
    dim = len(work.y)
    for i in range(2 * dim):
        work.given[2 * dim + i] = work.given[i]


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    given, values, u = work.given, work.values, problem.u
    index = nearest_index(method.grid, work.places[0], h)
    work.places[0] = index
    first = 4 * len(work.y)
    given[first], given[first + 1] = h, method.grid[index] / h
    at_past, at_half, at_end = quadrature_weights(work.memory[0], h)
    given[first + 2], given[first + 3], given[first + 4] = at_past, at_half, at_end
    # The shortest step of the grid is as good as a point in time.
    given[first + 5] = h if h > 1.0001 * method.grid[0] else 0.0
    for stage in range(2):
        input_at(problem, t + 0.5 * (stage + 1) * h, u)
        for i in range(len(u)):
            values[stage * len(u) + i] = u[i]
    equations, tables = problem.equations, method.operators[index]
    call_kernel(equations.kernels, STEP_KERNEL, given, tables, equations.constants, work.result)
    counts[RHS_CALLS] += 4
    return True


def accept(problem, t, h, method, work, counts):
    """Keep the beginning of the step for the next one's estimate of the error."""
    keep_past(work)
    work.memory[0] = h
