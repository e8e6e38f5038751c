"""What goes through the compiled time loop, in named bundles."""

import math
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loop_types import Cube, Float, IntVector, Matrix, Vector
from vehiclemor.inputs.polynomial_loops import Pieces

# Places of a system's kernels in its list of addresses; see `System`.
DERIVATIVE, SECOND_ORDER, SPEEDS, STEP_KERNEL = range(4)
# Why a run has ended: all well, too many evaluations, not finite, singular matrix, tiny step.
FINISHED, TOO_MANY_CALLS, NOT_FINITE, SINGULAR, STEP_TOO_SMALL = range(5)
# Places of the counts of a run.
RHS_CALLS, STEPS, REJECTED_STEPS, JACOBIANS, FACTORISATIONS, LINEAR_SOLVES = range(6)
# Nodes of a step: the Chebyshev points of a cubic, as parts of the step.
NODES = 4
NODE_1, NODE_2 = 0.03806023374435663, 0.30865828381745514
NO_INPUTS = np.empty((0, 0))


class Equations(NamedTuple):
    """Compiled equations dx/dt = f(x, u).

    Attributes
    ----------
    kernels
        Addresses of the kernels, see `DERIVATIVE`; zero where there is none.
    constants
        Hoisted constants of the kernels.
    error_scale
        Magnitude of each state below which errors count absolutely.
    """

    kernels: IntVector
    constants: Vector
    error_scale: Vector


class Spans(NamedTuple):
    """Parts of a run without a break point of the inputs or an edge of a window inside.

    Edges (spans + 1,) are times in s; a span lies in one segment of the signal and one window.
    """

    edges: Vector
    segments: IntVector
    windows: IntVector


class Subspaces(NamedTuple):
    """One affine subspace for each window, see `ControlPeriods`."""

    means: Matrix
    trial: Cube
    test: Cube
    ranks: IntVector


class Method(NamedTuple):
    """What an integrator needs beside its code.

    Attributes
    ----------
    tableau
        Coefficients, in rows that the integrator describes.
    step_sizes
        In s, those for which operators of a frozen Jacobian are stored.
    operators
        Of a frozen Jacobian, for each of these step sizes.
    active
        Numbers of the states that the right-hand side depends on.
    """

    tableau: Matrix
    step_sizes: Vector
    operators: Cube
    active: IntVector


class Control(NamedTuple):
    """Limits of a run, and how step sizes follow the errors.

    Attributes
    ----------
    exponent, rejected_exponent, memory_exponent
        Of the error in the factor of the next step, after a rejected step, and of the error before.
    memory_start, memory_floor
        What counts as the error before the first step; the least that counts before any other.
    shrink_least, shrink, grow, safety
        Smallest factor after a rejected and after an accepted step, largest factor; share of the
        step size that the error asks for.
    keep_least, keep_most
        Factors between which the step size stays.
    halve_last
        Whether two equal steps are taken instead of a long and a tiny one (1) or not (0).
    tolerance
        Largest local error of a state relative to its scale plus its magnitude.
    shortest_first, longest, restart, first
        In s: shortest first guess of a step, longest step, longest first step after a break point
        of the inputs, first step to try (0 if it is to be guessed).
    most_calls
        Evaluations of the right-hand side within a second of the run after which it ends.
    """

    exponent: Float
    rejected_exponent: Float
    memory_exponent: Float = 0.0
    memory_start: Float = 1.0
    memory_floor: Float = 1e-4
    shrink_least: Float = 0.1
    shrink: Float = 0.2
    grow: Float = 6.0
    safety: Float = 0.9
    keep_least: Float = 1.0
    keep_most: Float = 1.0
    halve_last: Float = 1.0
    shortest_first: Float = 0.0
    tolerance: Float = 0.0
    longest: Float = math.inf
    restart: Float = 0.05
    most_calls: Float = 0.0
    first: Float = 0.0


class Output(NamedTuple):
    """Where a run is recorded: states at its samples, or at points from which these follow.

    The points of a step are its samples where they are few, and up to `record_all_until`; else its
    `NODES`, through which cubics give the samples, as dense output of order 3 does.

    Attributes
    ----------
    samples
        Output times in s.
    states
        A row for each point, in order.
    rows
        How many of these rows are recorded (1,).
    counts
        See `RHS_CALLS`.
    sample_inputs
        Inputs at the samples.
    point_inputs, point_times
        Inputs and times in s at the points; empty if these are the samples.
    point_of_sample
        Row of the sample's point, or of the first node of its step, and the part of the step that
        has passed, -1 where the point is the sample.  Both are -1 where a run has not come.  Empty
        if the points are the samples.
    record_all_until
        Time in s from which on nodes may stand for samples.
    """

    samples: Vector
    states: Matrix
    rows: IntVector
    counts: IntVector
    sample_inputs: Matrix
    point_inputs: Matrix
    point_times: Vector
    point_of_sample: Matrix
    record_all_until: Float

    @classmethod
    def of(
        cls,
        samples: np.ndarray,
        states: np.ndarray,
        counts: np.ndarray,
        inputs: np.ndarray = NO_INPUTS,
        record_all_until: float = math.inf,
    ) -> "Output":
        """Record a run at its samples, or from a time on at few points."""
        points = len(samples) if record_all_until < math.inf else 0
        return cls(
            samples,
            states,
            np.zeros(1, dtype=np.int64),
            counts,
            sample_inputs=inputs,
            point_inputs=np.empty((points, inputs.shape[1])),
            point_times=np.empty(points),
            point_of_sample=np.empty((points, 2)),
            record_all_until=record_all_until,
        )


class Memory(NamedTuple):
    """What a run works in.

    Attributes
    ----------
    start
        State where it begins (n,).
    buffer, integers
        Scratch space, see `catalogue.scratch_size`.
    """

    start: Vector
    buffer: Vector
    integers: IntVector


class Outputs(NamedTuple):
    """Some outputs of a model.

    Attributes
    ----------
    kernel
        Address of their kernel: for `LANES` samples at once, for a single one on shorter paths.
    constants
        Hoisted constants of the kernel.
    columns
        Of each output: column c of the states, or -1 - c for column c of the kernel's results.
    ranges
        Of the outputs that are watched (limited, 2).
    """

    kernel: IntVector
    constants: Vector
    columns: IntVector
    ranges: Matrix


class Problem(NamedTuple):
    """Equations on one span and one window, with scratch space.

    Attributes
    ----------
    segment, signal
        Number of the segment of the signal, the signal.
    equations
        The equations of the full system.
    mean, trial, test
        Mean (n,) of the window, trial and test basis (R, n) by rows.
    x, u, dx
        Scratch for a state (n,), inputs, rates (n,).
    second_order, small
        Scratch for mass matrix and forces (n / 2, n / 2 + 1), and for their projection.
    second
        When the present second of the run began, and how many calls there had been.
    """

    segment: int
    signal: Pieces
    equations: Equations
    mean: Vector
    trial: Matrix
    test: Matrix
    x: Vector
    u: Vector
    dx: Vector
    second_order: Matrix
    small: Matrix
    second: Vector
