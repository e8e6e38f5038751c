"""Dense systems of equations: LU factors with partial pivoting, their solutions, small systems."""

import math

INLINED = ("small_solve",)


def small_solve(a, r):
    """Solve the leading r x r block of a for its last column, which the solution replaces.

    Gives the sign of the determinant, zero if a pivot is zero or not finite.
    """
    sign, last = 1, a.shape[1] - 1
    for k in range(r):
        pivot = k
        for i in range(k + 1, r):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if a[pivot, k] == 0.0 or not math.isfinite(a[pivot, k]):
            return 0
        if a[pivot, k] < 0.0:
            sign = -sign
        if pivot != k:
            sign = -sign
            for j in range(k, r):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            a[k, last], a[pivot, last] = a[pivot, last], a[k, last]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, r):
            factor = a[i, k] * inverse
            for j in range(k + 1, r):
                a[i, j] -= factor * a[k, j]
            a[i, last] -= factor * a[k, last]
    for k in range(r - 1, -1, -1):
        total = a[k, last]
        for j in range(k + 1, r):
            total -= a[k, j] * a[j, last]
        a[k, last] = total / a[k, k]
    return sign


def factorise(matrix, rows):
    """Replace a matrix by its factors; False if it is singular."""
    dim = len(matrix)
    for k in range(dim):
        best, row = abs(matrix[k, k]), k
        for i in range(k + 1, dim):
            if abs(matrix[i, k]) > best:
                best, row = abs(matrix[i, k]), i
        if not 1e-300 < best < 1e300:
            return False
        rows[k] = row
        if row != k:
            for j in range(dim):
                matrix[k, j], matrix[row, j] = matrix[row, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, dim):
            factor = matrix[i, k] * inverse
            matrix[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, dim):
                    matrix[i, j] -= factor * matrix[k, j]
    return True


def substitute(matrix, rows, b):
    """Replace b by the solution of L U x = b."""
    dim = len(b)
    for k in range(dim):
        row = rows[k]
        if row != k:
            b[k], b[row] = b[row], b[k]
    for k in range(dim):
        value = b[k]
        for i in range(k + 1, dim):
            b[i] -= matrix[i, k] * value
    for k in range(dim - 1, -1, -1):
        b[k] /= matrix[k, k]
        value = b[k]
        for i in range(k):
            b[i] -= matrix[i, k] * value
