"""Rosenbrock methods for compiled systems, with fresh Jacobians.

Transformed stages (no product with the Jacobian): E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (2nd ed., Springer 1996), section IV.7:

    (I / (gamma h) - A) U_i = f(t + alpha_i h, y + sum a_ij U_j) + sum c_ij / h U_j + d_i h f_t
"""

from vehiclemor.simulation.system_loops import FULL, error_norm, lifted, slope, slope_apart


def difference_jacobian(
    form, t, segment, y, f, dim, active, signal, space, model, scratch, shifted, image, jacobian
):
    """Columns of df/dy by forward differences into jacobian (dim, dim); inactive ones are zero."""
    for i in range(dim):
        for j in range(dim):
            jacobian[i, j] = 0.0
    for column in active:
        if column >= dim:
            continue
        for i in range(dim):
            shifted[i] = y[i]
        change = 1.5e-8 * max(abs(y[column]), 1.0)
        shifted[column] = y[column] + change
        change = shifted[column] - y[column]
        slope_apart(form, t, segment, shifted, dim, signal, space, model, scratch, image)
        for i in range(dim):
            jacobian[i, column] = (image[i] - f[i]) / change


def factorise(matrix, dim, rows):
    """LU factors with partial pivoting in place; False if the matrix is singular."""
    for k in range(dim):
        best, place = abs(matrix[k, k]), k
        for i in range(k + 1, dim):
            if abs(matrix[i, k]) > best:
                best, place = abs(matrix[i, k]), i
        if not 1e-300 < best < 1e300:
            return False
        rows[k] = place
        if place != k:
            for j in range(dim):
                matrix[k, j], matrix[place, j] = matrix[place, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, dim):
            factor = matrix[i, k] * inverse
            matrix[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, dim):
                    matrix[i, j] -= factor * matrix[k, j]
    return True


def substitute(matrix, dim, rows, b):
    """Solution of LU x = b in place of b."""
    for k in range(dim):
        place = rows[k]
        if place != k:
            b[k], b[place] = b[place], b[k]
    for k in range(dim):
        value = b[k]
        for i in range(k + 1, dim):
            b[i] -= matrix[i, k] * value
    for k in range(dim - 1, -1, -1):
        b[k] /= matrix[k, k]
        value = b[k]
        for i in range(k):
            b[i] -= matrix[i, k] * value


def rosenbrock_span(
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
    matrices,
    tableau,
    active,
    samples,
    sample,
    path,
    counts,
):
    """Integrate over one smooth span; see `explicit_span` for what it shares with it.

    Parameters
    ----------
    tableau
        a (s, s), c (s, s), alpha, d, m, e (s) with e the error weights, gamma, exponent of the step
        size control.
    active
        Numbers of the states that the right-hand side depends on.
    """
    t, end = times
    tolerance, longest, most_calls = limits
    a, c, alpha, d, m, e, gamma, exponent = tableau
    jacobian, matrix, stages, rows = matrices
    stage_count = len(m)
    f, mid, new, image, f_t, f_new, b = (
        vectors[0],
        vectors[1],
        vectors[2],
        vectors[3],
        vectors[4],
        vectors[5],
        vectors[6],
    )
    state = scratch[0]
    slope_apart(form, t, segment, y, dim, signal, space, model, scratch, f)
    counts[0] += 1
    if step <= 0.0:
        size = error_norm(form, f, y, dim, space, typical, 1.0)
        step = longest
        if not size <= 1e-10:
            step = 0.01 / size
    fresh = False
    rejected = False
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
        if not fresh:
            difference_jacobian(
                form,
                t,
                segment,
                y,
                f,
                dim,
                active,
                signal,
                space,
                model,
                scratch,
                mid,
                image,
                jacobian,
            )
            later = 1e-7 * (1.0 + abs(t))
            slope_apart(form, t + later, segment, y, dim, signal, space, model, scratch, f_t)
            for i in range(dim):
                f_t[i] = (f_t[i] - f[i]) / later
            counts[0] += min(len(active), dim) + 1
            counts[3] += 1
            fresh = True
        for i in range(dim):
            for j in range(dim):
                matrix[i, j] = -jacobian[i, j]
            matrix[i, i] += 1.0 / (gamma * h)
        counts[4] += 1
        if not factorise(matrix, dim, rows):
            return 3, t, step, sample
        for stage in range(stage_count):
            if stage == 0:
                for i in range(dim):
                    b[i] = f[i]
            else:
                for i in range(dim):
                    mid[i] = y[i]
                for j in range(stage):
                    weight = a[stage, j]
                    if weight != 0.0:
                        for i in range(dim):
                            mid[i] += weight * stages[j, i]
                moment = t + alpha[stage] * h
                slope(form, moment, segment, mid, dim, signal, space, model, scratch, b)
                counts[0] += 1
                for j in range(stage):
                    weight = c[stage, j] / h
                    if weight != 0.0:
                        for i in range(dim):
                            b[i] += weight * stages[j, i]
            if d[stage] != 0.0:
                for i in range(dim):
                    b[i] += d[stage] * h * f_t[i]
            counts[5] += 1
            substitute(matrix, dim, rows, b)
            for i in range(dim):
                stages[stage, i] = b[i]
        for i in range(dim):
            total, change = 0.0, 0.0
            for stage in range(stage_count):
                total += m[stage] * stages[stage, i]
                change += e[stage] * stages[stage, i]
            new[i] = y[i] + total
            mid[i] = change
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
        # Cubic Hermite interpolation between the ends of the step.
        while sample < len(samples) and samples[sample] <= t + h + 1e-12 * (1.0 + abs(t)):
            z = (samples[sample] - t) / h
            after = z * z * (3.0 - 2.0 * z)
            before = 1.0 - after
            left, right = h * z * (1.0 - z) * (1.0 - z), h * z * z * (z - 1.0)
            if form == FULL:
                for i in range(dim):
                    path[sample, i] = (
                        before * y[i] + after * new[i] + left * f[i] + right * f_new[i]
                    )
            else:
                for i in range(dim):
                    mid[i] = before * y[i] + after * new[i] + left * f[i] + right * f_new[i]
                lifted(form, mid, dim, space, model, scratch, state)
                for i in range(len(state)):
                    path[sample, i] = state[i]
            sample += 1
        factor = min(6.0, max(0.2, 0.9 * max(error, 1e-10) ** -exponent))
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(dim):
            y[i] = new[i]
            f[i] = f_new[i]
        t += h
        fresh = False
        step = h * factor if whole else max(step, h * factor)
    return 0, t, step, sample
