"""What goes through the compiled loop of `error_loops`, in named bundles.

Modal coordinates stand in rows: real parts of all modes, those of pairs first, then imaginary parts
of pairs.  Arrays have rows for whole windows, each of as many nodes as there are vector lanes, and
columns up to a multiple of the lanes, filled up with zeros.
"""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import Float, IntMatrix, IntVector, Matrix, Vector
from vehiclemor.simulation.loop_arguments import Outputs

# Rows of the weights of a step, real and imaginary parts by mode: of the error before it, of what
# drives the error at its beginning and at its end; then the rates of the modes.
DECAY, BEGIN, END, RATES = 0, 2, 4, 6


class Path(NamedTuple):
    """A run of a reduced model at nodes that are a step in s apart.

    Its states and those that are corrected (nodes, n), inputs (nodes, inputs), and the start (n,)
    of the full model.
    """

    step: Float
    run: Matrix
    corrected: Matrix
    inputs: Matrix
    start: Vector


class Bounded(NamedTuple):
    """Outputs with bounds, a kernel's results for these of run and corrected run (nodes, results).

    Bounds (outputs,), ones of those that are for the largest error instead of its RMS, and errors
    in bounds.
    """

    outputs: Outputs
    own: Matrix
    full: Matrix
    bounds: Vector
    is_peak: Vector
    errors: Vector


class Shape(NamedTuple):
    """Where the shape stands in the states; heading, x, y (3,); pairs that turn (pairs, 2).

    Shapes have the columns of states (n,); those that are not of the shape are zero.  Its values at
    straight running are the reference (n,).  Further addresses of the full model's kernels of rates
    and violations for lanes, and their constants.
    """

    indices: IntVector
    planar: IntVector
    pairs: IntMatrix
    reference: Vector
    kernels: IntVector
    constants: Vector


class ModesOfErrors(NamedTuple):
    """Modes: coordinates of shapes (n, columns); changes of shapes; weights (8, modes).

    Changes have rows for violations of constraints, which they meet, and for modal coordinates; of
    their columns the three after those of the shape are changes of psi', U, V.  Slow (modal
    coordinates,) is one for those that start with an error; what the others add to heading and
    place while they decay follows from the start's deviation by `settling` (n, 3).
    """

    coordinates: Matrix
    changes: Matrix
    weights: Matrix
    slow: Vector
    settling: Matrix


class Violated(NamedTuple):
    """Constraints that the start violates: at some first nodes violations and rates.

    Shapes that move with them and these shapes' slopes (nodes, n), and what of heading and place
    the nodes miss (3,).
    """

    violations: Matrix
    shapes: Matrix
    slopes: Matrix
    motion: Vector


class Scratch(NamedTuple):
    """Room for all nodes: states, inputs, rates, shapes, slopes of the path, motions.

    Then in modes what drives errors, and the errors; what changes shapes: violations of the
    constraints, and changes of the errors.  For the nodes of a window what is left over of the
    slopes, and changes of the shapes.  Of the coordinates of the shape the largest change and one
    over the ranges (n,); what a start adds to heading and place (3,).
    """

    states: Matrix
    inputs: Matrix
    rates: Matrix
    shapes: Matrix
    slopes: Matrix
    motion: Matrix
    sources: Matrix
    errors: Matrix
    changes: Matrix
    left: Matrix
    moved: Matrix
    largest: Vector
    scale: Vector
    settled: Vector
