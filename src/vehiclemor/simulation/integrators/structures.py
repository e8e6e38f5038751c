"""What goes through the compiled time loop, in named bundles."""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Float, Int, IntVector, Matrix, Vector
from vehiclemor.inputs.sample_loops import Pieces

# Places of a system's kernels in its list of addresses; see `System`.
DERIVATIVE, OUTPUTS, SECOND_ORDER, SPEEDS, STEP_KERNEL = range(5)
# Why a run has ended: all well, too many evaluations, not finite, singular matrix, tiny step.
FINISHED, TOO_MANY_CALLS, NOT_FINITE, SINGULAR, STEP_TOO_SMALL = range(5)
# Places of the counts of a run.
RHS_CALLS, STEPS, REJECTED_STEPS, JACOBIANS, FACTORISATIONS, LINEAR_SOLVES = range(6)


class Equations(NamedTuple):
    """Compiled equations dx/dt = f(x, u).

    Attributes
    ----------
    kernels
        Addresses of the kernels by place, zero where there is none.
    constants
        Hoisted constants of the parameters.
    error_scale
        Magnitude of each state below which errors count absolutely.
    turning
        Numbers of the heading and of pairs of velocities that turn with it; may be empty.
    """

    kernels: IntVector
    constants: Vector
    error_scale: Vector
    turning: IntVector


class Spans(NamedTuple):
    """Parts of a run without a break point of the inputs or an edge of a window inside.

    Edges (spans + 1,) are times in s; a span lies in one segment of the signal and one window.
    """

    edges: Vector
    segments: IntVector
    windows: IntVector


class Place(NamedTuple):
    """A point of a run: time in s, segment of the signal, control period."""

    time: Float
    segment: Int
    window: Int


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
        Coefficients, packed as the integrator wants them.
    grid
        Step sizes (s) for which operators are stored.
    operators
        Stored operators of each step size.
    shared
        What is stored of the frozen Jacobian for all step sizes.
    active
        Numbers of the states that the right-hand side depends on.
    rotating
        Numbers of the heading and of pairs of states that turn with it: stored operators belong to
        heading zero.  May be empty.
    """

    tableau: Matrix
    grid: Vector
    operators: Cube
    shared: Matrix
    active: IntVector
    rotating: IntVector


class Control(NamedTuple):
    """Limits of a run, and how step sizes follow the errors.

    Attributes
    ----------
    exponent, rejected_exponent
        Of the error in the factor of the next step, and after a rejected step.
    memory_exponent
        Of the error before.
    memory_start, memory_floor
        What counts as the error before the first step, and at least as that before any other.
    shrink_least, shrink, grow
        Smallest factor after a rejected and after an accepted step, largest factor.
    safety
        Share of the step size that the error asks for.
    keep_least, keep_most
        Factors between which the step size stays.
    halve_last
        Whether two equal steps are taken instead of a long and a tiny one (1) or not (0).
    shortest_first
        Shortest first guess of a step in s.
    tolerance
        Largest local error of a state relative to its scale plus its own size.
    longest
        Longest step in s.
    restart
        Longest first step after a break point of the inputs in s.
    most_calls
        Evaluations of the right-hand side after which a run is given up.
    first
        First step to try in s; 0 if it is to be guessed.
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


# Points of a step: the Chebyshev points of a cubic.
NODES = 4
NODE_1, NODE_2 = 0.03806023374435663, 0.30865828381745514


class Output(NamedTuple):
    """Where a run is recorded.

    A run with `places` is recorded at points instead: at the samples themselves where a step has
    few, else at `NODES` points of the step, through which cubics give the samples, as dense output
    of order 3 does.

    Attributes
    ----------
    samples
        Output times in s.
    path
        States (samples, n) at these times, or at the points.
    counts
        By place, see above.
    given
        Inputs (samples, inputs) at the samples.
    inputs, point_times
        Inputs (samples, inputs) at the points, and their times (samples,).
    places
        By sample (samples, 2): row of its point, or of the first of its step's, and which part of
        the step has passed then; -1 where there is no row, and no step.
    direct_until
        Time up to which the points are the samples.
    """

    samples: Vector
    path: Matrix
    counts: IntVector
    given: Matrix
    inputs: Matrix
    point_times: Vector
    places: Matrix
    direct_until: Float


class Outputs(NamedTuple):
    """Some outputs of a model.

    Attributes
    ----------
    kernel
        Address of their kernel: for `LANES` samples, or for one on shorter paths.
    constants
        Of the kernel.
    columns
        By output the column of the states, or -1 less the column of the kernel's results.
    ranges
        Smallest and largest value (limited, 2) of those that are watched.
    """

    kernel: IntVector
    constants: Vector
    columns: IntVector
    ranges: Matrix


class Problem(NamedTuple):
    """Equations on one span and one window, with scratch space.

    A segment of the signal, the mean (n,) of the window, trial and test basis (R, n) by rows.
    Scratch: state (n,), inputs, rates (n,); mass matrix and forces (n / 2, n / 2 + 1), and their
    projection.
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


class Work(NamedTuple):
    """Scratch space of an integrator; what it doesn't use is empty.

    Attributes
    ----------
    y, f
        Reduced state (dim,) and right-hand side at the beginning of the step.
    new, f_new
        The same at its end, once the step is accepted.
    error
        Estimate of the local error (dim,).
    middle
        State of a stage.
    stages
        Rows of stages (stages, dim).
    curve
        Coefficients (3, dim) of the interpolation, powers 1 to 3 of the part that has passed.
    jacobian, factors
        Jacobian and factorised matrix (dim, dim).
    pivots, places
        Rows of the factorisation (dim,); the integrator's own integers (4,).
    memory
        The integrator's own numbers (4,).
    given, values, result
        Arguments and result of a kernel that takes whole steps.
    """

    y: Vector
    f: Vector
    new: Vector
    f_new: Vector
    error: Vector
    middle: Vector
    stages: Matrix
    curve: Matrix
    jacobian: Matrix
    factors: Matrix
    pivots: IntVector
    places: IntVector
    memory: Vector
    given: Vector
    values: Vector
    result: Vector


def rows_of(states):
    """The first vectors of `Work`, from the state to the middle, as rows of a matrix."""
    return states[0], states[1], states[2], states[3], states[4], states[5]
