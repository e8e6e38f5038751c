"""One run over all spans and windows: compiled, so that no Python stands in a time loop."""

import math

import numpy as np

from vehiclemor.simulation.explicit_loops import explicit_span
from vehiclemor.simulation.exponential_loops import exponential_span
from vehiclemor.simulation.modal_loops import modal_span
from vehiclemor.simulation.rosenbrock_loops import rosenbrock_span
from vehiclemor.simulation.stepped_loops import stepped_span
from vehiclemor.simulation.system_loops import (
    COORDINATES,
    derivative,
    input_at,
    lifted,
    outputs,
    projected,
    scratch_space,
    slope,
)
from vehiclemor.simulation.w_method_loops import w_method_span


def run(
    form,
    explicit,
    start,
    span_edges,
    span_segments,
    span_windows,
    means,
    lifts,
    drops,
    ranks,
    signal,
    model,
    typical,
    limits,
    restart,
    tableau,
    frozen,
    active,
    turning,
    ladder,
    stored,
    samples,
    path,
    counts,
):
    """Integrate from the start over all spans; a new window projects the state onto its space.

    Parameters
    ----------
    span_edges, span_segments, span_windows
        Edges (spans + 1,) in s, and for each span its segment of the signal and its window.
    means, lifts, drops, ranks
        Windows' means (W, 2 n), bases (W, R, 2 n) by rows, projections (W, R, 2 n), dimensions (W).
    frozen
        0: fresh Jacobians.  W-method with stored inverses 1, its steps as a kernel 2; exponential
        method with stored matrix functions 3, its steps as a kernel 4.
    stored
        Of the W-method or of the exponential method, see there.
    restart
        Longest first step (s) of a span that begins at a break point of the inputs.

    Returns
    -------
    tuple
        Status (0 if all went well) and the time that was reached.
    """
    states = len(start)
    x = np.empty(states)
    scratch = scratch_space(states, signal[2].shape[1])
    largest = 0
    for w in range(len(ranks)):
        if ranks[w] > largest:
            largest = ranks[w]
    vectors = np.empty((12, largest))
    square = 1 if explicit or frozen else largest
    matrices = (
        np.empty((square, square)),
        np.empty((square, square)),
        np.empty((8, largest)),
        np.empty(largest, dtype=np.int64),
    )
    entries = 0
    if frozen == 2:
        entries = stored.shape[1] * (largest + 3)
    elif frozen == 4:
        entries = stored.shape[2]
    buffers = (
        np.zeros(5 * largest + 4 + entries),
        np.empty(3 * signal[2].shape[1]),
        np.empty(5 * largest + 1),
    )
    y = np.empty(largest)
    for i in range(states):
        x[i] = start[i]
    sample, window, step, segment = 0, -1, 0.0, -1
    space, dim = (means[0], lifts[0], drops[0]), ranks[0]
    t = span_edges[0]
    for span in range(len(span_segments)):
        if span_windows[span] != window:
            window = span_windows[span]
            space = (means[window], lifts[window], drops[window])
            dim = ranks[window]
            if form == COORDINATES:
                input_at(t, span_segments[span], signal, scratch[1])
                counts[0] += 1
            projected(form, x, dim, space, model, scratch, y)
            if sample == 0:
                while sample < len(samples) and samples[sample] <= t:
                    lifted(form, y, dim, space, model, scratch, scratch[0])
                    for i in range(states):
                        path[sample, i] = scratch[0][i]
                    sample += 1
        if segment >= 0 and span_segments[span] != segment:
            step = min(step, restart)
        segment = span_segments[span]
        times = (span_edges[span], span_edges[span + 1])
        if explicit:
            status, t, step, sample = explicit_span(
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
            )
        elif frozen == 2:
            status, t, step, sample = stepped_span(
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
                stored,
                samples,
                sample,
                path,
                counts,
            )
        elif frozen == 3:
            status, t, step, sample = exponential_span(
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
                matrices[2],
                turning,
                ladder,
                stored,
                samples,
                sample,
                path,
                counts,
            )
        elif frozen == 4:
            status, t, step, sample = modal_span(
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
                stored,
                samples,
                sample,
                path,
                counts,
            )
        elif frozen == 1:
            status, t, step, sample = w_method_span(
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
                matrices[2],
                tableau,
                active,
                turning,
                ladder,
                stored,
                samples,
                sample,
                path,
                counts,
            )
        else:
            status, t, step, sample = rosenbrock_span(
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
            )
        if status != 0:
            return status, t
        lifted(form, y, dim, space, model, scratch, x)
        for i in range(states):
            if not math.isfinite(x[i]):
                return 2, t
    return 0, t


def output_path(path, inputs, model, result):
    """Outputs at every sample of a path of states into result (samples, outputs)."""
    for sample in range(len(path)):
        outputs(path[sample], inputs[sample], model, result[sample])


def derivative_path(path, inputs, model, result):
    """State derivatives at every sample of a path into result (samples, 2 n)."""
    for sample in range(len(path)):
        derivative(path[sample], inputs[sample], model, result[sample])


def jacobian_at(x, u, model, active, result):
    """Columns of df/dx (2 n, 2 n) by central differences; inactive ones are zero."""
    size = len(x)
    vectors = np.empty((3, size))
    shifted, above, below = vectors[0], vectors[1], vectors[2]
    for i in range(size):
        for j in range(size):
            result[i, j] = 0.0
    for column in active:
        change = 6e-6 * max(abs(x[column]), 1.0)
        for i in range(size):
            shifted[i] = x[i]
        shifted[column] = x[column] + change
        derivative(shifted, u, model, above)
        shifted[column] = x[column] - change
        derivative(shifted, u, model, below)
        for i in range(size):
            result[i, column] = (above[i] - below[i]) / (2.0 * change)


def reduced_slope(form, t, segment, y, dim, signal, mean, lift, drop, model, dy):
    """Right-hand side of one window's reduced system at reduced coordinates y (dim)."""
    scratch = scratch_space(len(mean), signal[2].shape[1])
    slope(form, t, segment, y, dim, signal, (mean, lift, drop), model, scratch, dy)
