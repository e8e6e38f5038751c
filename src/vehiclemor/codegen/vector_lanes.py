"""Sizes of vectors, and of the batches in which kernels evaluate elementary functions."""

# Elementary functions are evaluated this many at a time, so that the compiler makes one vector loop
# of them; fewer than the smallest batch one by one.  Kernels along a path take as many samples.
LANES = 8
SMALLEST_BATCH = 3
# Directions that a derivative takes at once: what they share is computed once.
DIRECTIONS = 16
# Floats in a vector: half a batch; vectors of 512 bits were a fifth slower.
WIDTH = LANES // 2


def padded(count: int) -> int:
    """Length of a row of so many floats, padded to a multiple of the vectors' length."""
    return -(-count // WIDTH) * WIDTH
