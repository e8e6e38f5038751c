"""What a criterion finds of a number or claim of the paper, and the verdict on it.

The paper shows curves; a reader sees a deviation on them when it is a visible share of the
signal's range.  Each criterion is evaluated for the default settings and for the paper's literal
ones, from equilibrium: the paper says nothing of another start.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr

MET, MISSED, NOT_COMPARABLE = "met", "missed", "not_comparable"
VERDICTS = {MET: "met", MISSED: "missed", NOT_COMPARABLE: "not comparable"}
# Interquartile range of the rounds of a timing over their median, above which a time decides
# nothing: half of the runs lie up to a fifth apart.
LARGEST_SPREAD = 0.2
# Share of a signal's range from which on a deviation counts as visible in a figure: 2 mm on a curve
# that is 40 mm high.
VISIBLE = 0.05
# Curves that agree within this share of the range lie on top of each other: 0.4 mm there.
INDISTINGUISHABLE = 0.01
# A change of an error by less than this share is no change.
SMALLEST_CHANGE = 0.01
# Whose the threshold of a criterion is: the paper prints it, the claim's words leave no other, or
# it is ours.
PRINTED, IN_WORDS, OWN = "published", "the claim's words", "added here"
# Label of a method in the paper's studies -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}
Results = Mapping[str, xr.Dataset]


class Finding(NamedTuple):
    """Outcome of one criterion: the number that decides, its bound, and whether it is met.

    That is None if it can't be judged.  `measure` says what the number is, `reason` what else was
    seen, `threshold_source` whose the bound is.  An error has beside it that of the best
    approximation in the subspaces (`floor`) and the RMS of the signal (a bound above that is empty:
    zero would meet it); a time the time over that of the `strongest` full-order solver.
    """

    reproduced: float
    bound: float
    within: bool | None
    measure: str
    reason: str = ""
    threshold_source: str = OWN
    unit: str = "1"
    floor: float = math.nan
    signal_rms: float = math.nan
    strongest: float = math.nan

    @classmethod
    def below(cls, value: float, bound: float, *, valid: bool = True, **about: Any) -> Self:
        """A value that must stay below its bound; a run that has failed is not `valid`.

        `about` are further fields.
        """
        return cls(value, bound, valid and value < bound, **about)

    @classmethod
    def above(cls, value: float, bound: float, *, valid: bool = True, **about: Any) -> Self:
        """As `below`, of a value that must exceed its bound."""
        return cls(value, bound, valid and value > bound, **about)


@dataclass(frozen=True)
class Criterion:
    """A number or claim of the paper as a number that can miss its bound.

    It gets the results of studies and timings by name, and the label of a method; `variants` are
    what the rows of labels are called.  Replay has no subspaces, and integrates nothing: some
    criteria do not apply to it.
    """

    judge: Callable[[Results, str], Finding]
    variants: Mapping[str, str]
    applies_to_replay: bool = True


# Id of a claim -> its criterion; filled by `criterion`.
CRITERIA: dict[str, Criterion] = {}
Judge = Callable[..., Finding]


def criterion(
    claim: str,
    variants: Mapping[str, str] = VARIANTS,
    *,
    applies_to_replay: bool = True,
    **arguments: Any,
) -> Callable[[Judge], Judge]:
    """Make a function of results, label and further arguments the criterion of a claim."""

    def register(judge: Judge) -> Judge:
        CRITERIA[claim] = Criterion(partial(judge, **arguments), variants, applies_to_replay)
        return judge

    return register


def at_point(dataset: xr.Dataset, label: str, **point: object) -> xr.Dataset:
    """One method at one point of the grid, without dimensions that have one value."""
    chosen = dataset.sel({"label": label, **point})
    single = [d for d in chosen["status"].dims if chosen.sizes[d] == 1]
    return chosen.squeeze(single, drop=True)


def largest_deviation(point: xr.Dataset, output: str) -> float:
    """Largest error of an output as a share of the full-order signal's range."""
    chosen = point.sel(output=output)
    return float(chosen["max_error"] / chosen["signal_range"])


def not_visible(point: xr.Dataset, outputs: tuple[str, ...], bound: float = VISIBLE) -> Finding:
    """Whether the largest deviation of all named outputs stays below a share of their ranges."""
    worst, where = worst_of({output: largest_deviation(point, output) for output in outputs})
    status = str(point["status"].item())
    seen = f"of {where}" if status == "ok" else f"{status}: {point['message'].item()}"
    text = "largest deviation of an output, as a share of its range"
    return Finding.below(worst, bound, measure=text, reason=seen, valid=status == "ok")


def worst_of(values: Mapping[str, float]) -> tuple[float, str]:
    """Largest value and where it is; missing if any is missing."""
    name = list(values)[int(np.argmax(list(values.values())))]
    return values[name], name


def judged(within: bool | None) -> str:
    """Verdict on a number that is within its bound or not, or can't be compared."""
    return {True: MET, False: MISSED, None: NOT_COMPARABLE}[within]


def scatter(spreads: Mapping[str, float]) -> str:
    """Why times can't be compared, by the spreads of their rounds; empty if they can."""
    wide = [f"{name} {100 * s:.0f} %" for name, s in spreads.items() if not s <= LARGEST_SPREAD]
    if not wide:
        return ""
    return (
        f"the rounds scatter by more than {100 * LARGEST_SPREAD:.0f} % (interquartile range over "
        f"median): {', '.join(wide)}; run again on an idle machine"
    )


def counted(verdicts: Iterable[str]) -> str:
    """How many rows there are of each verdict, as text."""
    number = Counter(verdicts)
    return ", ".join(f"{number[v]} {text}" for v, text in VERDICTS.items() if v in number)
