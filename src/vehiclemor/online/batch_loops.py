"""Many runs of one time loop and what is delivered of them, compiled: no Python between them."""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import (
    Cube,
    Int,
    IntMatrix,
    IntVector,
    Matrix,
    Vector,
    call_loop,
    matrix,
)
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.integrators.structures import FINISHED, NODES, Observer
from vehiclemor.simulation.path_loops import (
    cubics_within,
    note_outside,
    observed,
    point_of,
    read_point,
)


class Stage(NamedTuple):
    """A compiled loop that every run calls, its arguments packed once.

    Attributes
    ----------
    entry
        Its address; empty if there is no such stage.
    words
        Arguments, see `loops.Prepared`.
    changing, by_run
        Places of the words that change, and what stands there in each run (runs, changing).
    rows
        Places of the words that are the number of rows of a run.
    """

    entry: IntVector
    words: IntVector
    changing: IntVector
    by_run: IntMatrix
    rows: IntVector


class Recorded(NamedTuple):
    """Where the time loop leaves a run, see `structures.Output`; the first of `buffer` is when."""

    counts: IntVector
    path: Matrix
    moments: Vector
    places: Matrix
    buffer: Vector


class Lifted(NamedTuple):
    """Full states of a run (rows, states and what is watched), and what tells how far it goes.

    Attributes
    ----------
    inputs
        At the points; none where these are the samples.
    largest, first
        Of each watched quantity the largest size, and the first row above 1.
    """

    states: Matrix
    inputs: Matrix
    largest: Vector
    first: IntVector


class Wanted(NamedTuple):
    """What is delivered.

    Attributes
    ----------
    samples
        Numbers of the samples, increasing.
    columns
        Numbers of the quantities: states, and behind them outputs.
    observer
        Of all outputs.
    width
        Of rows of states and outputs side by side, padded.
    scratch
        As long as such rows at all points and at one sample.
    """

    samples: IntVector
    columns: IntVector
    observer: Observer
    width: Int
    scratch: Vector


class Told(NamedTuple):
    """What is told of each run.

    Attributes
    ----------
    ends
        Why its loop has ended, rows, first sample outside of a limit of the model (runs, 3).
    moments
        When its loop has ended early, and when it has left what its model knows, s (runs, 2).
    counts
        Counts (runs, 6), see `structures.Output`.
    largest, first
        See `Lifted` (runs, watched).
    outside
        First sample (runs, limits) at which each limited output is outside.
    value
        Of the first of these then (runs,).
    result
        Quantities (runs, samples, columns); not a number from the failure of a run on.
    """

    ends: IntMatrix
    moments: Matrix
    counts: IntMatrix
    largest: Matrix
    first: IntMatrix
    outside: IntMatrix
    value: Vector
    result: Cube


def many_runs(
    integration: Stage,
    decay: Stage,
    lifting: Stage,
    recorded: Recorded,
    lifted: Lifted,
    given: Cube,
    starts: Matrix,
    wanted: Wanted,
    limits: Int,
    told: Told,
) -> Int:
    """Integrate, lift and deliver one run after the other.

    Parameters
    ----------
    given
        Inputs (runs, samples, inputs) at the samples.
    starts
        Full states (runs, n), which are known better than what is lifted from reduced ones; empty
        where nothing is lifted.
    limits
        How many of the limits a run must keep; it is only remarked that the others are left.
    """
    for run in range(len(given)):
        for k in range(len(recorded.counts)):
            recorded.counts[k] = 0
        status = called(integration, run, 0)
        rows = rows_of(recorded, given.shape[1], status)
        called(decay, run, rows)
        called(lifting, run, rows)
        if len(starts) and (not len(recorded.places) or recorded.places[0, 1] < 0.0):
            for i in range(starts.shape[1]):
                lifted.states[0, i] = starts[run, i]
        for k in range(len(recorded.counts)):
            told.counts[run, k] = recorded.counts[k]
        told.ends[run, 0], told.ends[run, 1] = status, rows
        told.moments[run, 0] = recorded.buffer[0]
        told.moments[run, 1] = math.inf
        left = rows
        for k in range(len(lifted.first)):
            told.largest[run, k], told.first[run, k] = lifted.largest[k], lifted.first[k]
            left = min(left, lifted.first[k])
        if left < rows:
            told.moments[run, 1] = recorded.moments[left]
        inputs = lifted.inputs if len(lifted.inputs) else given[run]
        deliver(recorded.places, lifted.states[:rows], inputs, wanted, status, limits, told, run)
    return 0


def called(stage, run, rows):
    """Call a stage for a run with so many rows; its status."""
    if not len(stage.entry):
        return 0
    for k in range(len(stage.changing)):
        stage.words[stage.changing[k]] = stage.by_run[run, k]
    for k in range(len(stage.rows)):
        stage.words[stage.rows[k]] = rows
    return call_loop(stage.entry[0], stage.words)


def rows_of(recorded, samples, status):
    """How many rows of a run tell something, as `run_plans.Run` counts them."""
    places = recorded.places
    if not len(places):
        return samples
    last = samples - 1
    if status != FINISHED:
        last = 0
        for sample in range(samples):
            last = sample if places[sample, 0] > places[last, 0] else last
    row = int(places[last, 0]) + (1 if places[last, 1] < 0.0 else NODES)
    return max(row, LANES)


def deliver(places, states, inputs, wanted, status, limits, told, run):
    """Read the chosen quantities at the chosen samples, and watch all samples; see `delivered`."""
    observer, columns, result = wanted.observer, wanted.columns, told.result
    n, width = observer.states, wanted.width
    samples = len(places) if len(places) else len(states)
    points = matrix(wanted.scratch, 0, len(states), width)
    observed(states, inputs, observer, wanted.scratch, points)
    row_at = matrix(wanted.scratch, len(states) * width, 1, width)[0]
    first = told.outside[run]
    for k in range(len(first)):
        first[k] = samples
    known, within, reached, place, end = -1, False, True, 0, samples
    told.value[run] = 0.0
    for sample in range(samples):
        row, z = point_of(places, sample)
        if z < 0.0:
            within = False
        elif row != known:
            within = cubics_within(points, row, observer)
        known = row
        chosen = place < len(wanted.samples) and wanted.samples[place] == sample
        if within and not chosen:
            continue
        read_point(points, row, z, row_at)
        if status != FINISHED:
            for i in range(n):
                reached = reached and math.isfinite(row_at[i])
        # From the failure on there are no numbers, which says nothing of limits.
        if not within and reached:
            note_outside(row_at, observer, sample, samples, first)
            for k in range(limits):
                if first[k] == sample and end == samples and status == FINISHED:
                    end = sample
                    told.value[run] = row_at[n + observer.limited[k]]
        if chosen:
            for j in range(len(columns)):
                # What follows means nothing.
                result[run, place, j] = row_at[columns[j]] if sample < end else math.nan
            place += 1
    told.ends[run, 2] = end
