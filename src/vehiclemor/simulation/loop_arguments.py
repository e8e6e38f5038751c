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
    """Compiled equations dx/dt = f(x, u)."""

    kernels: IntVector  # Addresses of the kernels, see `DERIVATIVE`; zero where there is none.
    constants: Vector  # Hoisted constants of the kernels.
    error_scale: Vector  # Magnitude of each state below which errors count absolutely.


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
    """What an integrator needs beside its code."""

    tableau: Matrix  # Coefficients, in rows that the integrator describes.
    step_sizes: Vector  # In s, those for which operators of a frozen Jacobian are stored.
    operators: Cube  # Of a frozen Jacobian, for each of these step sizes.
    active: IntVector  # Numbers of the states that the right-hand side depends on.


class Control(NamedTuple):
    """Limits of a run, and how step sizes follow the errors."""

    # Of the error in the factor of the next step, after a rejected step, and of the error before.
    exponent: Float
    rejected_exponent: Float
    memory_exponent: Float = 0.0
    # What counts as the error before the first step; the least that counts before any other.
    memory_start: Float = 1.0
    memory_floor: Float = 1e-4
    # Smallest factor after a rejected and after an accepted step, largest factor; share of the
    # step size that the error asks for.
    shrink_least: Float = 0.1
    shrink: Float = 0.2
    grow: Float = 6.0
    safety: Float = 0.9
    # Whether two equal steps are taken instead of a long and a tiny one (1) or not (0).
    halve_last: Float = 1.0
    shortest_first: Float = 0.0  # Shortest first guess of a step in s.
    # Largest local error of a state relative to its scale plus its magnitude.
    tolerance: Float = 0.0
    longest: Float = math.inf  # Longest step in s.
    restart: Float = 0.05  # Longest first step in s after a break point of the inputs.
    # Evaluations of the right-hand side within a second of the run after which it ends.
    most_calls: Float = 0.0
    first: Float = 0.0  # First step to try in s, 0 if it is to be guessed.


class Output(NamedTuple):
    """Where a run is recorded: states at its samples, or at points from which these follow.

    The points of a step are its samples where they are few, and up to `record_all_until`; else its
    `NODES`, through which cubics give the samples, as dense output of order 3 does.
    """

    samples: Vector  # Output times in s.
    states: Matrix  # A row for each point, in order.
    rows: IntVector  # How many of these rows are recorded (1,).
    counts: IntVector  # See `RHS_CALLS`.
    sample_inputs: Matrix  # Inputs at the samples.
    point_inputs: Matrix  # Inputs at the points; empty if these are the samples.
    # Row of the sample's point, or of the first node of its step, and the part of the step that has
    # passed, -1 where the point is the sample.  Both are -1 where a run has not come.  Empty if the
    # points are the samples.
    point_of_sample: Matrix
    record_all_until: Float  # Time in s from which on nodes may stand for samples.

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
            point_of_sample=np.empty((points, 2)),
            record_all_until=record_all_until,
        )


class Memory(NamedTuple):
    """What a run works in."""

    start: Vector  # State where it begins (n,).
    # Scratch space, see `catalogue.scratch_size`.
    buffer: Vector
    integers: IntVector


class Outputs(NamedTuple):
    """Some outputs of a model."""

    # Address of their kernel: for `LANES` samples at once, for a single one on shorter paths.
    kernel: IntVector
    constants: Vector  # Hoisted constants of the kernel.
    # Of each output: column c of the states, or -1 - c for column c of the kernel's results.
    columns: IntVector
    ranges: Matrix  # Of the outputs that are watched (limited, 2).


class Problem(NamedTuple):
    """Equations on one span and one window, with scratch space."""

    segment: int  # Number of the segment of the signal.
    signal: Pieces
    equations: Equations  # Those of the full system.
    mean: Vector  # Of the window (n,).
    # Trial and test basis (R, n) by rows.
    trial: Matrix
    test: Matrix
    # Scratch for a state (n,), inputs, rates (n,).
    x: Vector
    u: Vector
    dx: Vector
    # Scratch for mass matrix and forces (n / 2, n / 2 + 1), and for their projection.
    second_order: Matrix
    small: Matrix
    # When the present second of the run began, and how many calls there had been.
    second: Vector
