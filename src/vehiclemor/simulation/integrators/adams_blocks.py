"""The exponential Adams method for equal diagonal blocks of a Jacobian: a system and its tangents.

Modes are those of one block, over and over: single ones of all blocks, then the first and the
second of each pair.  Products take the blocks one by one; the last of the shared rows holds the
number of blocks, and of single modes and pairs in each.
"""

BLOCKS, SINGLES, PAIRS = range(3)


def sizes(method, dim):
    """Numbers of modes and of pairs of them, of all blocks."""
    r = len(method.shared) - dim - 4
    return r, (method.operators.shape[2] - r) // 2


def add_product(rows, first, b, size, result):
    """Add the product of S (from row 0 on) or of T with b to a vector of that size."""
    last = rows[len(rows) - 1]
    blocks, singles, pairs = int(last[BLOCKS]), int(last[SINGLES]), int(last[PAIRS])
    n = (len(b) if first == 0 else size) // blocks
    for block in range(blocks):
        start = block * n
        for part in range(3):
            # Where these modes of the block stand among all.
            width = singles if part == 0 else pairs
            place = block * width
            if part > 0:
                place += blocks * (singles + (part - 1) * pairs)
            if first == 0:
                for i in range(n):
                    weight = b[start + i]
                    for k in range(place, place + width):
                        result[k] += rows[start + i, k] * weight
            else:
                for k in range(place, place + width):
                    weight = b[k]
                    for i in range(start, start + n):
                        result[i] += rows[first + k, i] * weight
