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

Steps are those of a ladder; where a break point asks for another step h the functions of its rung
serve, exact for A = J rung / h.  Step sizes follow a PI controller (E. Hairer, G. Wanner, Solving
Ordinary Differential Equations II (2nd ed., Springer 1996), section IV.2).
"""

import math

from vehiclemor.simulation.system_loops import error_norm, slope, slope_apart
from vehiclemor.simulation.w_method_loops import cubic, turn

INLINED = ("rung_below", "nearest_rung", "quadrature_weights", "growth")

# Share of the difference D5 - D4 that is the error, as in RK4(3)T: 1/10 to the weight 1/6.
ERROR_SHARE = 0.6
# Logarithm below which the controller forgets how small an error was.
LEAST = -9.0


def rung_below(ladder, rung, h):
    """Number of the longest step of the ladder that is not above h, sought from the one before."""
    while rung > 0 and ladder[rung] > 1.0001 * h:
        rung -= 1
    while rung < len(ladder) - 1 and ladder[rung + 1] <= 1.0001 * h:
        rung += 1
    return rung


def nearest_rung(ladder, rung, h):
    """Number of the step of the ladder that is nearest to h."""
    while rung > 0 and ladder[rung - 1] * ladder[rung] > h * h:
        rung -= 1
    while rung < len(ladder) - 1 and ladder[rung + 1] * ladder[rung] < h * h:
        rung += 1
    return rung


def quadrature_weights(past, h):
    """Weights of D in the second estimate of the error: a step before, half-way and at the end."""
    if past <= 0.0:
        return 0.0, -4.0, 2.0
    ratio = past / h
    return 1.0 / (ratio * (ratio + 1.0)), -4.0, (1.0 + 2.0 * ratio) / (1.0 + ratio)


def growth(logarithm, before):
    """Factor of the next step, from the logarithms of this error and the one before.

    Exponents 0.7 and 0.4 by the order of the estimate, see the reference.
    """
    return min(4.0, max(0.2, 0.9 * math.exp(0.1 * before - 0.175 * logarithm)))


def applied(table, first, dim, b, result):
    """Product of a matrix with b; its transpose are rows of the table from `first` on."""
    for i in range(dim):
        result[i] = 0.0
    # Four rows at a time: the result is loaded and stored a quarter as often.
    j = 0
    while j + 3 < dim:
        w0, w1, w2, w3 = b[j], b[j + 1], b[j + 2], b[j + 3]
        row = first + j
        for i in range(dim):
            result[i] += (table[row, i] * w0 + table[row + 1, i] * w1) + (
                table[row + 2, i] * w2 + table[row + 3, i] * w3
            )
        j += 4
    while j < dim:
        w0 = b[j]
        for i in range(dim):
            result[i] += table[first + j, i] * w0
        j += 1


def exponential_span(
    form,
    times,
    segment,
    y,
    dim,
    step,
    limits,
    signal,
    space,
    model,
    scratch,
    typical,
    vectors,
    stages,
    turning,
    ladder,
    tables,
    samples,
    sample,
    path,
    counts,
):
    """Integrate the full system over one smooth span; see `rosenbrock_span`.

    Parameters
    ----------
    turning
        Numbers of the heading and of pairs of states that turn with it: the tables belong to
        heading zero.  May be empty.
    ladder, tables
        Step sizes (L) in s and transposed matrices (L, 7 dim, dim), see `exponential_functions`.
    """
    t, end = times
    tolerance, longest, most_calls = limits
    f, mid, v, f_new, half = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    whole_step, product, error_of, f1 = vectors[5], vectors[6], vectors[7], vectors[8]
    y_past, f_past, change_of = vectors[9], vectors[10], vectors[11]
    d2, d3, d4, d5 = stages[0], stages[1], stages[2], stages[3]
    curve = stages[4:7]
    slope_apart(form, t, segment, y, dim, signal, space, model, scratch, f)
    counts[0] += 1
    if step <= 0.0:
        size = error_norm(form, f, y, dim, space, typical, 1.0)
        step = longest
        if not size <= 1e-10:
            # Linear motion has no error, so no step need be shorter than the ladder's.
            step = max(ladder[0], 0.01 / size)
    turns = len(turning) > 0
    rejected = False
    before, past = 0.0, 0.0
    for i in range(dim):
        y_past[i], f_past[i] = y[i], f[i]
    rung = len(ladder) // 2
    while t < end - 1e-12 * (1.0 + abs(end)):
        if counts[0] > most_calls:
            return 1, t, step, sample
        h = min(step, longest)
        rung = rung_below(ladder, rung, h)
        h = min(h, ladder[rung])
        if t + 1.0001 * h > end:
            h = end - t
        elif t + 2.0 * h > end:
            # Two equal steps are better than a long and a tiny one.
            h = 0.5 * (end - t)
        if not h > 1e-14 * (1.0 + abs(t)):
            return 4, t, step, sample
        rung = nearest_rung(ladder, rung, h)
        table = tables[rung]
        stretch = ladder[rung] / h
        at_past, at_half, at_end = quadrature_weights(past, h)
        cosine, sine = 1.0, 0.0
        if turns:
            cosine, sine = math.cos(y[turning[0]]), math.sin(y[turning[0]])
        for i in range(dim):
            f1[i] = f[i]
        if turns:
            turn(f1, turning, cosine, -sine)
        applied(table, dim, dim, f1, half)
        applied(table, 3 * dim, dim, f1, whole_step)
        for stage in range(4):
            if stage == 0:
                for i in range(dim):
                    v[i] = h * half[i]
            elif stage == 1:
                applied(table, 2 * dim, dim, d2, product)
                for i in range(dim):
                    v[i] = h * (half[i] + product[i])
            elif stage == 2:
                applied(table, 4 * dim, dim, d3, product)
                for i in range(dim):
                    v[i] = h * (whole_step[i] + product[i])
            else:
                for i in range(dim):
                    mid[i] = d2[i] + d3[i]
                applied(table, 5 * dim, dim, mid, product)
                applied(table, 6 * dim, dim, d4, error_of)
                for i in range(dim):
                    v[i] = h * (whole_step[i] + product[i] + error_of[i])
            applied(table, 0, dim, v, product)
            if turns:
                turn(v, turning, cosine, sine)
            for i in range(dim):
                mid[i] = y[i] + v[i]
            moment = t + (0.5 if stage < 2 else 1.0) * h
            slope(form, moment, segment, mid, dim, signal, space, model, scratch, f_new)
            d = stages[stage]
            for i in range(dim):
                d[i] = f_new[i]
            if turns:
                turn(d, turning, cosine, -sine)
            for i in range(dim):
                d[i] -= f1[i] + stretch * product[i]
        for i in range(dim):
            v[i] = y[i] - y_past[i]
            change_of[i] = f[i] - f_past[i]
        if turns:
            turn(v, turning, cosine, -sine)
            turn(change_of, turning, cosine, -sine)
        applied(table, 0, dim, v, product)
        for i in range(dim):
            change = ERROR_SHARE * (d5[i] - d4[i]) + at_half * 0.5 * (d2[i] + d3[i])
            change += at_end * d5[i] + at_past * (change_of[i] - stretch * product[i])
            v[i] = h * change
        applied(table, 6 * dim, dim, v, error_of)
        applied(table, 0, dim, whole_step, product)
        # The shortest step of the ladder is as good as a point in time.
        share = h if h > 1.0001 * ladder[0] else 0.0
        for i in range(dim):
            defect = half[i] - 0.5 * whole_step[i] + 0.125 * stretch * h * product[i]
            v[i] = share * defect
        if turns:
            turn(error_of, turning, cosine, sine)
            turn(v, turning, cosine, sine)
        for i in range(dim):
            error_of[i] = abs(error_of[i]) + abs(v[i])
        counts[0] += 4
        error = error_norm(form, error_of, mid, dim, space, typical, tolerance)
        if not error <= 1.0:
            counts[2] += 1
            rejected = True
            if error > 1e15 or not error == error:
                step = 0.1 * h
                if step < 1e-9:
                    return 2, t, step, sample
                continue
            step = h * max(0.2, 0.9 * error**-0.25)
            continue
        counts[1] += 1
        whole = t + 1.0001 * h <= end
        reached = t + h + 1e-12 * (1.0 + abs(t))
        if sample < len(samples) and samples[sample] <= reached:
            cubic(y, mid, f, f_new, h, dim, curve)
            per_step = 1.0 / h
            while sample < len(samples) and samples[sample] <= reached:
                z = (samples[sample] - t) * per_step
                for i in range(dim):
                    path[sample, i] = y[i] + z * (curve[0, i] + z * (curve[1, i] + z * curve[2, i]))
                sample += 1
        logarithm = math.log(max(error, 1e-10))
        factor = growth(logarithm, before)
        before = max(logarithm, LEAST)
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(dim):
            y_past[i], f_past[i] = y[i], f[i]
            y[i], f[i] = mid[i], f_new[i]
        past = h
        t += h
        step = h * factor if whole else max(step, h * factor)
    return 0, t, step, sample
