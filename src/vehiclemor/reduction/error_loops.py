"""Errors along a run, by modes of a frozen linearisation: a compiled loop."""

from vehiclemor.codegen.loop_types import Int, Matrix, Vector

# Rows of the weights of a step, real and imaginary parts by mode: of the error before it, of what
# drives the error at its beginning and at its end.
DECAY, BEGIN, END = 0, 2, 4


def propagated(sources: Matrix, weights: Matrix, start: Vector, errors: Matrix) -> Int:
    """Errors (nodes, 2 modes) of e' = lambda e + source, from the one at the start (2 modes,).

    The source is linear between equidistant nodes.  Real parts of all modes stand first in a row,
    then the imaginary ones.
    """
    modes = weights.shape[1]
    for j in range(2 * modes):
        errors[0, j] = start[j]
    for i in range(1, len(errors)):
        for j in range(modes):
            k = modes + j
            a, b = errors[i - 1, j], errors[i - 1, k]
            c, d = sources[i - 1, j], sources[i - 1, k]
            e, f = sources[i, j], sources[i, k]
            errors[i, j] = (
                (weights[DECAY, j] * a - weights[DECAY + 1, j] * b)
                + (weights[BEGIN, j] * c - weights[BEGIN + 1, j] * d)
                + (weights[END, j] * e - weights[END + 1, j] * f)
            )
            errors[i, k] = (
                (weights[DECAY, j] * b + weights[DECAY + 1, j] * a)
                + (weights[BEGIN, j] * d + weights[BEGIN + 1, j] * c)
                + (weights[END, j] * f + weights[END + 1, j] * e)
            )
    return 0
