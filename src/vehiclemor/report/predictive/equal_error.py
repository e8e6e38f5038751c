"""Times of the full order at the error of a reduced model, interpolated on its ladders.

A ladder is one integrator at several tolerances.  Its useful rows form a curve of time over error;
between two of them it is taken as a power law, which is what an integrator of fixed order gives.
A ladder that ends just above the error is continued by the law of its last two rows: else a slower
integrator would stand in for it.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from vehiclemor.report.predictive.targets import Row

# Smallest part of the error of its last row to which a ladder is continued.
CONTINUED = 0.5


class Equal(NamedTuple):
    """The fastest full order at an error.

    Attributes
    ----------
    seconds
        Of a run; NaN if no ladder reaches the error.
    rows
        The rows between which it lies or which are continued, or the one that is used.
    """

    seconds: float
    rows: tuple[str, ...] = ()


def at_error(ladders: Iterable[Sequence[Row]], error: float, clock: str) -> Equal:
    """The fastest of all ladders at an error (a score), by a column of seconds."""
    found = [_on(_useful(ladder, clock), error, clock) for ladder in ladders]
    reached = [equal for equal in found if not math.isnan(equal.seconds)]
    return min(reached, key=lambda equal: equal.seconds, default=Equal(math.nan))


def _useful(ladder: Sequence[Row], clock: str) -> list[Row]:
    """Rows of which none of the ladder is both faster and more accurate, least accurate first."""
    finished = [row for row in ladder if math.isfinite(row["score"]) and row[clock] > 0.0]
    kept: list[Row] = []
    for row in sorted(finished, key=lambda row: (row[clock], row["score"])):
        if not kept or row["score"] < kept[-1]["score"]:
            kept.append(row)
    return kept


def _on(curve: Sequence[Row], error: float, clock: str) -> Equal:
    if not curve or not error >= curve[-1]["score"] * (CONTINUED if len(curve) > 1 else 1.0):
        return Equal(math.nan)
    if error >= curve[0]["score"]:
        return Equal(curve[0][clock], (curve[0]["label"],))
    further = (pair for pair in pairwise(curve) if error >= pair[1]["score"])
    loose, tight = next(further, (curve[-2], curve[-1]))
    if tight["score"] <= 0.0:
        return Equal(tight[clock], (tight["label"],))
    part = math.log(error / loose["score"]) / math.log(tight["score"] / loose["score"])
    seconds = loose[clock] * (tight[clock] / loose[clock]) ** part
    return Equal(seconds, (loose["label"], tight["label"]))
