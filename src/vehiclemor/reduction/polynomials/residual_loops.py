"""Reduced equations that are polynomials in the reduced coordinates: compiled loops.

The equations g(x) - response (u - u_mean) = 0 come multiplied by the inverse of their Jacobian at
x = 0.  So the step of the chord method is the residual itself, and the matrix of Newton's method is
near the unit matrix.  `terms` and `slopes` are written for the rank and the degree by
`map_kernels.py`.
"""

import numpy as np

from vehiclemor.codegen.stubs import INPUTS, N
from vehiclemor.reduction.polynomials.kernels import slopes, terms
from vehiclemor.simulation.newton_loops import failure, small_solve


def reduced_path(
    inputs,
    x_start,
    means,
    basis,
    response,
    coefficients,
    derivatives,
    newton,
    tolerances,
    limit,
    path,
    counts,
):
    """Solve the reduced equations sample by sample.

    The iteration starts at a quadratic extrapolation of the last three samples, the first ones at
    the sample before.

    Parameters
    ----------
    inputs
        Inputs (samples, INPUTS), SI units.
    x_start
        Scaled reduced coordinates (N,) of the first iteration's start.
    means
        Mean inputs, then mean coordinates (INPUTS + states,).
    basis
        Coordinates of each unit of a scaled reduced coordinate, by rows (N, states).
    response
        Change of g for each unit of an input (INPUTS, N).
    coefficients, derivatives
        Of each monomial in each equation (monomials, N), and of the derivatives by variable
        (N, monomials of one degree less, N).
    newton
        Whether each iteration has a fresh Jacobian.
    tolerances
        Largest components (N,) of the last step (scaled reduced coordinates).
    limit
        Most iterations for a sample.
    path
        Takes the coordinates (samples, states).
    counts
        Takes the counts in the order of `ALGEBRAIC_COUNTS`.

    Returns
    -------
    tuple
        Status and sample, as the full-order loops do.
    """
    x, first, second, third = x_start.copy(), np.empty(N), np.empty(N), np.empty(N)
    load, step, matrix = np.empty(N), np.empty(N), np.empty((N, N + 1))
    iterations = 0
    for sample in range(inputs.shape[0]):
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
                slopes(x, derivatives, matrix)
                for k in range(N):
                    matrix[k, N] = step[k]
                if not small_solve(matrix, N):
                    return 3, sample
                for k in range(N):
                    step[k] = matrix[k, N]
            converged = True
            for k in range(N):
                x[k] -= step[k]
                converged &= abs(step[k]) < tolerances[k]
            if converged:
                break
        if not converged:
            return failure(x), sample
        for k in range(N):
            third[k] = second[k]
            second[k] = first[k]
            first[k] = x[k]
        for i in range(path.shape[1]):
            total = means[INPUTS + i]
            for k in range(N):
                total += basis[k, i] * x[k]
            path[sample, i] = total
    for kind in range(4):
        counts[kind] = iterations
    if not newton:
        counts[2] = 0
    return 0, inputs.shape[0]


def terms_path(points, loads, coefficients, result):
    """Values (samples, N) of the polynomials, less loads (samples, N), at points."""
    for sample in range(points.shape[0]):
        terms(points[sample], loads[sample], coefficients, result[sample])
