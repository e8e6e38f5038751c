"""The W-method for small systems: a whole step is one compiled kernel, without loops.

With eight states the loops of `w_method_loops` take longer than the right-hand side.  The kernel,
third of the model's list, does what a step does there: its first argument is (y, f, h, rows of the
stored inverse), the second the inputs at the times of the second, third and fourth stage (the last
is the end of the step), its result (y at the end, error, f at the end).
"""

from vehiclemor.codegen.stubs import call_machine
from vehiclemor.simulation.system_loops import error_norm, input_at, slope_apart
from vehiclemor.simulation.w_method_loops import cubic

INLINED = ("load_inverse",)


def load_inverse(inverse, dim, width, place, buffer):
    """Copy rows (active, dim) of an inverse to a place in the buffer, padded to the width."""
    for j in range(len(inverse)):
        for i in range(dim):
            buffer[place + j * width + i] = inverse[j, i]


def stepped_span(
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
    tableau,
    ladder,
    inverses,
    samples,
    sample,
    path,
    counts,
):
    """Integrate the system over one smooth span; see `rosenbrock_span`.

    Parameters
    ----------
    buffers
        Arguments and result of the kernel: (2 dim + 1 + rows), (3 inputs), (3 dim).
    """
    t, end = times
    tolerance, longest, most_calls = limits
    alpha, exponent = tableau[2], tableau[7]
    given, values, result = buffers
    f, new, error_of, f_new = vectors[0], vectors[1], vectors[2], vectors[3]
    curve = vectors[4:7]
    u = scratch[1]
    inputs = len(u)
    width = (dim + 3) // 4 * 4
    loaded = -1
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
        if rung != loaded:
            load_inverse(inverses[rung], dim, width, 2 * dim + 1, given)
            loaded = rung
        for i in range(dim):
            given[i] = y[i]
            given[dim + i] = f[i]
        given[2 * dim] = h
        for stage in range(3):
            input_at(t + alpha[stage + 1] * h, segment, signal, u)
            for i in range(inputs):
                values[stage * inputs + i] = u[i]
        call_machine(model, 2, given, values, result)
        counts[0] += 4
        counts[5] += 4
        for i in range(dim):
            new[i] = result[i]
            error_of[i] = result[dim + i]
        error = error_norm(form, error_of, new, dim, space, typical, tolerance)
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
        for i in range(dim):
            f_new[i] = result[2 * dim + i]
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
