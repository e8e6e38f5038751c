"""`vehiclemor compare`: numbers side by side, judged."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.exit_status import MISSED
from vehiclemor.cli.progress import shown_progress
from vehiclemor.cli.table import print_json


def compare(
    what: str = "paper",
    *,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    out: Path = api.RESULTS,
    jobs: int = 1,
    seed: int | None = None,
) -> int:
    """Set published numbers beside reproduced ones, or the methods of a study side by side.

    Exit status 1 if a bound is missed; what can't be compared, since the machine was too busy or
    the start is ours, counts neither way.

    Parameters
    ----------
    what
        The comparison: paper (published beside reproduced), predictive (reduced models on inputs
        that they have not seen), the name of a model (every method that fits it), or a study,
        collection or protocol by its name or TOML file.
    json_output
        Print JSON.
    out
        Results folder; studies and timings that are missing are run first.
    jobs
        Number of processes for missing studies.
    seed
        Draws fresh test runs for an audit: of predictive, or of a protocol.
    """
    from vehiclemor.report.comparison.kinds import compare as compared
    from vehiclemor.report.comparison.kinds import comparison_text

    with shown_progress():
        rows = compared(what, out, jobs, seed)
    if json_output:
        print_json(rows)
    else:
        print(comparison_text(what, rows, out))
    # A protocol that a model has by default, and a grid, judge nothing.
    judged = what not in api.models() and "verdict" in rows
    return MISSED if judged and "missed" in set(rows["verdict"]) else 0
