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


class Stages(NamedTuple):
    """Time loop, what decays of the start, lifting; a full model has but the first."""

    integration: Stage
    decay: Stage
    lifting: Stage


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
    """What is delivered of a run, and what is watched.

    Attributes
    ----------
    samples
        Numbers of the samples that are kept, increasing.
    columns
        Numbers of the quantities: states, and behind them outputs.
    observer
        Of all outputs.
    limits
        How many of its limits a run must keep; it is only remarked that the others are left.
    watch
        Address of a kernel of the limited outputs alone; empty if all outputs are made at all
        points, since all samples are kept.
    width, points, chosen
        Rows of states and outputs side by side, padded to this width: at all points and one more,
        and at those that are kept.
    states, inputs
        States and inputs at the points that are kept; empty where no outputs are made of them.
    """

    samples: IntVector
    columns: IntVector
    observer: Observer
    limits: Int
    watch: IntVector
    width: Int
    points: Vector
    chosen: Vector
    states: Matrix
    inputs: Matrix


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
    stages: Stages,
    recorded: Recorded,
    lifted: Lifted,
    given: Cube,
    starts: Matrix,
    wanted: Wanted,
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
    """
    for run in range(len(given)):
        for k in range(len(recorded.counts)):
            recorded.counts[k] = 0
        status = called(stages.integration, run, 0)
        rows = rows_of(recorded, given.shape[1], status)
        called(stages.decay, run, rows)
        called(stages.lifting, run, rows)
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
        states = lifted.states[:rows]
        end = watched(recorded.places, states, inputs, wanted, status, told, run)
        told.ends[run, 2] = end
        kept(recorded.places, states, inputs, wanted, end, told.result[run])
    return 0


def for_each_run(stage: Stage) -> Int:
    """Call a stage for each run."""
    for run in range(len(stage.by_run)):
        called(stage, run, 0)
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


def watched(places, states, inputs, wanted, status, told, run):
    """First sample of a run outside of a limit that it must keep; see `path_loops.delivered`."""
    observer, first, width = wanted.observer, told.outside[run], wanted.width
    points = matrix(wanted.points, 0, len(states) + 1, width)
    n, samples = observer.states, len(places) if len(places) else len(states)
    kernel = wanted.watch if len(wanted.watch) else observer.kernel
    observed(states, inputs, observer, kernel, wanted.points, points)
    between = points[len(states)]
    for k in range(len(first)):
        first[k] = samples
    known, within, end = -1, False, samples
    told.value[run] = 0.0
    for sample in range(samples):
        row, z = point_of(places, sample)
        if row < 0:
            break
        if z < 0.0:
            within = False
        elif row != known:
            within = cubics_within(points, row, observer)
        known = row
        if within:
            continue
        at = points[row]
        if z >= 0.0:
            read_point(points, row, z, between)
            at = between
        if status != FINISHED:
            reached = True
            for i in range(n):
                reached = reached and math.isfinite(at[i])
            # From the failure on there are no numbers, which says nothing of limits.
            if not reached:
                break
        note_outside(at, observer, sample, samples, first)
        for k in range(wanted.limits):
            if first[k] == sample and end == samples and status == FINISHED:
                end = sample
                told.value[run] = at[n + observer.limited[k]]
    return end


def kept(places, states, inputs, wanted, end, result):
    """Read the chosen quantities (samples, columns); none from sample `end` on."""
    points = matrix(wanted.points, 0, len(states) + 1, wanted.width)
    between, columns = points[len(states)], wanted.columns
    rows, known, own = 0, -1, len(wanted.states) > 0
    if own:
        for place in range(len(wanted.samples)):
            row, z = point_of(places, wanted.samples[place])
            if row >= 0 and row != known:
                for node in range(1 if z < 0.0 else NODES):
                    copied(states, inputs, row + node, wanted, rows)
                    rows += 1
            known = row
        while 0 < rows < LANES <= len(states):
            # Kernels take so many at once.
            copied(states, inputs, known if known >= 0 else 0, wanted, rows)
            rows += 1
        observer, chosen = wanted.observer, wanted.chosen
        points = matrix(chosen, 0, rows, wanted.width)
        states, inputs = wanted.states[:rows], wanted.inputs[:rows]
        observed(states, inputs, observer, observer.kernel, chosen, points)
    rows, known, first = 0, -1, 0
    for place in range(len(wanted.samples)):
        row, z = point_of(places, wanted.samples[place])
        if own and row >= 0 and row != known:
            first = rows
            rows += 1 if z < 0.0 else NODES
        known = row
        if row >= 0 and own:
            row = first
        read_point(points, row, z, between)
        for j in range(len(columns)):
            # What follows means nothing.
            after = wanted.samples[place] >= end
            result[place, j] = math.nan if after else between[columns[j]]


def copied(states, inputs, row, wanted, to):
    """Copy states and inputs of a point to those of the points that are kept."""
    for i in range(wanted.states.shape[1]):
        wanted.states[to, i] = states[row, i]
    for j in range(inputs.shape[1]):
        wanted.inputs[to, j] = inputs[row, j]
