"""`vehiclemor compare`: numbers side by side, judged."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.exit_status import MISSED
from vehiclemor.cli.progress import shown_progress


def compare(
    what: str = "paper",
    *,
    every: Annotated[bool, Parameter(name="--all", negative="")] = False,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    check: Annotated[bool, Parameter(negative="")] = False,
    out: Path = api.RESULTS,
    jobs: int = 1,
    seed: int | None = None,
) -> int:
    """Set published numbers beside reproduced ones, or the methods of a study side by side.

    Parameters
    ----------
    what
        The comparison: paper (published beside reproduced), predictive (reduced models on inputs
        that they have not seen), the name of a model (every method that fits it), or a study,
        collection or protocol by its name or TOML file.
    every
        Of the comparison with the paper: print every claim with its reason, and the costs.
    json_output
        Print JSON.
    check
        Exit with status 1 if a bound of the paper or a target of a protocol is missed.
    out
        Results folder; studies and timings that are missing are run first.
    jobs
        Number of processes for missing studies.
    seed
        Draws fresh test runs for an audit: of predictive, or of a protocol.
    """
    from vehiclemor.report import comparison, screens
    from vehiclemor.report.printing import json_text

    with shown_progress():
        rows = comparison.compare(what, out, jobs, seed)
    print(json_text(rows) if json_output else screens.comparison_text(what, rows, out, every))
    return MISSED if check and "verdict" in rows and "missed" in set(rows["verdict"]) else 0
