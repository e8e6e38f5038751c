"""The one time loop: spans and windows, samples, limits, step sizes.

It calls functions of an integrator and of a formulation, see `contract`, and is compiled with them.
"""

import math

from vehiclemor.codegen.loop_types import Int, matrix, vector
from vehiclemor.inputs.polynomial_loops import Pieces, input_at
from vehiclemor.simulation.integrators.contract import (
    accept,
    begin,
    error_norm,
    interpolate,
    longest_step,
    prepare_curve,
    project,
    reconstruct,
    rhs,
    step,
    work_space,
)
from vehiclemor.simulation.loop_arguments import (
    FINISHED,
    NODE_1,
    NODE_2,
    NODES,
    NOT_FINITE,
    REJECTED_STEPS,
    RHS_CALLS,
    SINGULAR,
    STEP_TOO_SMALL,
    STEPS,
    TOO_MANY_CALLS,
    Control,
    Equations,
    Memory,
    Method,
    Output,
    Problem,
    Spans,
    Subspaces,
)


def integrate(
    equations: Equations,
    signal: Pieces,
    spans: Spans,
    subspaces: Subspaces,
    method: Method,
    control: Control,
    output: Output,
    memory: Memory,
) -> Int:
    """Integrate from the start over all spans; a new window projects the state onto its space.

    Gives why the run has ended; if early, when is the first number of the buffer.
    """
    start, buffer, integers = memory.start, memory.buffer, memory.integers
    n, inputs = len(start), signal.coefficients.shape[2]
    x = vector(buffer, 0, n)
    for i in range(n):
        x[i] = start[i]
    second = vector(buffer, scratch_end(n, inputs) - 2, 2)
    second[0], second[1] = spans.edges[0], 0.0
    samples, counts = output.samples, output.counts
    output.rows[0] = 0
    sample, window, segment, h = 0, -1, -1, control.first
    dim = subspaces.ranks[0]
    t = spans.edges[0]
    for span in range(len(spans.segments)):
        entered = spans.windows[span] != window
        window = spans.windows[span]
        dim = subspaces.ranks[window]
        problem = on_span(
            equations, signal, subspaces, spans.segments[span], window, (n, inputs), buffer
        )
        first = scratch_end(n, inputs)
        work = work_space(buffer, first, integers, dim, inputs, method)
        if entered:
            project(problem, t, x, work.y, counts)
            while sample < len(samples) and samples[sample] <= t + 1e-12 * (1.0 + abs(t)):
                reconstruct(problem, work.y, output.states[output.rows[0]])
                record_sample(output, sample)
                sample += 1
        if segment >= 0 and spans.segments[span] != segment:
            h = min(h, control.restart)
        segment = spans.segments[span]
        times = (t, spans.edges[span + 1])
        status, t, h, sample = over_span(problem, times, h, method, control, work, output, sample)
        reconstruct(problem, work.y, x)
        for i in range(n):
            if status == FINISHED and not math.isfinite(x[i]):
                status = NOT_FINITE
        if status != FINISHED:
            buffer[0] = t
            leave_out(output, sample)
            return status
    return FINISHED


def scratch_end(n, inputs):
    """First number of the buffer that `on_span` leaves to the integrator."""
    half = n // 2
    return 3 * n + inputs + 2 * half * (half + 1) + 2


def on_span(equations, signal, subspaces, segment, window, sizes, buffer):
    """The problem on one span; its scratch space follows the state (n,) in the buffer."""
    n, inputs = sizes
    half = n // 2
    first = 3 * n + inputs
    return Problem(
        segment=segment,
        signal=signal,
        equations=equations,
        mean=subspaces.means[window],
        trial=subspaces.trial[window],
        test=subspaces.test[window],
        x=vector(buffer, n, n),
        u=vector(buffer, 3 * n, inputs),
        dx=vector(buffer, 2 * n, n),
        second_order=matrix(buffer, first, half, half + 1),
        small=matrix(buffer, first + half * (half + 1), half, half + 1),
        second=vector(buffer, scratch_end(n, inputs) - 2, 2),
    )


def over_span(problem, times, h, method, control, work, output, sample):
    """Integrate from the first of two times to the second, recording the samples between.

    Takes the first step size to try in s, none if zero, and the number of the next sample; returns
    a status, the time, the step size for what follows and the number of the next sample.
    """
    t, end = times
    y, f, counts = work.y, work.f, output.counts
    rhs(problem, t, y, f)
    begin(method, work)
    counts[RHS_CALLS] += 1
    if h <= 0.0:
        # The slope changes the state by a hundredth of its scale, at most.
        size = error_norm(problem, f, y, 1.0)
        if not math.isfinite(size):
            return NOT_FINITE, t, h, sample
        # A slope of zero says nothing of the input, which a long first step could pass over.
        h = min(control.longest, 0.02 * (end - t))
        if not size <= 1e-10:
            h = max(control.shortest_first, 0.01 / size)
    tried = h
    before, rejected = control.memory_start, False
    while t < end - 1e-12 * (1.0 + abs(end)):
        if calls_of_this_second(problem, t, counts) > control.most_calls:
            return TOO_MANY_CALLS, t, tried, sample
        h = longest_step(min(tried, control.longest), method, work)
        if t + 1.0001 * h > end:
            h = end - t
        elif control.halve_last > 0.0 and t + 2.0 * h > end:
            # Two equal steps are better than a long and a tiny one.
            h = 0.5 * (end - t)
        if not h > 1e-14 * (1.0 + abs(t)):
            return STEP_TOO_SMALL, t, tried, sample
        if not step(problem, t, h, method, work, counts):
            return SINGULAR, t, tried, sample
        error = error_norm(problem, work.error, work.new, control.tolerance)
        if not error <= 1.0:
            counts[REJECTED_STEPS] += 1
            rejected = True
            if error > 1e15 or not error == error:
                # Not finite: a much shorter step, until none is left.
                tried = 0.1 * h
                if tried < 1e-9:
                    return NOT_FINITE, t, tried, sample
                continue
            factor = control.safety * error**-control.rejected_exponent
            tried = h * max(control.shrink_least, factor)
            continue
        counts[STEPS] += 1
        accept(problem, t, h, method, work, counts)
        sample = record_samples(problem, (t, h, end), method, work, output, sample)
        # Proportional and integral control: Hairer, Wanner, Solving ODEs II (1996), section IV.2.
        error = max(error, 1e-10)
        factor = control.safety * error**-control.exponent * before**control.memory_exponent
        before = max(error, control.memory_floor)
        factor = min(control.grow, max(control.shrink, factor))
        if rejected:
            factor = min(1.0, factor)
            rejected = False
        for i in range(len(y)):
            y[i] = work.new[i]
        for i in range(len(f)):
            f[i] = work.f_new[i]
        uncut = t + 1.0001 * h <= end
        t += h
        # A step that was cut at the end of the span says nothing against longer ones.
        tried = h * factor if uncut else max(tried, h * factor)
    return FINISHED, t, tried, sample


def calls_of_this_second(problem, t, counts):
    """Evaluations of the right-hand side since the present second of the run began."""
    second = problem.second
    if t >= second[0] + 1.0:
        second[0], second[1] = t, counts[RHS_CALLS]
    return counts[RHS_CALLS] - second[1]


def record_samples(problem, step, method, work, output, sample):
    """Samples within a step (time and length in s, end of its span); returns what comes next."""
    t, h, end = step
    samples, first = output.samples, sample
    reached = t + h + 1e-12 * (1.0 + abs(t))
    while sample < len(samples) and samples[sample] <= reached:
        sample += 1
    if sample == first:
        return sample
    prepare_curve(h, method, work)
    # From this one on samples are points themselves; those before it follow from nodes.
    alone = first
    if len(output.point_of_sample) and sample - first > NODES + 1 and t >= output.record_all_until:
        # At the end of a span inputs may jump.
        at_end = samples[sample - 1] >= end - 1e-9 * (1.0 + abs(end))
        alone = sample - 1 if at_end else sample
        record_nodes(problem, (t, h), first, alone, work, output)
    for k in range(alone, sample):
        interpolate((samples[k] - t) / h, h, work)
        reconstruct(problem, work.middle, output.states[output.rows[0]])
        record_sample(output, k)
    return sample


def record_sample(output, sample):
    """Count the row of a sample that is a point itself."""
    row = output.rows[0]
    output.rows[0] = row + 1
    if not len(output.point_of_sample):
        return
    output.point_of_sample[sample, 0], output.point_of_sample[sample, 1] = row, -1.0
    for j in range(output.sample_inputs.shape[1]):
        output.point_inputs[row, j] = output.sample_inputs[sample, j]


def record_nodes(problem, step, first, following, work, output):
    """Nodes of a step (time and length in s) for the samples from one to before another."""
    t, h = step
    row = output.rows[0]
    output.rows[0] = row + NODES
    for node in range(NODES):
        part = NODE_1 if node in (0, 3) else NODE_2
        part = part if node < 2 else 1.0 - part
        interpolate(part, h, work)
        reconstruct(problem, work.middle, output.states[row + node])
        input_at(problem, t + part * h, output.point_inputs[row + node])
    for k in range(first, following):
        output.point_of_sample[k, 0] = row
        output.point_of_sample[k, 1] = max((output.samples[k] - t) / h, 0.0)


def leave_out(output, sample):
    """What has not been reached: no row, or not a number."""
    for left in range(sample, len(output.samples)):
        if len(output.point_of_sample):
            output.point_of_sample[left, 0], output.point_of_sample[left, 1] = -1.0, -1.0
        else:
            for i in range(output.states.shape[1]):
                output.states[left, i] = math.nan
