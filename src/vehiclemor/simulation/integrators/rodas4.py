"""Rosenbrock method RODAS of order 4(3) with a fresh Jacobian in every step.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed., Springer 1996), sections
IV.7 and VI.4, in transformed stages (no product with the Jacobian):

    (I / (gamma h) - A) U_i = f(t + alpha_i h, y + sum a_ij U_j) + sum c_ij / h U_j + d_i h f_t

Rows of the tableau: a (6), c (6), then alpha, d, m and e.
"""

from vehiclemor.codegen.loop_types import matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.dense_solves import factorise, substitute
from vehiclemor.simulation.integrators.structures import (
    FACTORISATIONS,
    JACOBIANS,
    LINEAR_SOLVES,
    RHS_CALLS,
    Work,
    rows_of,
)

GAMMA = 0.25
S = 6
ALPHA, D, M, E = 12, 13, 14, 15
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "longest_step", "step")


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on."""
    ends = matrix(buffer, first, 6, dim)
    stages = matrix(buffer, first + 6 * dim, S + 3, dim)
    curve = matrix(buffer, first + (S + 9) * dim, 3, dim)
    place = first + (S + 12) * dim
    squares = matrix(buffer, place, dim, dim), matrix(buffer, place + dim * dim, dim, dim)
    none = vector(buffer, first, 0)
    whole = integers[4 : 4 + dim], integers[:4]
    return Work(*rows_of(ends), stages, curve, *squares, *whole, none, none, none, none)


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span; no Jacobian is known yet."""
    rhs(problem, t, work.y, work.f)
    work.places[0] = 0


def longest_step(h, method, control, work):
    """Any step size will do."""
    return h


def difference_jacobian(problem, t, method, work, counts):
    """Jacobian by forward differences, inactive columns zero; time derivative after the stages."""
    y, f, jacobian, shifted = work.y, work.f, work.jacobian, work.middle
    image, f_t = work.stages[S], work.stages[S + 1]
    dim = len(y)
    for i in range(dim):
        for j in range(dim):
            jacobian[i, j] = 0.0
    for column in method.active:
        if column >= dim:
            continue
        for i in range(dim):
            shifted[i] = y[i]
        change = 1.5e-8 * max(abs(y[column]), 1.0)
        shifted[column] = y[column] + change
        change = shifted[column] - y[column]
        rhs(problem, t, shifted, image)
        for i in range(dim):
            jacobian[i, column] = (image[i] - f[i]) / change
    later = 1e-7 * (1.0 + abs(t))
    rhs(problem, t + later, y, f_t)
    for i in range(dim):
        f_t[i] = (f_t[i] - f[i]) / later
    counts[RHS_CALLS] += min(len(method.active), dim) + 1
    counts[JACOBIANS] += 1


def step(problem, t, h, method, work, counts):
    """Try a step; False if its matrix is singular."""
    tableau, y, f, stages, mid = method.tableau, work.y, work.f, work.stages, work.middle
    f_t, b, matrix_of = work.stages[S + 1], work.stages[S + 2], work.factors
    dim = len(y)
    if work.places[0] == 0:
        difference_jacobian(problem, t, method, work, counts)
        work.places[0] = 1
    for i in range(dim):
        for j in range(dim):
            matrix_of[i, j] = -work.jacobian[i, j]
        matrix_of[i, i] += 1.0 / (GAMMA * h)
    counts[FACTORISATIONS] += 1
    if not factorise(matrix_of, work.pivots):
        return False
    for stage in range(S):
        if stage == 0:
            for i in range(dim):
                b[i] = f[i]
        else:
            for i in range(dim):
                mid[i] = y[i]
            for j in range(stage):
                weight = tableau[stage, j]
                if weight != 0.0:
                    for i in range(dim):
                        mid[i] += weight * stages[j, i]
            rhs(problem, t + tableau[ALPHA, stage] * h, mid, b)
            counts[RHS_CALLS] += 1
            for j in range(stage):
                weight = tableau[S + stage, j] / h
                if weight != 0.0:
                    for i in range(dim):
                        b[i] += weight * stages[j, i]
        if tableau[D, stage] != 0.0:
            for i in range(dim):
                b[i] += tableau[D, stage] * h * f_t[i]
        counts[LINEAR_SOLVES] += 1
        substitute(matrix_of, work.pivots, b)
        for i in range(dim):
            stages[stage, i] = b[i]
    for i in range(dim):
        total, change = 0.0, 0.0
        for stage in range(S):
            total += tableau[M, stage] * stages[stage, i]
            change += tableau[E, stage] * stages[stage, i]
        work.new[i] = y[i] + total
        work.error[i] = change
    return True


def accept(problem, t, h, method, work, counts):
    """Right-hand side at the end of the step; the Jacobian is no longer fresh."""
    rhs(problem, t + h, work.new, work.f_new)
    counts[RHS_CALLS] += 1
    work.places[0] = 0
