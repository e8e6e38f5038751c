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
    style: str = "",
    dpi: int | None = None,
) -> int:
    """Regenerate the paper's figures from stored results.

    Parameters
    ----------
    only
        Names of figures, separated by commas: those of the paper, such as 6, or histories-,
        errors-, map- or pareto- and the name of a model.  All by default, but Pareto figures only
        where their study is stored.
    out
        Folder of the figures.
    results
        Results folder; studies that are missing are run first.
    jobs
        Number of processes for missing studies.
    style
        Name or file of a Matplotlib style on top of the package's.
    dpi
        Dots an inch of PNG files; 200 by default.
    """
    chosen = [name.strip() for name in only.split(",") if name.strip()]
    if only and not chosen:
        raise InputError(f"--only {only!r} names no figure")
    with shown_progress():
        written = api.figures(chosen, out, results, jobs, style=style, dpi=dpi)
    for path in written:
        print(path)
    from vehiclemor.report.regenerate import left_out

    missing = {} if chosen else left_out(results)
    if missing:
        made = "vehiclemor run predictive makes their studies"
        print(f"left out: {', '.join(missing)} ({made})")
    return 0
