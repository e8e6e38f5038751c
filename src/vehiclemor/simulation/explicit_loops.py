"""Explicit Runge-Kutta pair of order 5(4) with dense output, for compiled systems.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6
(1980); dense output and step size control after E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I (2nd ed., Springer 1993), sections II.4 to II.6.
"""

from vehiclemor.simulation.system_loops import error_norm, lifted, slope, slope_apart

A21 = 1 / 5
A31, A32 = 3 / 40, 9 / 40
A41, A42, A43 = 44 / 45, -56 / 15, 32 / 9
A51, A52, A53, A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A61, A62, A63, A64, A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
B1, B3, B4, B5, B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
E1, E3, E4, E5, E6, E7 = (
    71 / 57600,
    -71 / 16695,
    71 / 1920,
    -17253 / 339200,
    22 / 525,
    -1 / 40,
)
D1, D3, D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
D5, D6, D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423


def explicit_span(
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
    samples,
    sample,
    path,
    counts,
):
    """Integrate over one smooth span, recording the states at the sample times inside.

    Parameters
    ----------
    times
        Ends of the span in s.
    step
        First step size to try in s.
    limits
        Tolerance, longest step in s, most evaluations of the right-hand side.
    vectors
        Work space (16, dim), at least.
    samples, sample
        All sample times, and the number of the first that is not recorded yet.
    path
        States at the sample times.

    Returns
    -------
    tuple
        Status, time, step size for what follows, number of the next sample.
    """
    t, end = times
    tolerance, longest, most_calls = limits
    k1, mid, new = vectors[0], vectors[7], vectors[8]
    # Stages as rows of one array: so the compiler sees few arrays that might overlap.
    k = vectors
    state = scratch[0]
    slope_apart(form, t, segment, y, dim, signal, space, model, scratch, k1)
    counts[0] += 1
    if step <= 0.0:
        # The slope changes the state by a hundredth of its typical size, at most.
        size = error_norm(form, k1, y, dim, space, typical, 1.0)
        step = longest
        if not size <= 1e-10:
            step = 0.01 / size
    before = 1e-4
    rejected = False
    while t < end - 1e-12 * (1.0 + abs(end)):
        if counts[0] > most_calls:
            return 1, t, step, sample
        h = min(step, longest)
        if t + 1.0001 * h > end:
            h = end - t
        if not h > 1e-14 * (1.0 + abs(t)):
            return 4, t, step, sample
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
                    mid[i] = y[i] + h * (
                        A51 * k[0, i] + A52 * k[1, i] + A53 * k[2, i] + A54 * k[3, i]
                    )
            elif stage == 5:
                moment = t + h
                for i in range(dim):
                    mid[i] = y[i] + h * (
                        A61 * k[0, i]
                        + A62 * k[1, i]
                        + A63 * k[2, i]
                        + A64 * k[3, i]
                        + A65 * k[4, i]
                    )
            else:
                moment = t + h
                for i in range(dim):
                    mid[i] = y[i] + h * (
                        B1 * k[0, i] + B3 * k[2, i] + B4 * k[3, i] + B5 * k[4, i] + B6 * k[5, i]
                    )
            slope(form, moment, segment, mid, dim, signal, space, model, scratch, vectors[stage])
        for i in range(dim):
            new[i] = mid[i]
        counts[0] += 6
        for i in range(dim):
            mid[i] = h * (
                E1 * k[0, i]
                + E3 * k[2, i]
                + E4 * k[3, i]
                + E5 * k[4, i]
                + E6 * k[5, i]
                + E7 * k[6, i]
            )
        error = error_norm(form, mid, new, dim, space, typical, tolerance)
        if not error <= 1.0:
            counts[2] += 1
            rejected = True
            if error > 1e15 or not error == error:
                # Not finite: a much shorter step, until none is left.
                step = 0.1 * h
                if step < 1e-9:
                    return 2, t, step, sample
                continue
            step = h * max(0.2, 0.9 * error**-0.17)
            continue
        counts[1] += 1
        while sample < len(samples) and samples[sample] <= t + h + 1e-12 * (1.0 + abs(t)):
            z = (samples[sample] - t) / h
            for i in range(dim):
                difference = new[i] - y[i]
                bend = h * k[0, i] - difference
                back = difference - h * k[6, i] - bend
                last = h * (
                    D1 * k[0, i]
                    + D3 * k[2, i]
                    + D4 * k[3, i]
                    + D5 * k[4, i]
                    + D6 * k[5, i]
                    + D7 * k[6, i]
                )
                mid[i] = y[i] + z * (difference + (1 - z) * (bend + z * (back + (1 - z) * last)))
            lifted(form, mid, dim, space, model, scratch, state)
            for i in range(len(state)):
                path[sample, i] = state[i]
            sample += 1
        # Proportional and integral control: fewer rejections where stability limits the step.
        error = max(error, 1e-10)
        factor = 0.9 * error**-0.17 * before**0.04
        before = max(error, 1e-4)
        factor = min(10.0, max(0.2, factor))
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(dim):
            y[i] = new[i]
            k[0, i] = k[6, i]
        whole = t + 1.0001 * h <= end
        t += h
        # A step that was cut at the end of the span says nothing against longer ones.
        step = h * factor if whole else max(step, h * factor)
    return 0, t, step, sample
