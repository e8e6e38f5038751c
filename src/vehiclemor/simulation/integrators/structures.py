"""What goes through the compiled time loop, in named bundles."""

import math
from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Float, IntVector, Matrix, Vector
from vehiclemor.inputs.polynomial_loops import Pieces

# Places of a system's kernels in its list of addresses; see `System`.
DERIVATIVE, SECOND_ORDER, SPEEDS, STEP_KERNEL = range(4)
# Why a run has ended: all well, too many evaluations, not finite, singular matrix, tiny step.
FINISHED, TOO_MANY_CALLS, NOT_FINITE, SINGULAR, STEP_TOO_SMALL = range(5)
# Places of the counts of a run.
RHS_CALLS, STEPS, REJECTED_STEPS, JACOBIANS, FACTORISATIONS, LINEAR_SOLVES = range(6)


class Equations(NamedTuple):
    """Compiled equations dx/dt = f(x, u).

    Addresses of the kernels by place, zero where there is none, and their hoisted constants; the
    magnitude of each state below which errors count absolutely.
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

    Its coefficients; step sizes (s) for which operators of a frozen Jacobian are stored, these
    operators; numbers of the states that the right-hand side depends on.
    """

    tableau: Matrix
    grid: Vector
    operators: Cube
    active: IntVector


class Control(NamedTuple):
    """Limits of a run, and how step sizes follow the errors.

    Attributes
    ----------
    exponent, rejected_exponent, memory_exponent
        Of the error in the factor of the next step, after a rejected step, and of the error before.
    memory_start, memory_floor
        What counts as the error before the first step, and at least as that before any other.
    shrink_least, shrink, grow, safety
        Smallest factor after a rejected and after an accepted step, largest factor; share of the
        step size that the error asks for.
    keep_least, keep_most
        Factors between which the step size stays.
    halve_last
        Whether two equal steps are taken instead of a long and a tiny one (1) or not (0).
    tolerance
        Largest local error of a state relative to its scale plus its own size.
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


# Points of a step: the Chebyshev points of a cubic.
NODES = 4
NODE_1, NODE_2 = 0.03806023374435663, 0.30865828381745514


class Output(NamedTuple):
    """Where a run is recorded: states (samples, n) at its output times, and counts by place.

    A run with `places` is recorded at points instead: at the samples themselves where a step has
    few, and up to the time `direct_until`; else at `NODES` points of the step, through which cubics
    give the samples, as dense output of order 3 does.  A place (samples, 2) is the row of the
    sample's point, or of the first of its step's, and which part of the step has passed then; -1
    where there is no row, and no step.  Inputs are those given at the samples, and those at the
    points, whose times are kept too.
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

    Address of their kernel, for `LANES` samples or for one on shorter paths, and its constants; by
    output the column of the states, or -1 less the column of the kernel's results; ranges
    (limited, 2) of those that are watched.
    """

    kernel: IntVector
    constants: Vector
    columns: IntVector
    ranges: Matrix


class Problem(NamedTuple):
    """Equations on one span and one window, with scratch space.

    A segment of the signal, the mean (n,) of the window, trial and test basis (R, n) by rows.
    Scratch: state (n,), inputs, rates (n,); mass matrix and forces (n / 2, n / 2 + 1), and their
    projection; when the present second of the run began, and how many calls there had been.
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


class Work(NamedTuple):
    """Scratch space of an integrator; what it doesn't use is empty.

    Reduced state y (dim,) and right-hand side f at the beginning of the step, the new ones at its
    end once it is accepted; error (dim,); state in the middle of a step; rows of stages; curve
    (3, dim), powers 1 to 3 of the part that has passed; Jacobian and factorised matrix (dim, dim)
    with its pivots; the integrator's own integers (places) and numbers (memory), four each;
    arguments and result of a kernel that takes whole steps.
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
