"""The exponential Runge-Kutta method ETDRK4 with one frozen Jacobian and stored matrix functions.

S. Krogstad, J. Comput. Phys. 203 (2005), 72-88, section 3: order 4 for y' = A y + N(t, y).  Here A
is the frozen Jacobian, N the rest, and all stages are increments: with f1 = f(t, y), z = h A and
D_i = N_i - N_1 = f_i - f1 - A v_i

    v2 = h/2 phi_1(z/2) f1
    v3 = v2 + h phi_2(z/2) D2
    v4 = h phi_1 f1 + 2 h phi_2 D3
    v5 = h phi_1 f1 + h (2 phi_2 - 4 phi_3) (D2 + D3) + h (4 phi_3 - phi_2) D4

y + v5 is the new state, where the next step begins.  Two estimates of the error are added, both
with the weight h (4 phi_3 - phi_2): D5 - D4, as in the pair RK4(3)T of J. Dormand and P. Prince
(J. Comput. Appl. Math. 6 (1980), 19-26), which does not see what depends on the time alone; and
for that the difference to the quadrature of order 3 through D at the step before, now and at its
end (in the first step of a span, of order 2 through now and its end).  Linear motion has no error
at the end of a step, however long, but the cubic between has: its defect half-way is added.

Steps are those of a grid; where a break point asks for another step h the functions of the nearest
one serve, exact for A = J grid[index] / h.  A whole step is one kernel, see
`step_kernels.exponential_step`.

Matrix functions: phi_0(z) = exp(z), phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z.  Taylor series at a
small argument, then doubling (N. Higham, Functions of Matrices, SIAM 2008, section 10.7):

    phi_k(2 z) = 2^-k [phi_0(z) phi_k(z) + sum_{j=1}^k phi_j(z) / (k - j)!]

so that defective matrices, those of stabilised constraints, are no exception.
"""

import math
from collections.abc import Sequence

import numpy as np

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.shared import index_below, nearest_index
from vehiclemor.simulation.integrators.structures import RHS_CALLS, STEP_KERNEL, Work

# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "longest_step", "step", "quadrature_weights", "keep_past")
# Share of the difference D5 - D4 that is the error, as in RK4(3)T: 1/10 to the weight 1/6.
ERROR_SHARE = 0.6
# Norm of the matrix below which the series is used, and its terms: rounding is larger.
SMALL, TERMS = 0.1, 10
# Tables of a step size: J, then functions of h J / 2 and h J.
TABLES = 7
JACOBIAN, HALF_FIRST, HALF_SECOND, FIRST, SECOND, MIDDLE, LAST = range(TABLES)
# The tables' functions at argument zero, for states that no block belongs to.
AT_ZERO = (0.0, 1.0 / 2.0, 1.0 / 2.0, 1.0, 1.0, 1.0 / 3.0, 1.0 / 6.0)


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


def longest_step(h, method, control, work):
    """The longest step of the grid that is not above h."""
    work.places[0] = index_below(method.grid, work.places[0], h)
    return min(h, method.grid[work.places[0]])


def quadrature_weights(past, h):
    """Weights of D in the second estimate of the error: a step before, half-way and at the end."""
    if past <= 0.0:
        return 0.0, -4.0, 2.0
    ratio = past / h
    return 1.0 / (ratio * (ratio + 1.0)), -4.0, (1.0 + 2.0 * ratio) / (1.0 + ratio)


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


def phi_functions(matrix: np.ndarray) -> tuple[np.ndarray, ...]:
    """phi_0 to phi_3 of a matrix (n, n), or of several (k, n, n)."""
    norm = float(np.abs(matrix).sum(axis=-2).max())
    halvings = max(0, math.ceil(math.log2(norm / SMALL))) if norm > 0.0 else 0
    functions = _series(matrix / 2.0**halvings)
    for _ in range(halvings):
        functions = _doubled(functions)
    return functions


def _series(z: np.ndarray) -> tuple[np.ndarray, ...]:
    identity = np.eye(z.shape[-1])
    third = np.zeros_like(z)
    for k in range(TERMS, -1, -1):
        third = third @ z + identity / math.factorial(k + 3)
    second = z @ third + identity / 2.0
    first = z @ second + identity
    return z @ first + identity, first, second, third


def _doubled(functions: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    e, first, second, third = functions
    return (
        e @ e,
        (e @ first + first) / 2.0,
        (e @ second + first + second) / 4.0,
        (e @ third + first / 2.0 + second + third) / 8.0,
    )


def exponential_tables(jacobian: np.ndarray, grid: Sequence[float] | np.ndarray) -> np.ndarray:
    """Tables (step sizes, 7, n, n) of the loops, each matrix transposed.

    J; phi_1(z/2) / 2 and phi_2(z/2); phi_1, 2 phi_2, 2 phi_2 - 4 phi_3, 4 phi_3 - phi_2 of
    z = h J.  Step sizes grow by a root of 2: each octave of the grid doubles the one before.
    """
    steps = np.asarray(grid)
    octave = int((steps < 1.99 * steps[0]).sum())
    tables = np.empty((len(steps), TABLES, *jacobian.shape))
    half = phi_functions(0.5 * steps[:octave, None, None] * jacobian)
    for begin in range(0, len(steps), octave):
        whole = _doubled(half)
        _, first, second, third = whole
        columns = (
            *(np.broadcast_to(jacobian, first.shape), half[1] / 2.0, half[2]),
            *(first, 2.0 * second, 2.0 * second - 4.0 * third, 4.0 * third - second),
        )
        part = tables[begin : begin + octave]
        part[:] = np.stack(columns, axis=1)[: len(part)].swapaxes(2, 3)
        half = whole
    return tables
