"""The exponential method for small systems: a whole step is one compiled kernel, without loops.

As `exponential_loops`, for a frozen Jacobian of small diagonal blocks, whose functions cost nothing
to apply.  The kernel, fourth of the model's list, does all that a step does to vectors.  Its first
argument is (y, f, both a step before, typical sizes, h, weights of the estimate of the error,
entries of the tables), the second the inputs at half of the step and at its end.  Its result is (y
and f at the end, the coefficients of the cubic between, the largest error by typical size).
"""

import math

from vehiclemor.codegen.stubs import call_machine
from vehiclemor.simulation.exponential_loops import (
    LEAST,
    growth,
    nearest_rung,
    quadrature_weights,
    rung_below,
)
from vehiclemor.simulation.system_loops import error_norm, input_at, slope_apart


def modal_span(
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
    buffers,
    ladder,
    tables,
    samples,
    sample,
    path,
    counts,
):
    """Integrate the system over one smooth span; see `rosenbrock_span`.

    Parameters
    ----------
    buffers
        Arguments and result of the kernel: (5 dim + 4 + 7 entries), (2 inputs), (5 dim + 1).
    ladder, tables
        Step sizes (L) in s and entries of the diagonal blocks (L, 1, 7 entries).
    """
    t, end = times
    tolerance, longest, most_calls = limits
    given, values, result = buffers
    f, u = vectors[0], scratch[1]
    inputs = len(u)
    entries = tables.shape[2] // 7
    first = 5 * dim
    slope_apart(form, t, segment, y, dim, signal, space, model, scratch, f)
    counts[0] += 1
    if step <= 0.0:
        size = error_norm(form, f, y, dim, space, typical, 1.0)
        step = longest
        if not size <= 1e-10:
            # Linear motion has no error, so no step need be shorter than the ladder's.
            step = max(ladder[0], 0.01 / size)
    for i in range(dim):
        given[i], given[dim + i] = y[i], f[i]
        given[2 * dim + i], given[3 * dim + i] = y[i], f[i]
        given[4 * dim + i] = typical[i]
    per_tolerance = 1.0 / tolerance
    rejected = False
    before, past = 0.0, 0.0
    rung, loaded, stretched = len(ladder) // 2, -1, 1.0
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
        stretch = ladder[rung] / h
        if rung != loaded or stretch != stretched:
            for i in range(7 * entries):
                given[first + 4 + i] = tables[rung, 0, i]
            for i in range(entries):
                given[first + 4 + i] *= stretch
            loaded, stretched = rung, stretch
        given[first] = h
        given[first + 1], given[first + 2], given[first + 3] = quadrature_weights(past, h)
        for stage in range(2):
            input_at(t + 0.5 * (stage + 1) * h, segment, signal, u)
            for i in range(inputs):
                values[stage * inputs + i] = u[i]
        call_machine(model, 3, given, values, result)
        counts[0] += 4
        error = per_tolerance * result[first]
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
        per_step = 1.0 / h
        while sample < len(samples) and samples[sample] <= reached:
            z = (samples[sample] - t) * per_step
            for i in range(dim):
                higher = result[3 * dim + i] + z * result[4 * dim + i]
                path[sample, i] = given[i] + z * (result[2 * dim + i] + z * higher)
            sample += 1
        logarithm = math.log(max(error, 1e-10))
        factor = growth(logarithm, before)
        before = max(logarithm, LEAST)
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(2 * dim):
            given[2 * dim + i] = given[i]
            given[i] = result[i]
        past = h
        t += h
        step = h * factor if whole else max(step, h * factor)
    for i in range(dim):
        y[i] = given[i]
    return 0, t, step, sample
