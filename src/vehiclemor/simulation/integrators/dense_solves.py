"""LU factors with partial pivoting, and their solutions."""


def factorise(matrix, rows):
    """Factors in place of the matrix; False if it is singular."""
    dim = len(matrix)
    for k in range(dim):
        best, place = abs(matrix[k, k]), k
        for i in range(k + 1, dim):
            if abs(matrix[i, k]) > best:
                best, place = abs(matrix[i, k]), i
        if not 1e-300 < best < 1e300:
            return False
        rows[k] = place
        if place != k:
            for j in range(dim):
                matrix[k, j], matrix[place, j] = matrix[place, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, dim):
            factor = matrix[i, k] * inverse
            matrix[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, dim):
                    matrix[i, j] -= factor * matrix[k, j]
    return True


def substitute(matrix, rows, b):
    """Solution of L U x = b in place of b."""
    dim = len(b)
    for k in range(dim):
        place = rows[k]
        if place != k:
            b[k], b[place] = b[place], b[k]
    for k in range(dim):
        value = b[k]
        for i in range(k + 1, dim):
            b[i] -= matrix[i, k] * value
    for k in range(dim - 1, -1, -1):
        b[k] /= matrix[k, k]
        value = b[k]
        for i in range(k):
            b[i] -= matrix[i, k] * value
