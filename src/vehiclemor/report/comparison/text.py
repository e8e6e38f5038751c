"""The comparison with the paper as text, reasons below the numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.report.comparison.row import PARAMETERS
from vehiclemor.report.printing import Row, table_text

if TYPE_CHECKING:
    import pandas as pd

HEADINGS = ("item", "published", "reproduced", "floor", "replay", "unit", "verdict")
LEGEND = (
    "Published beside reproduced (for a claim, published is the bound of our criterion).",
    "Floor: RMS error of the best approximation of the coordinates; an output can undercut it.",
    f"{PARAMETERS[0].upper()}{PARAMETERS[1:]}.",
)


def paper_text(rows: pd.DataFrame) -> str:
    """All models, and how many rows are met, missed and not comparable."""
    lines = list(LEGEND)
    for model, part in rows.groupby("model", sort=False):
        printed = [
            Row(
                [
                    str(row["item"]),
                    *(_number(row[name]) for name in HEADINGS[1:5]),
                    str(row["unit"]),
                    str(row["verdict"]).replace("_", " "),
                ],
                str(row["reason"]).removesuffix(f"; {PARAMETERS}"),
            )
            for row in part.to_dict("records")
        ]
        lines += ["", str(model), table_text(HEADINGS, printed, last_left=True)]
    verdicts = rows["verdict"].value_counts()
    kinds = ("met", "missed", "not_comparable")
    return "\n".join([*lines, "", ", ".join(f"{verdicts.get(v, 0)} {v}" for v in kinds)])


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"
