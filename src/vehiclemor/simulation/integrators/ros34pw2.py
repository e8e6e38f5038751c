"""The W-method ROS34PW2 with one frozen Jacobian: stored inverses on a grid of step sizes.

J. Rang, L. Angermann, BIT Numer. Math. 45 (2005), 761-787: order 3 with any matrix for the
Jacobian.  Transformed stages as in `rodas4`; the four stages are written out, since with a dozen
states the loops around them would cost more than they do.

Rows of the tableau: a (4), gamma c (4), then alpha, m and e; operators are the transposed active
columns of (I - gamma h J)^-1.
"""

import numpy as np

from vehiclemor.codegen.loop_types import matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.step_grid import heading_of, index_above, rotate
from vehiclemor.simulation.integrators.structures import LINEAR_SOLVES, RHS_CALLS, Work, rows_of

GAMMA = 4.3586652150845900e-01
ALPHA, M, E = 8, 9, 10
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "longest_step", "step")


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
    """Scratch space from place `first` of the buffer on."""
    ends, none = matrix(buffer, first, 6, dim), vector(buffer, first, 0)
    stages = matrix(buffer, first + 6 * dim, 5, dim)
    curve = matrix(buffer, first + 11 * dim, 3, dim)
    whole = integers, integers
    return Work(*rows_of(ends), stages, curve, ends, ends, *whole, none, none, none, none)


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span."""
    rhs(problem, t, work.y, work.f)
    work.places[0] = len(method.grid) // 2


def longest_step(h, method, control, work):
    """Any step size will do: the operator of a step a little longer serves."""
    return h


def frozen_solve(inverse, active, b, result):
    """Product of a stored inverse with b: its active columns, the others are the identity's."""
    dim = len(b)
    for i in range(dim):
        result[i] = b[i]
    for j in active:
        result[j] = 0.0
    # Four rows at a time: the result is loaded and stored a quarter as often.
    place = 0
    while place + 3 < len(active):
        w0, w1 = b[active[place]], b[active[place + 1]]
        w2, w3 = b[active[place + 2]], b[active[place + 3]]
        for i in range(dim):
            result[i] += (inverse[place, i] * w0 + inverse[place + 1, i] * w1) + (
                inverse[place + 2, i] * w2 + inverse[place + 3, i] * w3
            )
        place += 4
    while place < len(active):
        w0 = b[active[place]]
        for i in range(dim):
            result[i] += inverse[place, i] * w0
        place += 1


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    tableau, y, f, stages, mid = method.tableau, work.y, work.f, work.stages, work.middle
    dim = len(y)
    s0, s1, s2, s3, b = stages[0], stages[1], stages[2], stages[3], stages[4]
    a10, a20, a21 = tableau[1, 0], tableau[2, 0], tableau[2, 1]
    a30, a31, a32 = tableau[3, 0], tableau[3, 1], tableau[3, 2]
    m0, m1, m2, m3 = tableau[M, 0], tableau[M, 1], tableau[M, 2], tableau[M, 3]
    e0, e1, e2, e3 = tableau[E, 0], tableau[E, 1], tableau[E, 2], tableau[E, 3]
    work.places[0] = index_above(method.grid, work.places[0], h)
    inverse = method.operators[work.places[0]]
    turns = len(method.rotating) > 0
    cosine, sine = heading_of(method.rotating, y)
    scale = GAMMA * h
    for stage in range(4):
        if stage == 0:
            for i in range(dim):
                b[i] = scale * f[i]
        else:
            if stage == 1:
                for i in range(dim):
                    mid[i] = y[i] + a10 * s0[i]
            elif stage == 2:
                for i in range(dim):
                    mid[i] = y[i] + a20 * s0[i] + a21 * s1[i]
            else:
                for i in range(dim):
                    mid[i] = y[i] + a30 * s0[i] + a31 * s1[i] + a32 * s2[i]
            rhs(problem, t + tableau[ALPHA, stage] * h, mid, b)
            g0, g1, g2 = tableau[4 + stage, 0], tableau[4 + stage, 1], tableau[4 + stage, 2]
            if stage == 1:
                for i in range(dim):
                    b[i] = scale * b[i] + g0 * s0[i]
            elif stage == 2:
                for i in range(dim):
                    b[i] = scale * b[i] + g0 * s0[i] + g1 * s1[i]
            else:
                for i in range(dim):
                    b[i] = scale * b[i] + g0 * s0[i] + g1 * s1[i] + g2 * s2[i]
        if turns:
            rotate(b, method.rotating, cosine, -sine)
        frozen_solve(inverse, method.active, b, stages[stage])
        if turns:
            rotate(stages[stage], method.rotating, cosine, sine)
    counts[RHS_CALLS] += 3
    counts[LINEAR_SOLVES] += 4
    for i in range(dim):
        work.new[i] = y[i] + m0 * s0[i] + m1 * s1[i] + m2 * s2[i] + m3 * s3[i]
        work.error[i] = e0 * s0[i] + e1 * s1[i] + e2 * s2[i] + e3 * s3[i]
    return True


def accept(problem, t, h, method, work, counts):
    """Right-hand side at the end of the step."""
    rhs(problem, t + h, work.new, work.f_new)
    counts[RHS_CALLS] += 1
