"""The W-method ROS34PW2 with one frozen Jacobian: stored inverses on a ladder of step sizes.

J. Rang, L. Angermann, BIT Numer. Math. 45 (2005), 761-787: order 3 with any matrix for the
Jacobian.  Transformed stages as in `rosenbrock_loops`; the four stages are written out, since with
a dozen states the loops around them would cost more than they do.
"""

import math

from vehiclemor.simulation.system_loops import error_norm, slope, slope_apart

INLINED = ("cubic",)


def cubic(y, new, f, f_new, h, dim, coefficients):
    """Cubic in the part of a step that has passed, by values and slopes at its ends."""
    for i in range(dim):
        rise, before, after = new[i] - y[i], h * f[i], h * f_new[i]
        coefficients[0, i] = before
        coefficients[1, i] = 3.0 * rise - 2.0 * before - after
        coefficients[2, i] = before + after - 2.0 * rise


def frozen_solve(inverse, dim, active, b, result):
    """Product of a stored inverse with b: its active columns, the others are the identity's."""
    for i in range(dim):
        result[i] = b[i]
    for j in active:
        result[j] = 0.0
    # Four rows at a time: the result is loaded and stored a quarter as often.
    place = 0
    while place + 3 < len(active):
        w0, w1 = b[active[place]], b[active[place + 1]]
        w2, w3 = b[active[place + 2]], b[active[place + 3]]
        for i in range(dim):
            result[i] += (inverse[place, i] * w0 + inverse[place + 1, i] * w1) + (
                inverse[place + 2, i] * w2 + inverse[place + 3, i] * w3
            )
        place += 4
    while place < len(active):
        w0 = b[active[place]]
        for i in range(dim):
            result[i] += inverse[place, i] * w0
        place += 1


def turn(vector, turning, cosine, sine):
    """Rotate the pairs of states that turn with the heading, in place."""
    for k in range(1, len(turning), 2):
        a, b = vector[turning[k]], vector[turning[k + 1]]
        vector[turning[k]] = cosine * a - sine * b
        vector[turning[k + 1]] = sine * a + cosine * b


def w_method_span(
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
    tableau,
    active,
    turning,
    ladder,
    inverses,
    samples,
    sample,
    path,
    counts,
):
    """Integrate the full system over one smooth span; see `rosenbrock_span`.

    Parameters
    ----------
    turning
        Numbers of the heading and of pairs of states that turn with it: the stored inverses belong
        to heading zero.  May be empty.
    ladder, inverses
        Step sizes (L) in s and transposed active columns of (I - gamma h J)^-1 (L, active, dim).
    """
    t, end = times
    tolerance, longest, most_calls = limits
    a, c, alpha, _, m, e, gamma, exponent = tableau
    a10, a20, a21 = a[1, 0], a[2, 0], a[2, 1]
    a30, a31, a32 = a[3, 0], a[3, 1], a[3, 2]
    m0, m1, m2, m3 = m[0], m[1], m[2], m[3]
    e0, e1, e2, e3 = e[0], e[1], e[2], e[3]
    f, mid, new, b, f_new = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    s0, s1, s2, s3 = stages[0], stages[1], stages[2], stages[3]
    curve = stages[4:7]
    turns = len(turning) > 0
    slope_apart(form, t, segment, y, dim, signal, space, model, scratch, f)
    counts[0] += 1
    if step <= 0.0:
        size = error_norm(form, f, y, dim, space, typical, 1.0)
        step = longest
        if not size <= 1e-10:
            step = 0.01 / size
    rejected = False
    rung = len(ladder) // 2
    while t < end - 1e-12 * (1.0 + abs(end)):
        if counts[0] > most_calls:
            return 1, t, step, sample
        h = min(step, longest)
        if t + 1.0001 * h > end:
            h = end - t
        elif t + 2.0 * h > end:
            # Two equal steps are better than a long and a tiny one.
            h = 0.5 * (end - t)
        if not h > 1e-14 * (1.0 + abs(t)):
            return 4, t, step, sample
        # The smallest that is not below the step, sought from the one before.
        while rung > 0 and ladder[rung - 1] >= 0.999 * h:
            rung -= 1
        while rung < len(ladder) - 1 and ladder[rung] < 0.999 * h:
            rung += 1
        inverse = inverses[rung]
        cosine, sine = 1.0, 0.0
        if turns:
            cosine, sine = math.cos(y[turning[0]]), math.sin(y[turning[0]])
        scale = gamma * h
        for stage in range(4):
            if stage == 0:
                for i in range(dim):
                    b[i] = scale * f[i]
            else:
                if stage == 1:
                    for i in range(dim):
                        mid[i] = y[i] + a10 * s0[i]
                elif stage == 2:
                    for i in range(dim):
                        mid[i] = y[i] + a20 * s0[i] + a21 * s1[i]
                else:
                    for i in range(dim):
                        mid[i] = y[i] + a30 * s0[i] + a31 * s1[i] + a32 * s2[i]
                moment = t + alpha[stage] * h
                slope(form, moment, segment, mid, dim, signal, space, model, scratch, b)
                g0, g1, g2 = gamma * c[stage, 0], gamma * c[stage, 1], gamma * c[stage, 2]
                if stage == 1:
                    for i in range(dim):
                        b[i] = scale * b[i] + g0 * s0[i]
                elif stage == 2:
                    for i in range(dim):
                        b[i] = scale * b[i] + g0 * s0[i] + g1 * s1[i]
                else:
                    for i in range(dim):
                        b[i] = scale * b[i] + g0 * s0[i] + g1 * s1[i] + g2 * s2[i]
            result = stages[stage]
            if turns:
                turn(b, turning, cosine, -sine)
            frozen_solve(inverse, dim, active, b, result)
            if turns:
                turn(result, turning, cosine, sine)
        counts[0] += 3
        counts[5] += 4
        for i in range(dim):
            new[i] = y[i] + m0 * s0[i] + m1 * s1[i] + m2 * s2[i] + m3 * s3[i]
            mid[i] = e0 * s0[i] + e1 * s1[i] + e2 * s2[i] + e3 * s3[i]
        error = error_norm(form, mid, new, dim, space, typical, tolerance)
        if not error <= 1.0:
            counts[2] += 1
            rejected = True
            if error > 1e15 or not error == error:
                step = 0.1 * h
                if step < 1e-9:
                    return 2, t, step, sample
                continue
            step = h * max(0.1, 0.9 * error**-exponent)
            continue
        counts[1] += 1
        whole = t + 1.0001 * h <= end
        slope_apart(form, t + h, segment, new, dim, signal, space, model, scratch, f_new)
        counts[0] += 1
        reached = t + h + 1e-12 * (1.0 + abs(t))
        if sample < len(samples) and samples[sample] <= reached:
            cubic(y, new, f, f_new, h, dim, curve)
            per_step = 1.0 / h
            while sample < len(samples) and samples[sample] <= reached:
                z = (samples[sample] - t) * per_step
                for i in range(dim):
                    path[sample, i] = y[i] + z * (curve[0, i] + z * (curve[1, i] + z * curve[2, i]))
                sample += 1
        factor = min(6.0, max(0.2, 0.9 * max(error, 1e-10) ** -exponent))
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(dim):
            y[i] = new[i]
            f[i] = f_new[i]
        t += h
        step = h * factor if whole else max(step, h * factor)
    return 0, t, step, sample
