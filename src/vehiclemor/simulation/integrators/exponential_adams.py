"""The exponential Adams method of orders 1 to 6 with one frozen Jacobian in modal form.

y' = A y + N(t, y), A = T B S: see `exponential_modes`.  With D_j = N_{n-j} - N_n and p the
polynomial of degree k - 1 through D_0 = 0, D_1, ..., D_{k-1}, the predictor and the corrector are

    y_p = y + h phi_1(h A) f + h int_0^1 e^{(1-s) h A} p(s) ds
    y_c = y_p + h int_0^1 e^{(1-s) h A} omega(s) ds (D_p - p(1)) / omega(1),

omega(s) the product of all s - s_j: so y_c is of order k + 1, and the difference estimates the
error of the corrector of order k.  int e^{(1-s) z} s^m ds = m! phi_{m+1}(z).  Where A is zero these
are the Adams formulas for variable steps: they are taken for the whole vector, and T times what the
modes do otherwise is added.  A span begins with k = 1; then k rises in each step, up to 5.

Steps are those of a grid; where a break point asks for another step h the functions of the nearest
one serve, exact for A grid[index] / h.

S. P. Norsett, Lect. Notes Math. 109 (1969), 214-219; E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I (2nd ed., 1993), section III.5; M. Hochbruck, A. Ostermann, Acta
Numerica 19 (2010), section 2.5.
"""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import IntVector, Matrix, Vector, matrix
from vehiclemor.simulation.formulations.full import error_norm, rhs
from vehiclemor.simulation.integrators.shared import add_rows, index_below, nearest_index
from vehiclemor.simulation.integrators.structures import RHS_CALLS, rows_of

INLINED = (
    "begin",
    "accept",
    "longest_step",
    "step",
    "predict",
    "correct",
    "prepare_curve",
    "interpolate",
)
# Highest order of the predictor; steps that are kept; highest phi function.
MOST_ORDER, KEPT, PHI = 5, 7, 6
# By order: the error of the corrector over its distance from the predictor, for constant steps.
SHARE = (0.0, 1 / 2, 1 / 5, 1 / 9, 19 / 251, 27 / 475)
# Error of the quintic between equal steps over the fifth difference of the slopes: there linear
# motion has an error, which it has not at the end of a step, however long.
INTERPOLATION = 2e-4
# Longest first step of a span in s, of order 1.
FIRST_STEP = 1e-4
# The step grows by no more once the order is the highest.
GROW = 2.0
# Places: newest step in the ring of those kept, their number, order, index of the grid, steps with
# these weights, tries of this step, steps that must not grow.
HEAD, HELD, ORDER, INDEX, SAME, TRIES, HOLD, WEIGHTED = range(8)
# Rows of numbers: nodes of the polynomial, its coefficients, weights of the classical predictor, of
# the polynomial at the end of the step; times of the steps kept, and what follows.
NODES, POWERS, CLASSICAL, AT_END, TIMES, MEMORY = range(6)
# Last step and the step of the weights, size of the first slope, weight of the classical corrector.
LAST, STEP_OF_WEIGHTS, SLOPE, CORRECTOR = range(4)
# Rows of modal vectors: of the state, the predictor, the new state and what is added.
NOW, PREDICTED, NEW, ADDED = range(4)


class AdamsWork(NamedTuple):
    """Scratch space: what `structures.Work` has, and of the method.

    The predictor's state (dim,); rows (f, S f, N, y) of the steps kept, the predictor's last; modal
    vectors by row; weights (order + 1, r + 2 pairs) of N in the predictor, then in the corrector;
    sums (2, dim + 2 r) over the rows of the past in the classical predictor and at the end; numbers
    and places as above.
    """

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    predictor: Vector
    past: Matrix
    modal: Matrix
    weights: Matrix
    sums: Matrix
    numbers: Matrix
    places: IntVector


def work_space(buffer, first, integers, dim, inputs):
    """Scratch space from place `first` of the buffer on: 65 vectors and 48 numbers."""
    rows, place = matrix(buffer, first, 7, dim), first + 7 * dim
    past = matrix(buffer, place, KEPT + 1, 4 * dim)
    modal = matrix(buffer, place + 32 * dim, 4, dim)
    weights = matrix(buffer, place + 36 * dim, MOST_ORDER + 2, 2 * dim)
    sums = matrix(buffer, place + 50 * dim, 2, 4 * dim)
    numbers = matrix(buffer, place + 58 * dim, 6, 8)
    return AdamsWork(*rows_of(rows), rows[6], past, modal, weights, sums, numbers, integers)


def sizes(method, dim):
    """Numbers of modes and of pairs of them."""
    r = len(method.shared) - dim - 3
    return r, (method.operators.shape[2] - r) // 2


def begin(problem, t, method, work):
    """Right-hand side at the beginning of a span, the only step that is kept."""
    rhs(problem, t, work.y, work.f)
    places, numbers, dim = work.places, work.numbers, len(work.y)
    r, _ = sizes(method, dim)
    places[HEAD], places[HELD], places[ORDER] = 0, 1, 1
    places[INDEX] = len(method.grid) // 2
    places[SAME], places[TRIES], places[HOLD], places[WEIGHTED] = 0, 0, 0, 0
    numbers[TIMES, 0] = t
    numbers[MEMORY, LAST] = 0.0
    numbers[MEMORY, SLOPE] = error_norm(problem, work.f, work.y, 1.0)
    now = work.modal[NOW]
    for i in range(r):
        now[i] = 0.0
    add_rows(method.shared, 0, work.y, r, now)
    record(method, work, 0, work.f, work.y, now)


def record(method, work, row, f, y, modal):
    """Row (f, S f, N, y) of the past, with N = S f - B S y."""
    dim, shared, kept = len(y), method.shared, work.past[row]
    r, pairs = sizes(method, dim)
    for i in range(dim):
        kept[i] = f[i]
        kept[3 * dim + i] = y[i]
    slope = kept[dim : dim + r]
    for i in range(r):
        slope[i] = 0.0
    add_rows(shared, 0, f, r, slope)
    rates, forth, back = shared[dim + r], shared[dim + r + 1], shared[dim + r + 2]
    rest = kept[dim + r : dim + 2 * r]
    for i in range(r):
        rest[i] = slope[i] - rates[i] * modal[i]
    one, two = r - 2 * pairs, r - pairs
    for i in range(pairs):
        rest[one + i] -= forth[i] * modal[two + i]
        rest[two + i] -= back[i] * modal[one + i]


def longest_step(h, method, control, work):
    """The longest step of the grid that is not above h, short in the first step of a span."""
    places, numbers = work.places, work.numbers
    if places[HELD] == 1:
        slope = max(1.0, numbers[MEMORY, SLOPE])
        h = min(h, FIRST_STEP, 0.3 * math.sqrt(control.tolerance) / slope)
    elif places[ORDER] == MOST_ORDER:
        most = 1.0 if places[HOLD] > 0 else GROW
        h = min(h, most * numbers[MEMORY, LAST])
    if places[INDEX] > 0:
        # Shorter steps than those of the grid only where its shortest has failed.
        h = max(h, method.grid[0])
    places[INDEX] = index_below(method.grid, places[INDEX], h)
    return min(h, method.grid[places[INDEX]])


def step(problem, t, h, method, work, counts):
    """Try a step; it is always possible."""
    places, memory = work.places, work.numbers[MEMORY]
    places[TRIES] += 1
    if places[TRIES] > 2 and places[ORDER] > 2:
        places[ORDER] -= 1
    k = places[ORDER]
    index = nearest_index(method.grid, places[INDEX], h)
    table = method.operators[index]
    if h != memory[STEP_OF_WEIGHTS] or k != places[WEIGHTED] or places[SAME] < k:
        if h != memory[STEP_OF_WEIGHTS]:
            places[SAME] = 0
        memory[STEP_OF_WEIGHTS], places[WEIGHTED] = h, k
        for j in range(k):
            row = (places[HEAD] + j) % KEPT
            work.numbers[NODES, j] = (work.numbers[TIMES, row] - t) / h
        memory[CORRECTOR] = set_weights(k, table, work.numbers, work.weights)
    stretch = method.grid[index] / h
    predict(h, stretch, table, method, work)
    rhs(problem, t + h, work.predictor, work.f_new)
    counts[RHS_CALLS] += 1
    record(method, work, KEPT, work.f_new, work.predictor, work.modal[PREDICTED])
    correct(h, stretch, method, work)
    # The shortest step of the grid is as good as a point in time.
    between = INTERPOLATION * h if h > 1.0001 * method.grid[0] else 0.0
    difference = work.sums[1]
    for i in range(len(work.y)):
        distance = SHARE[k] * abs(work.new[i] - work.predictor[i])
        work.error[i] = distance + between * abs(difference[i])
    return True


def add_function(function, r, pairs, v, result):
    """Add a function of h B times v to the result."""
    for i in range(r):
        result[i] += function[i] * v[i]
    one, two = r - 2 * pairs, r - pairs
    for i in range(pairs):
        result[one + i] += function[r + i] * v[two + i]
        result[two + i] += function[r + pairs + i] * v[one + i]


def predict(h, stretch, table, method, work):
    """State and modes of the predictor."""
    past, sums, modal, numbers = work.past, work.sums, work.modal, work.numbers
    dim, k, head = len(work.y), work.places[ORDER], work.places[HEAD]
    r, pairs = sizes(method, dim)
    width = dim + 2 * r
    in_step, at_end = sums[0], sums[1]
    for i in range(width):
        in_step[i], at_end[i] = 0.0, 0.0
    now, added, predicted = modal[NOW], modal[ADDED], modal[PREDICTED]
    for i in range(r):
        predicted[i] = 0.0
    add_function(table[0], r, pairs, past[head, dim : dim + r], predicted)
    for j in range(k):
        row = past[(head + j) % KEPT]
        c, e = numbers[CLASSICAL, j], numbers[AT_END, j]
        for i in range(width):
            in_step[i] += c * row[i]
            at_end[i] += e * row[i]
        blend(stretch, row, dim, r, added)
        add_function(work.weights[j], r, pairs, added, predicted)
    for i in range(r):
        change = h * predicted[i]
        added[i] = change - h * in_step[dim + i]
        predicted[i] = now[i] + change
    for i in range(dim):
        work.predictor[i] = work.y[i] + h * in_step[i]
    add_rows(method.shared, dim, added[:r], dim, work.predictor)


def blend(stretch, row, dim, r, result):
    """N of a row for the A of the step: stretch times the stored one."""
    for i in range(r):
        result[i] = row[dim + i] + stretch * (row[dim + r + i] - row[dim + i])


def correct(h, stretch, method, work):
    """State and modes of the corrector, by what the slope differs from the polynomial."""
    sums, modal = work.sums, work.modal
    dim, k = len(work.y), work.places[ORDER]
    r, pairs = sizes(method, dim)
    difference, last = sums[1], work.past[KEPT]
    for i in range(dim + 2 * r):
        difference[i] = last[i] - difference[i]
    added, new = modal[ADDED], modal[NEW]
    for i in range(r):
        new[i] = 0.0
    blend(stretch, difference, dim, r, added)
    add_function(work.weights[k], r, pairs, added, new)
    classical = h * work.numbers[MEMORY, CORRECTOR]
    for i in range(r):
        change = h * new[i]
        added[i] = change - classical * difference[dim + i]
        new[i] = modal[PREDICTED, i] + change
    for i in range(dim):
        work.new[i] = work.predictor[i] + classical * difference[i]
    add_rows(method.shared, dim, added[:r], dim, work.new)


def accept(problem, t, h, method, work, counts):
    """Right-hand side at the end of the step; the order rises, unless a try has failed."""
    rhs(problem, t + h, work.new, work.f_new)
    counts[RHS_CALLS] += 1
    places, modal = work.places, work.modal
    r, _ = sizes(method, len(work.y))
    head = (places[HEAD] + KEPT - 1) % KEPT
    places[HEAD], places[HELD] = head, min(places[HELD] + 1, KEPT)
    places[SAME] += 1
    work.numbers[TIMES, head] = t + h
    work.numbers[MEMORY, LAST] = h
    for i in range(r):
        modal[NOW, i] = modal[NEW, i]
    record(method, work, head, work.f_new, work.new, modal[NOW])
    if places[TRIES] > 1:
        places[HOLD] = places[ORDER] + 1
    elif places[ORDER] < MOST_ORDER:
        places[ORDER] = min(places[ORDER] + 1, places[HELD])
    elif places[HOLD] > 0:
        places[HOLD] -= 1
    places[TRIES] = 0


def prepare_curve(h, work):
    """The steps kept are all that the interpolation needs."""


def interpolate(z, h, work):
    """State at the part z of the step that has passed, into `middle`: by values and slopes.

    A quintic through the step before, the beginning and the end of this one; a cubic in the first.
    """
    places, past, middle = work.places, work.past, work.middle
    y, f, new, f_new = work.y, work.f, work.new, work.f_new
    if places[HELD] < 3:
        end = z * z * (3.0 - 2.0 * z)
        slope, slope_end = h * z * (1.0 - z) * (1.0 - z), -h * z * z * (1.0 - z)
        for i in range(len(middle)):
            middle[i] = (1.0 - end) * y[i] + end * new[i] + (slope * f[i] + slope_end * f_new[i])
        return
    row = (places[HEAD] + 2) % KEPT
    earlier, times = past[row], work.numbers[TIMES]
    a = (times[row] - times[(places[HEAD] + 1) % KEPT]) / h
    before, now, end = (
        z * (z - 1.0) / (a * (a - 1.0)),
        (z - a) * (z - 1.0) / a,
        (z - a) * z / (1.0 - a),
    )
    before, now, end = before * before, now * now, end * end
    v2 = before * (1.0 - 2.0 * (1.0 / a + 1.0 / (a - 1.0)) * (z - a))
    v1 = now * (1.0 + 2.0 * (1.0 / a + 1.0) * z)
    v0 = end * (1.0 - 2.0 * (1.0 / (1.0 - a) + 1.0) * (z - 1.0))
    s2, s1, s0 = h * before * (z - a), h * now * z, h * end * (z - 1.0)
    shift = 3 * len(middle)
    for i in range(len(middle)):
        value = v2 * earlier[shift + i] + v1 * y[i] + v0 * new[i]
        middle[i] = value + (s2 * earlier[i] + s1 * f[i] + s0 * f_new[i])


def set_weights(k, table, numbers, weights):
    """Weights of a step with k nodes: zero and past ones; classical weight of the corrector.

    The table has phi_1, phi_2, ...  of h B by row; numbers are rows of nodes in steps, and of what
    is set, see above.  The weights of N (k + 1, columns) in the predictor, the last in the
    corrector, are set.
    """
    nodes, powers = numbers[NODES], numbers[POWERS]
    classical, at_end = numbers[CLASSICAL], numbers[AT_END]
    size = table.shape[1]
    classical[0], at_end[0] = 1.0, 1.0
    for i in range(size):
        weights[0, i] = 0.0
    # Lagrange polynomial of each past node; N_n has what is left of D_j.
    for j in range(1, k):
        at_end[j] = polynomial(k, j, nodes, powers)
        classical[j] = integrals(k, powers, table, weights[j])
        classical[0] -= classical[j]
        at_end[0] -= at_end[j]
        for i in range(size):
            weights[0, i] -= weights[j, i]
    # omega / omega(1) for the corrector.
    last = 1.0 / polynomial(k, k, nodes, powers)
    for m in range(k + 1):
        powers[m] *= last
    return integrals(k + 1, powers, table, weights[k])


def polynomial(k, without, nodes, powers):
    """Coefficients of the product of s - s_l over all nodes but one, 1 there; value at s = 1.

    No node is left out if there is none of that number.
    """
    for m in range(k + 1):
        powers[m] = 0.0
    powers[0] = 1.0
    degree, at_end = 0, 1.0
    for node in range(k):
        if node == without:
            continue
        scale = 1.0 if without == k else 1.0 / (nodes[without] - nodes[node])
        for m in range(degree + 1, 0, -1):
            powers[m] = scale * (powers[m - 1] - nodes[node] * powers[m])
        powers[0] *= -scale * nodes[node]
        at_end *= scale * (1.0 - nodes[node])
        degree += 1
    return at_end


def integrals(k, powers, table, weights):
    """Integral over the step of a polynomial of degree k - 1 that vanishes at its beginning.

    Its integrals with e^{(1-s) h B} are the weights.
    """
    total, factorial = 0.0, 1.0
    for i in range(len(weights)):
        weights[i] = 0.0
    for m in range(1, k):
        factorial *= m
        total += powers[m] / (m + 1)
        scale = factorial * powers[m]
        for i in range(table.shape[1]):
            weights[i] += scale * table[m, i]
    return total
