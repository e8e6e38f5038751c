"""`vehiclemor leaderboard`: who does best on the protocols that were run."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.cli.table import print_json


def leaderboard(
    *,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    out: Path = api.RESULTS,
) -> int:
    """Rank every contestant of every protocol whose results are stored; nothing is run.

    Ranked by silent misses, misses, then speed-up against the full order at equal error.  Files
    that can't be read are named and left out.

    Parameters
    ----------
    json_output
        Print JSON: all contestants with all that is known of them.
    out
        Results folder.
    """
    from vehiclemor.report.leaderboard import leaderboard as ranked
    from vehiclemor.report.leaderboard import leaderboard_text

    board = ranked(out)
    if json_output:
        print_json(board)
    elif len(board):
        print(leaderboard_text(board.to_dict(orient="records")))
    for path, reason in board.attrs["left_out"].items():
        print(f"left out: {path}: {reason}", file=sys.stderr)
    return 0
