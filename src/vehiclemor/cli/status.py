"""`vehiclemor status`: how far a study is."""

from collections import Counter
from pathlib import Path

from vehiclemor import api
from vehiclemor.report.printing import ends_text, wrapped

# Reasons that are printed of each study.
REASONS = 10


def status(study: str, *, out: Path = api.RESULTS) -> None:
    """Tell how far a study is, without computing anything.

    Parameters
    ----------
    study
        Name of a study or collection, or a TOML file.
    out
        Results folder.
    """
    for name, found in api.status(study, out).items():
        text = f"{name}: {found.done} of {found.cells} cells done"
        if found.to_do:
            known = found.seconds_left == found.seconds_left
            left = f"about {found.seconds_left:.3g} s in one process" if known else "time unknown"
            text += f", {found.to_do} to do ({left})"
        text += f", {found.later}" if found.later and not found.result else ""
        if found.ends:
            text += f"; {ends_text(kind for kind, _ in found.ends.elements())}"
        combined = found.result or "not combined yet"
        older = " is older" if found.result and found.to_do else ""
        print(wrapped(f"{text}; {combined}{older}", 0, 2))
        print_reasons(found.failed)


def print_reasons(failed: Counter[tuple[str, str]]) -> None:
    """Print why runs have failed, the most frequent reasons first."""
    found = failed.most_common()
    for (kind, message), runs in found[:REASONS]:
        again = ", tried again by the next run" if kind == "error" else ""
        print(wrapped(f"{runs} {kind}{again}: {message}", 2, 4))
    if len(found) > REASONS:
        rest = sum(runs for _, runs in found[REASONS:])
        print(f"  {rest} for {len(found) - REASONS} other reasons")
