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

Step sizes are those that operators are stored for; where a break point asks for another step h
those of the nearest one serve, exact for A = J step_sizes[index] / h.  A step is one kernel,
see `step_kernels.exponential_step`.

Matrix functions: phi_0(z) = exp(z), phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z.  Taylor series at a
small argument, then doubling (N. Higham, Functions of Matrices, SIAM 2008, section 10.7):

    phi_k(2 z) = 2^-k [phi_0(z) phi_k(z) + sum_{j=1}^k phi_j(z) / (k - j)!]

so that defective matrices, those of stabilised constraints, are no exception.
"""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import IntVector, Matrix, Vector, call_kernel, matrix, vector
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.integrators.contract import POWERS
from vehiclemor.simulation.loop_arguments import RHS_CALLS, STEP_KERNEL

# Called once in the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = (
    *("accept", "longest_step", "step", "quadrature_weights", "keep_past"),
    *("index_below", "nearest_index"),
)
# Vectors and numbers of the kernel's first argument; inputs at two stages follow.
ARGUMENTS = ("y", "f", "y_past", "f_past")
NUMBERS = ("h", "stretch", "at_past", "at_half", "at_end", "defect")
STAGE_INPUTS = 2
# Scratch space beside the kernel's arguments: a vector and the powers of a cubic; one number.
ROWS, MEMORY = 1 + POWERS, 1
# Share of the difference D5 - D4 that is the error, as in RK4(3)T: 1/10 to the weight 1/6.
ERROR_SHARE = 0.6
# Norm of the matrix below which the series is used, and its terms: rounding is larger.
SMALL, TERMS = 0.1, 10
# Tables of a step size: J, then functions of h J / 2 and h J.
TABLES = 7
JACOBIAN, HALF_FIRST, HALF_SECOND, FIRST, SECOND, MIDDLE, LAST = range(TABLES)
# The tables' functions at argument zero, for states that no block belongs to.
AT_ZERO = (0.0, 1.0 / 2.0, 1.0 / 2.0, 1.0, 1.0, 1.0 / 3.0, 1.0 / 6.0)


class Work(NamedTuple):
    """Scratch space: `contract`'s vectors, powers of the cubic, and what the step kernel takes.

    Past are state and right-hand side a step before, one behind the other; their step size, 0 if
    there was none; the kernel's numbers and inputs, parts of its arguments; its result; the number
    of the last step in the list of step sizes.
    """

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    curve: Matrix
    past: Vector
    past_step: Vector
    numbers: Vector
    inputs: Vector
    arguments: Vector
    result: Vector
    step_index: IntVector


def work_space(buffer, first, integers, dim, inputs, method):
    """See `contract.work_space`; the kernel works behind its result, so this is last."""
    numbers_at = len(ARGUMENTS) * dim
    inputs_at = numbers_at + len(NUMBERS)
    arguments = vector(buffer, first, inputs_at + STAGE_INPUTS * inputs)
    rows_at = first + len(arguments)
    memory_at = rows_at + ROWS * dim
    stride = (dim + 3) // 4 * 4
    result = vector(buffer, memory_at + MEMORY, 3 * stride)
    return Work(
        y=arguments[:dim],
        f=arguments[dim : 2 * dim],
        new=result[:dim],
        f_new=result[stride : stride + dim],
        error=result[2 * stride : 2 * stride + dim],
        middle=vector(buffer, rows_at, dim),
        curve=matrix(buffer, rows_at + dim, POWERS, dim),
        past=arguments[2 * dim : numbers_at],
        past_step=vector(buffer, memory_at, MEMORY),
        numbers=arguments[numbers_at:inputs_at],
        inputs=arguments[inputs_at:],
        arguments=arguments,
        result=result,
        step_index=integers,
    )


def begin(method, work):
    """There is no step before."""
    work.step_index[0], work.past_step[0] = len(method.step_sizes) // 2, 0.0
    keep_past(work)


def keep_past(work):
    """Copy state and right-hand side to where the kernel looks for those of the step before."""
    for i in range(len(work.past)):
        work.past[i] = work.arguments[i]


def longest_step(h, method, work):
    """The longest stored step size that is not above h."""
    work.step_index[0] = index_below(method.step_sizes, work.step_index[0], h)
    return min(h, method.step_sizes[work.step_index[0]])


def index_below(step_sizes, index, h):
    """Number of the longest stored step size that is not above h; the search begins at `index`."""
    while index > 0 and step_sizes[index] > 1.0001 * h:
        index -= 1
    while index < len(step_sizes) - 1 and step_sizes[index + 1] <= 1.0001 * h:
        index += 1
    return index


def nearest_index(step_sizes, index, h):
    """Number of the stored step size that is nearest to h; the search begins at `index`."""
    while index > 0 and step_sizes[index - 1] * step_sizes[index] > h * h:
        index -= 1
    while index < len(step_sizes) - 1 and step_sizes[index + 1] * step_sizes[index] < h * h:
        index += 1
    return index


def quadrature_weights(past, h):
    """Weights of D in the second estimate of the error: a step before, half-way and at the end."""
    if past <= 0.0:
        return 0.0, -4.0, 2.0
    ratio = past / h
    return 1.0 / (ratio * (ratio + 1.0)), -4.0, (1.0 + 2.0 * ratio) / (1.0 + ratio)


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    numbers, u, step_sizes = work.numbers, problem.u, method.step_sizes
    index = nearest_index(step_sizes, work.step_index[0], h)
    work.step_index[0] = index
    numbers[0], numbers[1] = h, step_sizes[index] / h
    numbers[2], numbers[3], numbers[4] = quadrature_weights(work.past_step[0], h)
    # The shortest stored step is as good as a point in time.
    numbers[5] = h if h > 1.0001 * step_sizes[0] else 0.0
    for stage in range(STAGE_INPUTS):
        input_at(problem, t + 0.5 * (stage + 1) * h, u)
        for i in range(len(u)):
            work.inputs[stage * len(u) + i] = u[i]
    equations, tables = problem.equations, method.operators[index]
    call_kernel(
        equations.kernels, STEP_KERNEL, work.arguments, tables, equations.constants, work.result
    )
    counts[RHS_CALLS] += 4
    return True


def accept(problem, t, h, method, work, counts):
    """Keep the beginning of the step for the next one's estimate of the error."""
    keep_past(work)
    work.past_step[0] = h


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


def exponential_tables(jacobian: np.ndarray, step_sizes: np.ndarray) -> np.ndarray:
    """Tables (step sizes, 7, n, n) of the loops, each matrix transposed.

    J; phi_1(z/2) / 2 and phi_2(z/2); phi_1, 2 phi_2, 2 phi_2 - 4 phi_3, 4 phi_3 - phi_2 of
    z = h J.  Step sizes grow by a root of 2: each octave doubles the one before.
    """
    octave = int((step_sizes < 1.99 * step_sizes[0]).sum())
    tables = np.empty((len(step_sizes), TABLES, *jacobian.shape))
    half = phi_functions(0.5 * step_sizes[:octave, None, None] * jacobian)
    for begin in range(0, len(step_sizes), octave):
        full = _doubled(half)
        _, first, second, third = full
        columns = (
            *(np.broadcast_to(jacobian, first.shape), half[1] / 2.0, half[2]),
            *(first, 2.0 * second, 2.0 * second - 4.0 * third, 4.0 * third - second),
        )
        part = tables[begin : begin + octave]
        part[:] = np.stack(columns, axis=1)[: len(part)].swapaxes(2, 3)
        half = full
    return tables
