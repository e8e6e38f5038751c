"""Explicit Runge-Kutta pairs: each is a table of coefficients, see `pair_table`.

The last stage is the right-hand side at the end of a step, where the next step begins.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Matrix, Vector, matrix, vector
from vehiclemor.simulation.integrators.contract import POWERS, rhs
from vehiclemor.simulation.loop_arguments import RHS_CALLS

# Scratch space beside the stages, by vector.
VECTORS = ("y", "new", "error", "middle")
# Called once in the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("step",)


class Work(NamedTuple):
    """Scratch space: `contract`'s vectors, stages by row, coefficients of dense output by power."""

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    stages: Matrix
    curve: Matrix


def pair_table(weights: Sequence[Sequence[float]], error: Sequence[float]) -> np.ndarray:
    """Table (s + 2, s) of a pair of s stages: weights by stage, times of the stages, error.

    Weights are of the stages before, for the second and further stages, the last of which gives the
    new state; the error weighs (s,) the stages in the difference of both solutions.
    """
    s = len(weights) + 1
    a = np.zeros((s, s))
    for stage, row in enumerate(weights, start=1):
        a[stage, : len(row)] = row
    return np.vstack([a, a.sum(axis=1), error])


def scratch_rows(table: np.ndarray) -> int:
    """Vectors of scratch space of a pair."""
    return len(VECTORS) + table.shape[1] + POWERS


def work_space(buffer, first, integers, dim, inputs, method):
    """See `contract.work_space`."""
    count, stages_at = method.tableau.shape[1], first + len(VECTORS) * dim
    stages = matrix(buffer, stages_at, count, dim)
    return Work(
        y=vector(buffer, first, dim),
        f=stages[0],
        new=vector(buffer, first + dim, dim),
        f_new=stages[count - 1],
        error=vector(buffer, first + 2 * dim, dim),
        middle=vector(buffer, first + 3 * dim, dim),
        stages=stages,
        curve=matrix(buffer, stages_at + count * dim, POWERS, dim),
    )


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    table, stages, y, new = method.tableau, work.stages, work.y, work.new
    s = len(stages)
    for stage in range(1, s):
        combine(h, table[stage], stages, stage, new)
        for i in range(len(y)):
            new[i] += y[i]
        rhs(problem, t + table[s, stage] * h, new, stages[stage])
    counts[RHS_CALLS] += s - 1
    combine(h, table[s + 1], stages, s, work.error)
    return True


def combine(h, weights, stages, count, result):
    """The sum of h times the first stages with their weights."""
    for i in range(len(result)):
        result[i] = 0.0
    for j in range(count):
        weight = h * weights[j]
        for i in range(len(result)):
            result[i] += weight * stages[j, i]
