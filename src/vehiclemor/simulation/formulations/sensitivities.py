"""The full system with its tangents, velocities in the vehicle's frame: z = R(-psi) x, dz/dp.

With J, a right angle's turn of each pair that turns with the heading, and the subscript p for the
derivative along a parameter,

    x_p = R(psi) (z_p + psi_p J z),
    z' = R(-psi) x' - psi' J z,
    z_p' = R(-psi) x'_p - psi_p J R(-psi) x' - psi'_p J z - psi' J z_p.
"""

from vehiclemor.codegen.loop_types import call_kernel, call_tangent, matrix, vector
from vehiclemor.simulation.formulations.inputs import input_at
from vehiclemor.simulation.integrators.step_grid import heading_of, rotate
from vehiclemor.simulation.integrators.structures import DERIVATIVE, TANGENT

INLINED = ("rhs",)


def rhs(problem, t, y, dy):
    """Right-hand side at time t into dy (dim,)."""
    input_at(problem, t, problem.u)
    equations, x, u = problem.equations, problem.x, problem.u
    kernels, constants, turning = equations.kernels, equations.constants, equations.turning
    directions, lanes = equations.directions, equations.lanes
    count = len(directions)
    n = len(y) // (1 + count)
    lift(problem, y, x)
    call_kernel(kernels, DERIVATIVE, x, u, constants, dy)
    moved, rates = matrix(x, n, count, n), matrix(dy, n, count, n)
    for first in range(0, count, lanes):
        # The last may have been computed before.
        row = min(first, count - lanes)
        call_tangent(kernels, TANGENT, x, u, constants, moved, directions, rates, row)
    if len(turning) == 0:
        return
    cosine, sine = heading_of(turning, y)
    rotate(dy, turning, cosine, -sine)
    rate = dy[turning[0]]
    for part in range(count):
        own, tangent = rates[part], vector(y, n * (1 + part), n)
        change, change_rate = tangent[turning[0]], own[turning[0]]
        rotate(own, turning, cosine, -sine)
        for k in range(1, len(turning), 2):
            a, b = turning[k], turning[k + 1]
            own[a] += change * dy[b] + change_rate * y[b] + rate * tangent[b]
            own[b] -= change * dy[a] + change_rate * y[a] + rate * tangent[a]
    for k in range(1, len(turning), 2):
        dy[turning[k]] += rate * y[turning[k + 1]]
        dy[turning[k + 1]] -= rate * y[turning[k]]


def lift(problem, y, x):
    """State and tangents x (n (1 + count),) of the transformed ones."""
    turned(problem, y, x, 1.0)


def project(problem, t, x, y, counts):
    """Transformed state and tangents y (dim,) of those of a system x (n (1 + count),)."""
    turned(problem, x, y, -1.0)


def turned(problem, given, found, sign):
    """Turned with the heading or back: b = R(s psi) a, b_p = R(s psi) (a_p + s psi_p J a)."""
    turning, count = problem.equations.turning, len(problem.equations.directions)
    n = len(given) // (1 + count)
    for i in range(len(given)):
        found[i] = given[i]
    if len(turning) == 0:
        return
    cosine, sine = heading_of(turning, given)
    rotate(found, turning, cosine, sign * sine)
    for part in range(count):
        own = vector(found, n * (1 + part), n)
        change = sign * own[turning[0]]
        for k in range(1, len(turning), 2):
            a, b = turning[k], turning[k + 1]
            own[a] -= change * given[b]
            own[b] += change * given[a]
        rotate(own, turning, cosine, sign * sine)
