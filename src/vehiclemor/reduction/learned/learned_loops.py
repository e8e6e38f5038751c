"""Learned equations in time: polynomials, layers of a network, kernels of a Gaussian process."""

import math
from itertools import pairwise
from typing import NamedTuple

from vehiclemor.arguments import check_shapes, require
from vehiclemor.codegen.loop_types import Float, Int, IntMatrix, IntVector, Matrix, Vector, vector

# Beyond this magnitude of a standardised coordinate a run has diverged.
LARGEST = 1e3


class Equations(NamedTuple):
    """What maps arguments v = (1, z, u) to results: the sum of three parts, each may be empty."""

    # Monomials as numbers of their factors in v (terms, degree), and what they count (terms, m).
    terms: IntMatrix
    coefficients: Matrix
    # Of a network with tanh in its hidden layers: sizes of all layers, and its matrices, each
    # followed by its offsets.
    widths: IntVector
    weights: Vector
    # Gaussian kernels exp(-|v / lengths - centre|^2 / 2): (v - 1,), (kernels, v - 1) and (kernels,
    # m).
    lengths: Vector
    centres: Matrix
    heights: Matrix

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of arguments, without the constant, and of results."""
        return len(self.lengths), self.coefficients.shape[1]

    def check_sizes(self) -> None:
        """Raise `ValueError` if the loop would read beyond these arrays."""
        arguments, m = self.sizes
        terms, layers, kernels = self.terms, self.widths.tolist(), len(self.centres)
        require(terms.ndim == 2 and terms.shape[1] > 0, "terms")
        require(bool(((terms >= 0) & (terms <= arguments)).all()), "terms")
        check_shapes("coefficients", (self.coefficients, len(terms), m))
        check_shapes("kernels", (self.centres, kernels, arguments), (self.heights, kernels, m))
        if layers:
            require(min(layers) > 0 and (layers[0], layers[-1]) == (arguments, m), "widths")
            check_shapes("weights", (self.weights, sum((a + 1) * b for a, b in pairwise(layers))))


def evaluate(equations: Equations, v: Vector, buffer: Vector, result: Vector) -> None:
    """Results (m,) at arguments v; the buffer has room for two layers."""
    terms, coefficients, widths, weights, lengths, centres, heights = equations
    results = result.shape[0]
    for j in range(results):
        result[j] = 0.0
    for t in range(terms.shape[0]):
        factor = v[terms[t, 0]]
        for d in range(1, terms.shape[1]):
            factor *= v[terms[t, d]]
        for j in range(results):
            result[j] += factor * coefficients[t, j]
    for i in range(centres.shape[0]):
        square = 0.0
        for d in range(lengths.shape[0]):
            square += (v[d + 1] / lengths[d] - centres[i, d]) ** 2
        factor = math.exp(-0.5 * square)
        for j in range(results):
            result[j] += factor * heights[i, j]
    layers = widths.shape[0] - 1
    if layers > 0:
        half, first = buffer.shape[0] // 2, 0
        for d in range(widths[0]):
            buffer[d] = v[d + 1]
        for layer in range(layers):
            rows, columns = widths[layer], widths[layer + 1]
            before = vector(buffer, (layer % 2) * half, rows)
            after = vector(buffer, half - (layer % 2) * half, columns)
            for j in range(columns):
                after[j] = weights[first + rows * columns + j]
            for i in range(rows):
                for j in range(columns):
                    after[j] += before[i] * weights[first + i * columns + j]
            first += (rows + 1) * columns
            for j in range(columns):
                if layer < layers - 1:
                    after[j] = math.tanh(after[j])
                else:
                    result[j] += after[j]


def evaluated(equations: Equations, arguments: Matrix, buffer: Vector, results: Matrix) -> Int:
    """Results (samples, m) at arguments (samples, v)."""
    for sample in range(arguments.shape[0]):
        evaluate(equations, arguments[sample], buffer, results[sample])
    return 0


def rates(
    equations: Equations,
    state: Vector,
    arguments: tuple[Vector, int],
    buffer: Vector,
    result: Vector,
) -> None:
    """Results at a state whose first entries are k coordinates; inputs stand in the arguments.

    What follows the coordinates is turned into rates of heading and position.
    """
    v, k = arguments
    for i in range(k):
        v[i + 1] = state[i]
    evaluate(equations, v, buffer, result)
    if result.shape[0] > k:
        turn(result, k, state[k])


def turn(result: Vector, k: int, heading: float) -> None:
    """Turn the speeds U, V behind k results and psi' into rates of the position at a heading."""
    forward, sideward = result[k + 1], result[k + 2]
    cosine, sine = math.cos(heading), math.sin(heading)
    result[k + 1] = forward * cosine - sideward * sine
    result[k + 2] = forward * sine + sideward * cosine


def march(
    equations: Equations,
    coordinates: Int,
    step: Float,  # In s.
    # Whether results are changes of the coordinates in a step (heading and position follow by the
    # trapezoidal rule); else they are rates, for the classical Runge-Kutta method.
    discrete_time: Int,
    inputs: Matrix,  # Of all half steps (2 steps + 1, inputs).
    path: Matrix,  # Coordinates; heading and position if the equations have them (steps + 1, m).
    buffer: Vector,
) -> Int:
    """A run from the first row of the path; the number of rows that it has reached."""
    size, k = path.shape[1], coordinates
    width = 1 + k + (1 + discrete_time) * inputs.shape[1]
    stages = vector(buffer, 0, 4 * size)
    state, v = vector(buffer, 4 * size, size), vector(buffer, 5 * size, width)
    work = vector(buffer, 5 * size + width, buffer.shape[0] - 5 * size - width)
    v[0] = 1.0
    for row in range(path.shape[0]):
        last = row == path.shape[0] - 1
        if discrete_time:
            for i in range(inputs.shape[1]):
                v[1 + k + i] = inputs[2 * row, i]
                v[1 + k + inputs.shape[1] + i] = inputs[2 * row + (0 if last else 2), i]
            now, before = vector(stages, 0, size), vector(stages, size, size)
            for i in range(k):
                v[i + 1] = path[row, i]
            evaluate(equations, v, work, now)
            if size > k:
                # The heading first: the rates of the position are turned by it.
                if row > 0:
                    path[row, k] = path[row - 1, k] + 0.5 * step * (before[k] + now[k])
                turn(now, k, path[row, k])
            for i in range(k + 1, size):
                if row > 0:
                    path[row, i] = path[row - 1, i] + 0.5 * step * (before[i] + now[i])
            if last:
                break
            for i in range(k):
                path[row + 1, i] = path[row, i] + now[i]
            for i in range(size):
                before[i] = now[i]
        else:
            if last:
                break
            for stage in range(4):
                for i in range(inputs.shape[1]):
                    v[1 + k + i] = inputs[2 * row + (stage + 1) // 2, i]
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                for i in range(size):
                    state[i] = path[row, i]
                    if stage > 0:
                        state[i] += share * step * stages[(stage - 1) * size + i]
                rates(equations, state, (v, k), work, vector(stages, stage * size, size))
            for i in range(size):
                total = stages[i] + 2.0 * stages[size + i] + 2.0 * stages[2 * size + i]
                path[row + 1, i] = path[row, i] + step / 6.0 * (total + stages[3 * size + i])
        for i in range(k):
            if not abs(path[row + 1, i]) < LARGEST:
                return row + 1
    return path.shape[0]
