"""The W-method ROS34PW2 with one frozen Jacobian: stored inverses on a grid of step sizes.

J. Rang, L. Angermann, BIT Numer. Math. 45 (2005), 761-787: order 3 with any matrix for the
Jacobian.  Transformed stages as in `rodas4`; a whole step is one kernel, see `step_kernels.w_step`.

Rows of the tableau: a (4), gamma c (4), then alpha, m and e; operators are (I - gamma h J)^-1.
"""

import numpy as np

from vehiclemor.codegen.loop_types import call_kernel, matrix, vector
from vehiclemor.inputs.polynomial_loops import input_at
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.shared import index_above
from vehiclemor.simulation.integrators.structures import LINEAR_SOLVES, RHS_CALLS, STEP_KERNEL, Work

GAMMA = 4.3586652150845900e-01
ALPHA, M, E = 8, 9, 10
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step")


def tableau() -> np.ndarray:
    """Coefficients (11, 4), see above.

    The time derivative is left out: order 3 holds for any matrix, its column of f_t included.
    """
    alpha = np.zeros((4, 4))
    alpha[1, 0] = 8.7173304301691801e-01
    alpha[2, :2] = [8.4457060015369423e-01, -1.1299064236484185e-01]
    alpha[3, 2] = 1.0
    g = GAMMA * np.eye(4)
    g[1, 0] = -8.7173304301691801e-01
    g[2, :2] = [-9.0338057013044082e-01, 5.4180672388095326e-02]
    g[3, :3] = [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01]
    b = np.array([2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, GAMMA])
    embedded = np.array(
        [3.7810903145819369e-01, -9.6042292212423178e-02, 0.5, 2.1793326075422950e-01]
    )
    inverse = np.linalg.inv(g)
    a = np.tril(alpha @ inverse, -1)
    c = np.tril(np.eye(4) / GAMMA - inverse, -1)
    m, e = b @ inverse, (b - embedded) @ inverse
    return np.vstack([a, GAMMA * c, alpha.sum(axis=1), m, e])


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


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span."""
    rhs(problem, t, work.y, work.f)
    work.places[0] = len(method.grid) // 2


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


def accept(problem, t, h, method, work, counts):
    """Right-hand side at the end of the step."""
    rhs(problem, t + h, work.new, work.f_new)
    counts[RHS_CALLS] += 1
