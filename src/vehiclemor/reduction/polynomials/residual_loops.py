"""Reduced equations that are polynomials in the reduced coordinates: compiled loops.

The equations g(x) - response (u - u_mean) = 0 come multiplied by the inverse of their Jacobian at
x = 0.  So the step of the chord method is the residual itself, and the matrix of Newton's method is
near the unit matrix.  `terms` and `slopes` are written for the rank and the degree by
`kernels.py`.
"""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Int, Matrix, Vector, matrix, vector
from vehiclemor.simulation.newton_loops import (
    CONVERGED,
    INPUTS,
    SAMPLE,
    SINGULAR,
    N,
    Solution,
    failure,
    small_solve,
    stopped,
)


class Polynomials(NamedTuple):
    """Reduced equations.

    Attributes
    ----------
    means
        Mean inputs, then mean coordinates (INPUTS + states,).
    basis
        Coordinates of each unit of a scaled reduced coordinate, by rows (N, states).
    response
        Change of g for each unit of an input (INPUTS, N).
    coefficients, derivatives
        Of each monomial in each equation (monomials, N), and of the derivatives by variable
        (N, monomials of one degree less, N).
    tolerances
        Largest components (N,) of the last step (scaled reduced coordinates).
    """

    means: Vector
    basis: Matrix
    response: Matrix
    coefficients: Matrix
    derivatives: Cube
    tolerances: Vector


def terms(x: Vector, load: Vector, coefficients: Matrix, result: Vector) -> None:
    """Polynomials at x (N,), less a load (N,), into result (N,): a kernel inside of the loop."""


def slopes(x: Vector, derivatives: Cube, result: Matrix) -> None:
    """Jacobian of the polynomials at x (N,) into result[:, :N]; result is (N, N + 1)."""


def reduced_path(
    inputs: Matrix,
    x_start: Vector,
    polynomials: Polynomials,
    newton: Int,
    limit: Int,
    solution: Solution,
    buffer: Vector,
) -> Int:
    """Solve the reduced equations sample by sample.

    The iteration starts at a quadratic extrapolation of the last three samples, the first ones at
    the sample before, of the very first at `x_start` (N,), scaled.  A sample has at most `limit`
    iterations, with `newton` each with a fresh Jacobian.
    """
    means, basis, response, coefficients, derivatives, tolerances = polynomials
    path, counts = solution.path, solution.counts
    x, load, step = vector(buffer, 0, N), vector(buffer, 4 * N, N), vector(buffer, 5 * N, N)
    first, second, third = vector(buffer, N, N), vector(buffer, 2 * N, N), vector(buffer, 3 * N, N)
    matrix_of = matrix(buffer, 6 * N, N, N + 1)
    for k in range(N):
        x[k] = x_start[k]
    iterations = 0
    for sample in range(inputs.shape[0]):
        counts[SAMPLE] = sample
        for k in range(N):
            total = 0.0
            for i in range(INPUTS):
                total += response[i, k] * (inputs[sample, i] - means[i])
            load[k] = total
        if sample > 2:
            for k in range(N):
                x[k] = 3.0 * (first[k] - second[k]) + third[k]
        converged = False
        for _ in range(limit):
            terms(x, load, coefficients, step)
            iterations += 1
            if newton:
                slopes(x, derivatives, matrix_of)
                for k in range(N):
                    matrix_of[k, N] = step[k]
                if not small_solve(matrix_of, N):
                    return stopped(counts, iterations, newton * iterations, SINGULAR)
                for k in range(N):
                    step[k] = matrix_of[k, N]
            converged = True
            for k in range(N):
                x[k] -= step[k]
                converged &= abs(step[k]) < tolerances[k]
            if converged:
                break
        if not converged:
            return stopped(counts, iterations, newton * iterations, failure(x))
        for k in range(N):
            third[k] = second[k]
            second[k] = first[k]
            first[k] = x[k]
        for i in range(path.shape[1]):
            total = means[INPUTS + i]
            for k in range(N):
                total += basis[k, i] * x[k]
            path[sample, i] = total
    return stopped(counts, iterations, newton * iterations, CONVERGED)


def terms_path(points: Matrix, loads: Matrix, coefficients: Matrix, result: Matrix) -> Int:
    """Values (samples, N) of the polynomials, less loads (samples, N), at points."""
    for sample in range(points.shape[0]):
        terms(points[sample], loads[sample], coefficients, result[sample])
    return CONVERGED
