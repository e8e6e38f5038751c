"""Published beside reproduced: every number, every claim with a criterion, verdict and reason."""

from pathlib import Path

import pandas as pd

from vehiclemor.registry import names
from vehiclemor.report.comparison.design import CLAIMS, design_rows
from vehiclemor.report.comparison.rows import (
    COLUMNS,
    Row,
    claim_rows,
    error_rows,
    not_comparable,
)
from vehiclemor.report.comparison.times import agreement_rows, slower_row, time_rows
from vehiclemor.report.costs import cost_table
from vehiclemor.report.default_studies import of_paper
from vehiclemor.report.published import Number, load_published
from vehiclemor.study.run import run_studies

# Claims about times.
SIX_SLOWER, AGREE_AND_SAVE = "dw_fig14_six_slower_than_three", "all_close_agreement_less_time"


def paper_comparison(folder: Path, jobs: int = 1) -> pd.DataFrame:
    """The comparison as a table; studies and timings that are missing are run first.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim, start and variant of the method, with the
        columns `COLUMNS`, described at `rows.Row`.
    """
    results = run_studies("paper", folder, jobs)
    costs = {model: cost_table(model, folder) for model in printed_models()}
    errors: list[Row] = []
    times: list[Row] = []
    unknown: list[Row] = []
    for number in _compared():
        if number.model not in costs:
            unknown.append(not_comparable(number, "this model is not in the suite yet"))
        elif number.kind == "rms_error":
            errors += error_rows(number, results[of_paper(number.model)])
        else:
            times += time_rows(number, costs[number.model])
    claims: list[Row] = []
    for name, claim in load_published().claims.items():
        if name == SIX_SLOWER:
            claims.append(slower_row(claim, costs["double_wishbone"], few=3, many=6))
        elif name == AGREE_AND_SAVE:
            claims += agreement_rows(claim, errors, times)
        elif name in CLAIMS:
            claims += design_rows(claim)
        elif claim.model is None or claim.model in costs:
            claims += claim_rows(claim, results)
    rows = pd.DataFrame([*errors, *times, *unknown, *claims], columns=list(COLUMNS))
    place = {model: number for number, model in enumerate(costs)}
    return rows.sort_values("model", key=lambda c: c.map(place), kind="stable", ignore_index=True)


def _compared() -> list[Number]:
    numbers = load_published().numbers.values()
    return [n for n in numbers if n.kind in ("rms_error", "time_reduction")]


def printed_models() -> list[str]:
    """Models of which the paper prints an error or a time, and that the suite has."""
    models = dict.fromkeys(number.model for number in _compared())
    return [model for model in models if model in names("model")]
