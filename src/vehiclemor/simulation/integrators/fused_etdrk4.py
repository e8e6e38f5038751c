"""The exponential method for small systems: a whole step is one compiled kernel, without loops.

As `etdrk4`, for a frozen Jacobian of small diagonal blocks, whose functions cost nothing to apply.
The kernel's first argument is (y, f, both a step before, error scale, h, weights of the estimate of
the error, entries of the operators), the second the inputs at half of the step and at its end.  Its
result is (y and f at the end, the coefficients of the cubic between, the local error).
"""

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.formulations.inputs import input_at
from vehiclemor.simulation.integrators.etdrk4 import quadrature_weights
from vehiclemor.simulation.integrators.step_grid import nearest_index
from vehiclemor.simulation.integrators.structures import FUSED_STEP, RHS_CALLS, Work

# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step", "keep_past", "prepare_curve")


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on."""
    result = vector(buffer, first, 6 * dim)
    curve = matrix(buffer, first + 2 * dim, 3, dim)
    values = vector(buffer, first + 6 * dim, 2 * inputs)
    place = first + 6 * dim + 2 * inputs
    memory = vector(buffer, place, 4)
    rows = matrix(buffer, place + 4, 1, dim)
    # As long as the operators, which is known when they are loaded.
    given = vector(buffer, place + 4 + dim, 4 * dim + 4 + 7 * dim * dim)
    return Work(
        given[:dim],
        given[dim : 2 * dim],
        result[:dim],
        result[dim : 2 * dim],
        result[5 * dim :],
        rows[0],
        rows,
        curve,
        rows,
        rows,
        integers,
        integers,
        memory,
        given,
        values,
        result,
    )


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span, with no operator and no step before."""
    rhs(problem, t, work.y, work.f)
    work.places[0], work.places[1] = len(method.grid) // 2, -1
    work.memory[0], work.memory[1] = 0.0, 1.0
    keep_past(work)


def keep_past(work):
    """Copy state and right-hand side to where the kernel looks for those of the step before."""
    dim = len(work.y)
    for i in range(2 * dim):
        work.given[2 * dim + i] = work.given[i]


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    given, values, u = work.given, work.values, problem.u
    dim, inputs = len(work.y), len(problem.u)
    index = nearest_index(method.grid, work.places[0], h)
    work.places[0] = index
    stretch = method.grid[index] / h
    if index != work.places[1] or stretch != work.memory[1]:
        load_operators(method.operators[index, 0], stretch, 4 * dim + 4, given)
        work.places[1], work.memory[1] = index, stretch
    given[4 * dim] = h
    at_past, at_half, at_end = quadrature_weights(work.memory[0], h)
    given[4 * dim + 1], given[4 * dim + 2], given[4 * dim + 3] = at_past, at_half, at_end
    for stage in range(2):
        input_at(problem, t + 0.5 * (stage + 1) * h, u)
        for i in range(inputs):
            values[stage * inputs + i] = u[i]
    equations = problem.equations
    call_kernel(equations.kernels, FUSED_STEP, given, values, equations.constants, work.result)
    counts[RHS_CALLS] += 4
    return True


def load_operators(entries, stretch, first, given):
    """Copy the entries of the blocks; the first seventh is the Jacobian, stretched to the step."""
    for i in range(len(entries)):
        given[first + i] = entries[i]
    for i in range(len(entries) // 7):
        given[first + i] *= stretch


def accept(problem, t, h, method, work, counts):
    """Keep the beginning of the step for the next one's estimate of the error."""
    keep_past(work)
    work.memory[0] = h


def prepare_curve(h, work):
    """The kernel has given the coefficients."""
