"""`vehiclemor figures`: the paper's figures from stored results."""

from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.progress import shown_progress
from vehiclemor.errors import InputError


def figures(
    *,
    only: str = "",
    out: Path = api.RESULTS / "figures",
    results: Path = api.RESULTS,
    jobs: int = 1,
) -> int:
    """Regenerate the paper's figures from stored results.

    Parameters
    ----------
    only
        Names of figures, separated by commas: those of the paper, such as 6, or histories-,
        errors-, map- or pareto- and the name of a model.  The paper's by default.
    out
        Folder of the figures.
    results
        Results folder; studies that are missing are run first.
    jobs
        Number of processes for missing studies.
    """
    chosen = [name.strip() for name in only.split(",") if name.strip()]
    if only and not chosen:
        raise InputError(f"--only {only!r} names no figure")
    with shown_progress():
        written = api.figures(chosen, out, results, jobs)
    for path in written:
        print(path)
    return 0
