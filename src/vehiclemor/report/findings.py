"""Verdicts: met, missed or not comparable."""

from collections import Counter
from collections.abc import Iterable, Mapping

import xarray as xr

MET, MISSED, NOT_COMPARABLE = "met", "missed", "not_comparable"
VERDICTS = {MET: "met", MISSED: "missed", NOT_COMPARABLE: "not comparable"}
# Interquartile range of the rounds of a timing over their median, above which a time decides
# nothing: half of the runs lie up to a fifth apart.
LARGEST_SPREAD = 0.2
# Curves that agree within this share of the range lie on top of each other: 0.4 mm on a curve that
# is 40 mm high.
INDISTINGUISHABLE = 0.01


def at_point(dataset: xr.Dataset, label: str, **point: object) -> xr.Dataset:
    """One method at one point of the grid, without dimensions that have one value."""
    chosen = dataset.sel({"label": label, **point})
    single = [d for d in chosen["status"].dims if chosen.sizes[d] == 1]
    return chosen.squeeze(single, drop=True)


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
