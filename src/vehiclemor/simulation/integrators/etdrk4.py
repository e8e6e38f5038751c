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

Steps are those of a grid; where a break point asks for another step h the functions of the nearest
one serve, exact for A = J grid[index] / h.  Operators: see `exponential_functions`.
"""

from vehiclemor.codegen.loop_types import matrix, vector
from vehiclemor.simulation.formulations.full import rhs
from vehiclemor.simulation.integrators.step_grid import (
    add_rows,
    heading_of,
    index_below,
    nearest_index,
    rotate,
)
from vehiclemor.simulation.integrators.structures import RHS_CALLS, Work

# Called at one place of the time loop: bundles of arrays cost more to pass than they take inside.
INLINED = (
    "begin",
    "accept",
    "longest_step",
    "step",
    "take_stages",
    "estimate_error",
    "quadrature_weights",
)
# Share of the difference D5 - D4 that is the error, as in RK4(3)T: 1/10 to the weight 1/6.
ERROR_SHARE = 0.6
# Rows of scratch space behind those of the four D.
V, HALF, WHOLE_STEP, PRODUCT, F1, Y_PAST, F_PAST, CHANGE = range(4, 12)


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on."""
    rows, none = matrix(buffer, first, 5, dim), vector(buffer, first, 0)
    stages = matrix(buffer, first + 5 * dim, 12, dim)
    curve = matrix(buffer, first + 17 * dim, 3, dim)
    states = rows[0], rows[1], rows[2], rows[3], rows[4], stages[V]
    whole, memory = (integers, integers), vector(buffer, first + 20 * dim, 4)
    return Work(*states, stages, curve, rows, rows, *whole, memory, none, none, none)


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span; there is no step before."""
    rhs(problem, t, work.y, work.f)
    work.places[0], work.memory[0] = len(method.grid) // 2, 0.0
    for i in range(len(work.y)):
        work.stages[Y_PAST, i], work.stages[F_PAST, i] = work.y[i], work.f[i]


def longest_step(h, method, control, work):
    """The longest step of the grid that is not above h."""
    work.places[0] = index_below(method.grid, work.places[0], h)
    return min(h, method.grid[work.places[0]])


def quadrature_weights(past, h):
    """Weights of D in the second estimate of the error: a step before, half-way and at the end."""
    if past <= 0.0:
        return 0.0, -4.0, 2.0
    ratio = past / h
    return 1.0 / (ratio * (ratio + 1.0)), -4.0, (1.0 + 2.0 * ratio) / (1.0 + ratio)


def applied(operators, first, b, result):
    """Product of a matrix with b; its transpose are rows of the operators from `first` on."""
    for i in range(len(b)):
        result[i] = 0.0
    add_rows(operators, first, b, len(b), result)


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    index = nearest_index(method.grid, work.places[0], h)
    work.places[0] = index
    stretch = method.grid[index] / h
    take_stages(problem, t, h, stretch, method, work)
    estimate_error(h, stretch, method, work)
    counts[RHS_CALLS] += 4
    return True


def take_stages(problem, t, h, stretch, method, work):
    """Stages v and their D; the last stage is the new state."""
    rows, y, mid = work.stages, work.y, work.new
    v, product, f1 = rows[V], rows[PRODUCT], rows[F1]
    half, whole_step = rows[HALF], rows[WHOLE_STEP]
    dim = len(y)
    operators = method.operators[work.places[0]]
    turns = len(method.rotating) > 0
    cosine, sine = heading_of(method.rotating, y)
    for i in range(dim):
        f1[i] = work.f[i]
    if turns:
        rotate(f1, method.rotating, cosine, -sine)
    applied(operators, dim, f1, half)
    applied(operators, 3 * dim, f1, whole_step)
    for stage in range(4):
        if stage == 0:
            for i in range(dim):
                v[i] = h * half[i]
        elif stage == 1:
            applied(operators, 2 * dim, rows[0], product)
            for i in range(dim):
                v[i] = h * (half[i] + product[i])
        elif stage == 2:
            applied(operators, 4 * dim, rows[1], product)
            for i in range(dim):
                v[i] = h * (whole_step[i] + product[i])
        else:
            for i in range(dim):
                mid[i] = rows[0, i] + rows[1, i]
            applied(operators, 5 * dim, mid, product)
            applied(operators, 6 * dim, rows[2], work.error)
            for i in range(dim):
                v[i] = h * (whole_step[i] + product[i] + work.error[i])
        applied(operators, 0, v, product)
        if turns:
            rotate(v, method.rotating, cosine, sine)
        for i in range(dim):
            mid[i] = y[i] + v[i]
        rhs(problem, t + (0.5 if stage < 2 else 1.0) * h, mid, work.f_new)
        d = rows[stage]
        for i in range(dim):
            d[i] = work.f_new[i]
        if turns:
            rotate(d, method.rotating, cosine, -sine)
        for i in range(dim):
            d[i] -= f1[i] + stretch * product[i]


def estimate_error(h, stretch, method, work):
    """Estimates of the error of the step and of the cubic between its ends."""
    rows, y, f = work.stages, work.y, work.f
    v, product, change_of = rows[V], rows[PRODUCT], rows[CHANGE]
    half, whole_step = rows[HALF], rows[WHOLE_STEP]
    dim = len(y)
    operators = method.operators[work.places[0]]
    turns = len(method.rotating) > 0
    cosine, sine = heading_of(method.rotating, y)
    at_past, at_half, at_end = quadrature_weights(work.memory[0], h)
    for i in range(dim):
        v[i] = y[i] - rows[Y_PAST, i]
        change_of[i] = f[i] - rows[F_PAST, i]
    if turns:
        rotate(v, method.rotating, cosine, -sine)
        rotate(change_of, method.rotating, cosine, -sine)
    applied(operators, 0, v, product)
    for i in range(dim):
        change = ERROR_SHARE * (rows[3, i] - rows[2, i]) + at_half * 0.5 * (rows[0, i] + rows[1, i])
        change += at_end * rows[3, i] + at_past * (change_of[i] - stretch * product[i])
        v[i] = h * change
    applied(operators, 6 * dim, v, work.error)
    applied(operators, 0, whole_step, product)
    # The shortest step of the grid is as good as a point in time.
    share = h if h > 1.0001 * method.grid[0] else 0.0
    for i in range(dim):
        v[i] = share * (half[i] - 0.5 * whole_step[i] + 0.125 * stretch * h * product[i])
    if turns:
        rotate(work.error, method.rotating, cosine, sine)
        rotate(v, method.rotating, cosine, sine)
    for i in range(dim):
        work.error[i] = abs(work.error[i]) + abs(v[i])


def accept(problem, t, h, method, work, counts):
    """Keep the beginning of the step for the next one's estimate of the error."""
    for i in range(len(work.y)):
        work.stages[Y_PAST, i], work.stages[F_PAST, i] = work.y[i], work.f[i]
    work.memory[0] = h
