"""What a comparison says of a row, and when measured times can be compared at all."""

from collections.abc import Iterable, Mapping

MET, MISSED, NOT_COMPARABLE, OURS = "met", "missed", "not_comparable", "ours"
VERDICTS = {
    MET: "met",
    MISSED: "missed",
    NOT_COMPARABLE: "not comparable",
    OURS: "not judged (start added by us)",
}
# The only start that what is published is judged by; the paper says nothing of another.
PUBLISHED_START = "equilibrium"
# Interquartile range of the rounds of a timing over their median, above which a time decides
# nothing: half of the runs lie up to a fifth apart.
LARGEST_SPREAD = 0.2


def judged(met: bool, start: str = PUBLISHED_START) -> str:
    """Verdict on a number that is within its bound or not."""
    if start != PUBLISHED_START:
        return OURS
    return MET if met else MISSED


def scatter(spreads: Mapping[str, float]) -> str:
    """Why times can't be compared, empty if they can.

    Parameters
    ----------
    spreads
        What was timed -> interquartile range of its rounds over their median.
    """
    wide = [f"{name} {100 * s:.0f} %" for name, s in spreads.items() if not s <= LARGEST_SPREAD]
    if not wide:
        return ""
    return (
        f"the rounds scatter by more than {100 * LARGEST_SPREAD:.0f} % (interquartile range over "
        f"median): {', '.join(wide)}; run again on an idle machine"
    )


def counted(verdicts: Iterable[str]) -> str:
    """How many rows there are of each verdict, in words."""
    found = list(verdicts)
    return ", ".join(f"{found.count(v)} {words}" for v, words in VERDICTS.items() if v in found)
