"""Explicit Runge-Kutta pairs: each is a table of coefficients, see `pair_table`.

The last stage is the right-hand side at the end of a step, where the next step begins.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Matrix, Vector, matrix, vector
from vehiclemor.simulation.integrators.contract import rhs
from vehiclemor.simulation.loop_arguments import RHS_CALLS

# Scratch space beside the stages, by vector.
VECTORS = ("y", "new", "error", "middle")
# Powers of the part of a step that has passed, in dense output.
POWERS = 4
# Called once in the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step")


class Work(NamedTuple):
    """Scratch space: `contract.WORK`, stages by row, coefficients of dense output by power."""

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    stages: Matrix
    curve: Matrix


def pair_table(
    weights: Sequence[Sequence[float]],
    error: Sequence[float],
    correction: Sequence[float] | None = None,
) -> np.ndarray:
    """Table (s + 2 + `POWERS`, s) of a pair of s stages.

    Its rows are the weights by stage, the times of the stages, the error, dense output by power.
    Weights are of the stages before, for the second and further stages, the last of which gives the
    new state; the error weighs (s,) the stages in the difference of both solutions.  Dense output
    is the cubic through states and slopes at both ends of a step, plus h z^2 (1 - z)^2 times the
    stages with the weights `correction` (s,), where z is the part of the step that has passed.
    """
    s = len(weights) + 1
    a, ends = np.zeros((s, s)), np.eye(s)[[0, -1]]
    for stage, row in enumerate(weights, start=1):
        a[stage, : len(row)] = row
    more = np.zeros(s) if correction is None else np.array(correction)
    square = 3.0 * a[-1] - 2.0 * ends[0] - ends[1] + more
    cube = ends[0] + ends[1] - 2.0 * a[-1] - 2.0 * more
    return np.vstack([a, a.sum(axis=1), error, ends[0], square, cube, more])


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


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span."""
    rhs(problem, t, work.y, work.f)


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


def accept(problem, t, h, method, work, counts):
    """The last stage is the right-hand side at the end of the step."""


def prepare_curve(h, method, work):
    """Coefficients of dense output by power."""
    s = len(work.stages)
    for power in range(POWERS):
        combine(h, method.tableau[s + 2 + power], work.stages, s, work.curve[power])


def interpolate(part, h, work):
    """State where a part of the step has passed, into `middle`."""
    y, curve = work.y, work.curve
    for i in range(len(y)):
        total = 0.0
        for power in range(POWERS - 1, -1, -1):
            total = part * (curve[power, i] + total)
        work.middle[i] = y[i] + total
