"""Variational equations of a reduced vehicle along a run, by the trapezoidal rule, compiled."""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import Cube, Int, IntVector, Matrix, Vector, matrix
from vehiclemor.simulation.integrators.dense_solves import factorise, substitute


class AlongRun(NamedTuple):
    """A run and its equations' derivatives, at the times that are stepped on."""

    times: Vector  # In s (samples,).
    columns: Matrix  # Features (samples, terms).
    slopes: Cube  # Derivatives (samples, k + 3, k) of z', psi', U and V by z.
    motion: Matrix  # cos(psi), sin(psi), and the derivatives of X' and Y' by psi (samples, 4).


def sensitivities(
    run: AlongRun,
    # Feature, and column of C, of each coefficient (m,).
    terms: IntVector,
    targets: IntVector,
    every: Int,  # One of so many samples is compared, the last one among them.
    weights: Matrix,  # Of the states at these samples (compared, k + 3).
    result: Cube,
    buffer: Vector,  # Scratch space (2 (k + 3) m + 3 m + 3 k^2,), as are the pivots (k,).
    pivots: IntVector,
) -> Int:
    """Derivatives (compared samples, k + 3, m) of z, psi, X and Y by m coefficients, weighted."""
    times, columns, slopes, motion = run
    samples, k, m = len(times), slopes.shape[2], len(terms)
    dim = k + 3
    now, before = matrix(buffer, 0, dim, m), matrix(buffer, dim * m, dim, m)
    rates, first = matrix(buffer, 2 * dim * m, 3, m), (2 * dim + 3) * m
    factors = matrix(buffer, first, k, k)
    # Of (1 - h J)^-1 (1 + h J) and h (1 - h J)^-1, by columns.
    advance = matrix(buffer, first + k * k, k, k)
    inverse = matrix(buffer, first + 2 * k * k, k, k)
    now[:, :] = 0.0
    turned(columns[0], slopes[0], motion[0], terms, targets, now, rates)
    row = copied(now, weights, result, 0) if (samples - 1) % every == 0 else 0
    for n in range(1, samples):
        now, before = before, now
        half = 0.5 * (times[n] - times[n - 1])
        for i in range(k):
            for j in range(k):
                one = 1.0 if i == j else 0.0
                factors[i, j] = one - half * slopes[n, i, j]
                advance[j, i] = one + half * slopes[n - 1, i, j]
                inverse[j, i] = half * one
        if not factorise(factors, pivots):
            return 0
        for j in range(k):
            substitute(factors, pivots, advance[j])
            substitute(factors, pivots, inverse[j])
        for i in range(k):
            for f in range(m):
                now[i, f] = 0.0
            for j in range(k):
                weight = advance[j, i]
                for f in range(m):
                    now[i, f] += weight * before[j, f]
        for f in range(m):
            target = targets[f]
            if target < k:
                forcing = columns[n, terms[f]] + columns[n - 1, terms[f]]
                for i in range(k):
                    now[i, f] += inverse[target, i] * forcing
        for i in range(3):
            for f in range(m):
                now[k + i, f] = before[k + i, f] + half * rates[i, f]
        turned(columns[n], slopes[n], motion[n], terms, targets, now, rates)
        for f in range(m):
            now[k, f] += half * rates[0, f]
        for i in range(1, 3):
            for f in range(m):
                rates[i, f] += motion[n, i + 1] * half * rates[0, f]
                now[k + i, f] += half * rates[i, f]
        if (samples - 1 - n) % every == 0:
            row = copied(now, weights, result, row)
    return 1


def copied(now, weights, result, row):
    """Number of the next row."""
    for i in range(now.shape[0]):
        for f in range(now.shape[1]):
            result[row, i, f] = weights[row, i] * now[i, f]
    return row + 1


def turned(columns, slopes, motion, terms, targets, now, rates):
    """Derivatives (3, m) of psi', X' and Y', with the heading as it stands in `now`."""
    k, m = slopes.shape[1], len(terms)
    cosine, sine = motion[0], motion[1]
    for i in range(3):
        for f in range(m):
            rates[i, f] = motion[i + 1] * now[k, f] if i else 0.0
    for j in range(k):
        turn = slopes[k, j]
        x = slopes[k + 1, j] * cosine - slopes[k + 2, j] * sine
        y = slopes[k + 1, j] * sine + slopes[k + 2, j] * cosine
        for f in range(m):
            rates[0, f] += turn * now[j, f]
            rates[1, f] += x * now[j, f]
            rates[2, f] += y * now[j, f]
    for f in range(m):
        value, target = columns[terms[f]], targets[f]
        if target == k:
            rates[0, f] += value
        elif target == k + 1:
            rates[1, f] += cosine * value
            rates[2, f] += sine * value
        elif target == k + 2:
            rates[1, f] -= sine * value
            rates[2, f] += cosine * value
