"""Rosenbrock method RODAS of order 4(3) with a fresh Jacobian in every step.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed., Springer 1996), sections
IV.7 and VI.4, in transformed stages (no product with the Jacobian):

    (I / (gamma h) - A) U_i = f(t + alpha_i h, y + sum a_ij U_j) + sum c_ij / h U_j + d_i h f_t

Rows of the tableau: a (6), c (6), then alpha, d and m; gamma is 1/4.  The last stage is the error.
"""

from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import IntVector, Matrix, Vector, matrix
from vehiclemor.simulation.integrators.contract import POWERS, rhs
from vehiclemor.simulation.integrators.dense_solves import factorise, substitute
from vehiclemor.simulation.loop_arguments import FACTORISATIONS, JACOBIANS, LINEAR_SOLVES, RHS_CALLS

GAMMA = 0.25
S = 6
ALPHA, D, M = 12, 13, 14
# Scratch space: vectors, then stages and powers of the cubic; matrices; one integer.
VECTORS = ("y", "f", "new", "f_new", "error", "middle", "image", "f_t", "b")
ROWS, SQUARES, FLAGS = len(VECTORS) + S + POWERS, 2, 1
# Called once in the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step")


def tableau() -> np.ndarray:
    """Coefficients (15, 6), see above."""
    a, c = np.zeros((6, 6)), np.zeros((6, 6))
    a[1, :1] = [1.544]
    a[2, :2] = [0.9466785280815826, 0.2557011698983284]
    a[3, :3] = [3.314825187068521, 2.896124015972201, 0.9986419139977817]
    a[4, :4] = [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950]
    a[5, :4] = a[4, :4]
    a[5, 4] = 1.0
    c[1, :1] = [-5.6688]
    c[2, :2] = [-2.430093356833875, -0.2063599157091915]
    c[3, :3] = [-0.1073529058151375, -9.594562251023355, -20.47028614809616]
    c[4, :4] = [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160]
    c[5, :5] = [
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ]
    m = a[5].copy()
    m[5] = 1.0
    alpha = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
    d = np.array([0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0])
    return np.vstack([a, c, alpha, d, m])


class Work(NamedTuple):
    """Scratch space: `contract`'s vectors, coefficients of the cubic, and what a step needs.

    Right-hand side at a shifted state, time derivative, right side of a linear system; stages by
    row; Jacobian, factors and pivots of the matrix; whether the Jacobian is fresh.
    """

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    image: Vector
    f_t: Vector
    b: Vector
    stages: Matrix
    curve: Matrix
    jacobian: Matrix
    factors: Matrix
    pivots: IntVector
    fresh: IntVector


def work_space(buffer, first, integers, dim, inputs, method):
    """See `contract.work_space`."""
    rows = matrix(buffer, first, len(VECTORS), dim)
    stages_at = first + len(VECTORS) * dim
    curve_at = stages_at + S * dim
    squares_at = curve_at + POWERS * dim
    return Work(
        y=rows[0],
        f=rows[1],
        new=rows[2],
        f_new=rows[3],
        error=rows[4],
        middle=rows[5],
        image=rows[6],
        f_t=rows[7],
        b=rows[8],
        stages=matrix(buffer, stages_at, S, dim),
        curve=matrix(buffer, curve_at, POWERS, dim),
        jacobian=matrix(buffer, squares_at, dim, dim),
        factors=matrix(buffer, squares_at + dim * dim, dim, dim),
        pivots=integers[FLAGS : FLAGS + dim],
        fresh=integers[:FLAGS],
    )


def begin(method, work):
    """No Jacobian is known yet."""
    work.fresh[0] = 0


def difference_jacobian(problem, t, method, work, counts):
    """Jacobian by forward differences, inactive columns zero; time derivative after the stages."""
    y, f, jacobian, shifted = work.y, work.f, work.jacobian, work.middle
    image, f_t = work.image, work.f_t
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
    f_t, b, factors = work.f_t, work.b, work.factors
    dim = len(y)
    if work.fresh[0] == 0:
        difference_jacobian(problem, t, method, work, counts)
        work.fresh[0] = 1
    for i in range(dim):
        for j in range(dim):
            factors[i, j] = -work.jacobian[i, j]
        factors[i, i] += 1.0 / (GAMMA * h)
    counts[FACTORISATIONS] += 1
    if not factorise(factors, work.pivots):
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
        substitute(factors, work.pivots, b)
        for i in range(dim):
            stages[stage, i] = b[i]
    for i in range(dim):
        total = 0.0
        for stage in range(S):
            total += tableau[M, stage] * stages[stage, i]
        work.new[i] = y[i] + total
        work.error[i] = stages[S - 1, i]
    return True


def accept(problem, t, h, method, work, counts):
    """Right-hand side at the end of the step; the Jacobian is no longer fresh."""
    rhs(problem, t + h, work.new, work.f_new)
    counts[RHS_CALLS] += 1
    work.fresh[0] = 0
