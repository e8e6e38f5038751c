"""The W-method for small systems: a whole step is one compiled kernel, without loops.

With eight states the loops of `ros34pw2` take longer than the right-hand side.  The kernel does
what a step does there: its first argument is (y, f, h, rows of the stored inverse), the second the
inputs at the times of the second, third and fourth stage (the last is the end of the step), its
result (y at the end, error, f at the end).
"""

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.formulations.inputs import input_at
from vehiclemor.simulation.integrators.step_grid import index_above
from vehiclemor.simulation.integrators.structures import (
    FUSED_STEP,
    LINEAR_SOLVES,
    RHS_CALLS,
    Work,
)

ALPHA = 8
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step")


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on."""
    width = (dim + 3) // 4 * 4
    given = vector(buffer, first, 2 * dim + 1 + width * dim)
    place = first + len(given)
    result = vector(buffer, place, 3 * dim)
    rows = matrix(buffer, place + 3 * dim, 4, dim)
    values = vector(buffer, place + 7 * dim, 3 * inputs)
    return Work(
        given[:dim],
        given[dim : 2 * dim],
        result[:dim],
        result[2 * dim : 3 * dim],
        result[dim : 2 * dim],
        rows[3],
        rows,
        rows,
        rows,
        rows,
        integers,
        integers,
        result,
        given,
        values,
        result,
    )


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span; no inverse is loaded."""
    rhs(problem, t, work.y, work.f)
    work.places[0], work.places[1] = len(method.grid) // 2, -1


def load_inverse(inverse, dim, given):
    """Copy rows (active, dim) of an inverse behind the kernel's other arguments, padded."""
    width = (dim + 3) // 4 * 4
    for j in range(len(inverse)):
        for i in range(dim):
            given[2 * dim + 1 + j * width + i] = inverse[j, i]


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    given, values, u = work.given, work.values, problem.u
    dim, inputs = len(work.y), len(problem.u)
    index = index_above(method.grid, work.places[0], h)
    work.places[0] = index
    if index != work.places[1]:
        load_inverse(method.operators[index], dim, given)
        work.places[1] = index
    given[2 * dim] = h
    for stage in range(3):
        input_at(problem, t + method.tableau[ALPHA, stage + 1] * h, u)
        for i in range(inputs):
            values[stage * inputs + i] = u[i]
    equations = problem.equations
    call_kernel(equations.kernels, FUSED_STEP, given, values, equations.constants, work.result)
    counts[RHS_CALLS] += 4
    counts[LINEAR_SOLVES] += 4
    return True


def accept(problem, t, h, method, work, counts):
    """The kernel has given the right-hand side at the end of the step."""
