"""`vehiclemor figures`: the paper's figures, and those of any study, from stored results."""

import sys
from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.exit_status import FAILED
from vehiclemor.cli.progress import shown_progress
from vehiclemor.errors import InputError


def figures(
    *,
    only: str | None = None,
    out: Path = api.RESULTS / "figures",
    results: Path = api.RESULTS,
    jobs: int = 1,
    style: str = "",
    dpi: int | None = None,
) -> int:
    """Draw the paper's figures, or those of any study, from stored results.

    Parameters
    ----------
    only
        Names of figures, separated by commas: those of the paper, such as 6, or histories-,
        errors-, map- or pareto- and the name of a model; or a study, collection or protocol by name
        or TOML file, of which is drawn what its dimensions ask for.  The paper's by default, but
        Pareto figures only where their study is stored.
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
    chosen = [name.strip() for name in (only or "").split(",") if name.strip()]
    if only is not None and not chosen:
        raise InputError(f"--only {only!r} names no figure")
    from vehiclemor.report import regenerate

    failed: dict[str, str] = {}
    with shown_progress():
        written = regenerate.figures(
            chosen, out, results, jobs, style=style, dpi=dpi, failed=failed
        )
    for path in written:
        print(path)
    for name, why in failed.items():
        print(f"figure {name} can't be drawn: {why}", file=sys.stderr)
    missing = {} if chosen else regenerate.left_out(results)
    if missing:
        made = "vehiclemor run predictive makes their studies"
        print(f"left out: {', '.join(missing)} ({made})")
    return FAILED if failed else 0
