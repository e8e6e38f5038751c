"""Explicit Runge-Kutta pair of order 5(4) with dense output.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6
(1980); dense output and step size control after E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I (2nd ed., Springer 1993), sections II.4 to II.6.
"""

from vehiclemor.codegen.loop_types import matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.structures import RHS_CALLS, Work

A21 = 1 / 5
A31, A32 = 3 / 40, 9 / 40
A41, A42, A43 = 44 / 45, -56 / 15, 32 / 9
A51, A52, A53, A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A61, A62, A63, A64, A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
B1, B3, B4, B5, B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
E1, E3, E4, E5, E6, E7 = (71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
D1, D3, D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
D5, D6, D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423
# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = ("accept", "step")


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on."""
    # Stages as rows of one array: so the compiler sees few arrays that might overlap.
    k = matrix(buffer, first, 7, dim)
    ends, none = matrix(buffer, first + 7 * dim, 3, dim), vector(buffer, first, 0)
    states = ends[0], k[0], ends[1], k[6], ends[2], ends[2]
    return Work(*states, k, k, k, k, integers, integers, none, none, none, none)


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span."""
    rhs(problem, t, work.y, work.f)


def step(problem, t, h, method, work, counts):
    """Try a step; False if that is impossible."""
    y, k, mid = work.y, work.stages, work.middle
    dim = len(y)
    for stage in range(1, 7):
        if stage == 1:
            moment = t + 0.2 * h
            for i in range(dim):
                mid[i] = y[i] + h * (A21 * k[0, i])
        elif stage == 2:
            moment = t + 0.3 * h
            for i in range(dim):
                mid[i] = y[i] + h * (A31 * k[0, i] + A32 * k[1, i])
        elif stage == 3:
            moment = t + 0.8 * h
            for i in range(dim):
                mid[i] = y[i] + h * (A41 * k[0, i] + A42 * k[1, i] + A43 * k[2, i])
        elif stage == 4:
            moment = t + 8 / 9 * h
            for i in range(dim):
                mid[i] = y[i] + h * (A51 * k[0, i] + A52 * k[1, i] + A53 * k[2, i] + A54 * k[3, i])
        elif stage == 5:
            moment = t + h
            for i in range(dim):
                mid[i] = y[i] + h * (
                    A61 * k[0, i] + A62 * k[1, i] + A63 * k[2, i] + A64 * k[3, i] + A65 * k[4, i]
                )
        else:
            moment = t + h
            for i in range(dim):
                mid[i] = y[i] + h * (
                    B1 * k[0, i] + B3 * k[2, i] + B4 * k[3, i] + B5 * k[4, i] + B6 * k[5, i]
                )
        rhs(problem, moment, mid, k[stage])
    counts[RHS_CALLS] += 6
    for i in range(dim):
        work.new[i] = mid[i]
    for i in range(dim):
        work.error[i] = h * (
            E1 * k[0, i] + E3 * k[2, i] + E4 * k[3, i] + E5 * k[4, i] + E6 * k[5, i] + E7 * k[6, i]
        )
    return True


def accept(problem, t, h, method, work, counts):
    """The last stage is the right-hand side at the end of the step."""


def prepare_curve(h, work):
    """The stages are all that the interpolation needs."""


def interpolate(z, h, work):
    """State at the part z of the step that has passed, into `middle`: dense output of order 4."""
    y, new, k = work.y, work.new, work.stages
    for i in range(len(y)):
        difference = new[i] - y[i]
        bend = h * k[0, i] - difference
        back = difference - h * k[6, i] - bend
        last = h * (
            D1 * k[0, i] + D3 * k[2, i] + D4 * k[3, i] + D5 * k[4, i] + D6 * k[5, i] + D7 * k[6, i]
        )
        work.middle[i] = y[i] + z * (difference + (1 - z) * (bend + z * (back + (1 - z) * last)))
