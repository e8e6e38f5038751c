"""The variation of a run along time, compiled."""

from vehiclemor.codegen.loop_types import Cube, Int


def recurrence(matrices: Cube, forcing: Cube, result: Cube) -> Int:
    """From its first entry on, x' = A x + g: matrices, forcing and result (samples, n, m)."""
    for sample in range(len(matrices)):
        before, now = result[sample], result[sample + 1]
        for i in range(before.shape[0]):
            for f in range(before.shape[1]):
                now[i, f] = forcing[sample, i, f]
            for j in range(before.shape[0]):
                weight = matrices[sample, i, j]
                for f in range(before.shape[1]):
                    now[i, f] += weight * before[j, f]
    return 0
