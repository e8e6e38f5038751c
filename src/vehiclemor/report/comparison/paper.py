"""Published beside reproduced: every number, every claim with a criterion, verdict and reason."""

from pathlib import Path

import pandas as pd

from vehiclemor.registry import component, names
from vehiclemor.report.comparison.rows import (
    COLUMNS,
    PARAMETERS,
    Row,
    claim_rows,
    error_rows,
    not_comparable,
)
from vehiclemor.report.comparison.times import slower_row, time_rows
from vehiclemor.report.costs import cost_table, costs_text
from vehiclemor.report.printing import Row as Printed
from vehiclemor.report.printing import table_text
from vehiclemor.report.published import load_published
from vehiclemor.study.run import run_studies

SIX_SLOWER = "dw_fig14_six_slower_than_three"
HEADINGS = ("item", "published", "reproduced", "floor", "replay", "unit", "verdict")
LEGEND = (
    "Published beside reproduced (for a claim, published is the bound of our criterion).",
    "Floor: RMS error of the best approximation of the coordinates; an output can undercut it.",
    f"{PARAMETERS[0].upper()}{PARAMETERS[1:]}.",
)


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """The comparison as a table; studies and timings that are missing are run first.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim and variant of the method (`default`, `literal`),
        with the columns `COLUMNS`.  For a claim `published` is the bound of its criterion.
    """
    results = run_studies("paper", folder, jobs)
    published = load_published()
    numbers = [n for n in published.numbers.values() if n.kind in ("rms_error", "time_reduction")]
    known = [model for model in names("model") if model in {number.model for number in numbers}]
    costs = {model: cost_table(model, folder) for model in known}
    rows: list[Row] = []
    for number in numbers:
        if number.model not in costs:
            reason = "this model is not in the suite yet"
            rows.append(
                not_comparable(number.model, number.item, reason, number.value, number.unit)
            )
        elif number.kind == "rms_error":
            study = component("model", number.model).report.study
            rows += error_rows(number, results[study])
        else:
            rows += time_rows(number, costs[number.model])
    for name, claim in published.claims.items():
        if name == SIX_SLOWER:
            rows.append(slower_row(claim, costs["double_wishbone"], few=3, many=6))
        else:
            rows += claim_rows(name, claim, results)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def paper_text(rows: pd.DataFrame, folder: Path) -> str:
    """All models, how many rows are met, missed and not comparable, and the costs."""
    lines = list(LEGEND)
    for model, part in rows.groupby("model", sort=False):
        printed = [
            Printed(
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
    lines += ["", ", ".join(f"{verdicts.get(v, 0)} {v}" for v in kinds)]
    costs = [costs_text(str(model), folder) for model in dict.fromkeys(rows["model"])]
    return "\n\n".join(["\n".join(lines), *costs])


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"
