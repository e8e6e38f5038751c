"""The mirror image of a vehicle's states: whose sign turns, and which change places.

A vehicle is its own mirror image.  At straight running its Jacobian J has blocks in the sums and
differences of left and right: one of motions that are their own mirror image, one of those that
reverse.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Wheels that the mirror exchanges, as parts of names.
SWAPPED = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}
# Entries of a Jacobian, in its own units, below which they are rounding of its differences.
ROUNDING = 1e-5
# Coordinates of a diagonal block: each a sum of states times signs.
Block = tuple[tuple[tuple[int, float], ...], ...]


def partners(names: Sequence[str]) -> np.ndarray:
    """Number of the state that each becomes in the mirror, its own if it has no partner."""
    images = ["_".join(SWAPPED.get(part, part) for part in name.split("_")) for name in names]
    places = {name: i for i, name in enumerate(names)}
    return np.array([places.get(image, i) for i, image in enumerate(images)], dtype=np.int64)


def signs(jacobian: np.ndarray, partner: np.ndarray) -> np.ndarray | None:
    """Signs (n,) with which J (n, n) is its own mirror image; none if there are no such signs.

    S J S = J for (S x)_i = signs[i] x[partner[i]] fixes the signs of states that are coupled
    against one another; each group of coupled states may be reversed as a whole.
    """
    image = jacobian[np.ix_(partner, partner)]
    coupled = (np.abs(jacobian) > ROUNDING) & (np.abs(image) > ROUNDING)
    relation = np.where(coupled, np.sign(jacobian * image), 0.0)
    # Either of a pair has the same sign, so that S S is the identity.
    relation[np.arange(len(partner)), partner] = 1.0
    found = np.zeros(len(partner))
    for first in range(len(partner)):
        waiting = [] if found[first] else [(first, 1.0)]
        while waiting:
            i, sign = waiting.pop()
            if not found[i]:
                found[i] = sign
                related = relation[i] + relation[:, i] * (relation[i] == 0.0)
                waiting += [(j, sign * related[j]) for j in np.flatnonzero(related)]
    reflected = found[:, None] * image * found
    return found if np.abs(reflected - jacobian).max(initial=0.0) <= ROUNDING else None


def mirror_blocks(partner: np.ndarray, sign: np.ndarray) -> tuple[Block, ...]:
    """Coordinates that are their own mirror image, and those that reverse, as sums of states."""
    blocks: list[Block] = []
    for parity in (1.0, -1.0):
        rows: list[tuple[tuple[int, float], ...]] = []
        for i, j in enumerate(partner.tolist()):
            if i < j:
                rows.append(((i, 1.0), (j, parity * float(sign[i]))))
            elif i == j and sign[i] == parity:
                rows.append(((i, 1.0),))
        blocks.append(tuple(rows))
    return tuple(block for block in blocks if block)
