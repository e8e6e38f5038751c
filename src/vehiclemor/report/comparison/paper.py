"""Published beside reproduced: every number, every claim with a criterion, verdict and reason."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.registry import component, names
from vehiclemor.report.comparison.claims import claim_rows
from vehiclemor.report.comparison.errors import error_rows
from vehiclemor.report.comparison.row import COLUMNS, Row, not_comparable
from vehiclemor.report.comparison.times import slower_row, time_rows
from vehiclemor.report.costs import cost_table
from vehiclemor.report.published import load_published
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd

SIX_SLOWER = "dw_fig14_six_slower_than_three"


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """The comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    folder
        Results folder.
    jobs
        Number of processes for missing studies.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim and variant of the method (`default`, `literal`),
        with the columns `COLUMNS`.  For a claim `published` is the bound of its criterion.
    """
    import pandas as pd

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
