"""The linear solves of a fixed step with one Jacobian, written out.

J. Verwer, E. Spee, J. Blom, W. Hundsdorfer, SIAM J. Sci. Comput. 20 (1999), 1456-1480: ROS2, with
gamma = 1 - 1/sqrt(2), is of order 2 for every matrix A, and L-stable if A is the Jacobian:

    (I - gamma h A) k1 = f(t, x),  (I - gamma h A) k2 = f(t + h, x + h k1) - 2 k1,
    x + h/2 (3 k1 + k2)

A is the Jacobian at a start, turned to the heading at the beginning of the step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.exceptions import InputError
from vehiclemor.exporting.straight_line import Lines, StraightLine
from vehiclemor.exporting.systems import ExportedSystem

GAMMA = 1.0 - np.sqrt(0.5)
# Entries of the inverse below it are left out: rounding, and A may be any matrix.
ROUNDING = 1e-12


def solve_function(system: ExportedSystem, step: float) -> StraightLine:
    """Solution (n,) of a linear system of the step, in s, for the arrays `x` and `r`.

    The Jacobian is that of the first start; `InputError` if the system has no states.
    """
    dynamics = system.dynamics
    if dynamics is None:
        raise InputError(f"{system.name} has no states, which ros2 could integrate")
    start = next(iter(system.starts.values()))
    inputs = np.array([quantity.default or 0.0 for quantity in system.inputs])
    frame, lines = dynamics.frame, Lines()
    x, vector = lines.entries("x", len(start)), lines.entries("r", len(start))
    heading = x[frame.rotating[0]] if frame.rotating else lines.number(0.0)
    sine, cosine = lines.new("sin", heading), lines.new("cos", heading)
    coordinates = lines.product(frame.transform, _turned(vector, frame.rotating, cosine, -sine))
    solved: list[Value] = []
    for block in frame.diagonal(dynamics.jacobian(start, inputs)):
        inverse = np.linalg.inv(np.eye(len(block)) - GAMMA * step * block)
        inverse[np.abs(inverse) < ROUNDING] = 0.0
        part = coordinates[len(solved) : len(solved) + len(block)]
        solved += lines.product(inverse, part)
    solution = _turned(lines.product(frame.inverse, solved), frame.rotating, cosine, sine)
    return StraightLine(lines.operations, [value.number for value in solution])


def _turned(
    vector: Sequence[Value], rotating: Sequence[int], cosine: Value, sine: Value
) -> list[Value]:
    """A vector of states whose pairs that turn with the heading are turned by an angle."""
    turned = list(vector)
    for a, b in zip(rotating[1::2], rotating[2::2], strict=True):
        turned[a] = cosine * vector[a] - sine * vector[b]
        turned[b] = sine * vector[a] + cosine * vector[b]
    return turned
