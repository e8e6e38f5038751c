"""One row of the comparison with the paper."""

import math
from typing import NamedTuple

# Label of a method in the paper's studies, and preset -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}
PRESETS = {"recommended": "default", "literal": "literal"}
PARAMETERS = "the paper's parameters were never published; ours are public data"


class Row(NamedTuple):
    """A published number or claim beside what is reproduced.

    Attributes
    ----------
    published
        The number, or the bound of the criterion of a claim.
    floor, replay
        The same quantity of the best approximation in the subspaces, and of replay.
    verdict
        `met`, `missed` or `not_comparable`.
    """

    model: str | None
    item: str
    published: float
    reproduced: float
    unit: str
    floor: float
    replay: float
    verdict: str
    reason: str


COLUMNS = Row._fields


def verdict(met: bool) -> str:
    """Word for whether a bound is met."""
    return "met" if met else "missed"


def not_comparable(
    model: str | None, item: str, reason: str, published: float = math.nan, unit: str = "-"
) -> Row:
    """Row of something that can't be reproduced."""
    missing = math.nan
    return Row(model, item, published, missing, unit, missing, missing, "not_comparable", reason)
