"""One model, whatever it declares: errors of every method, costs, unseen inputs, paper's terms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.models.report import printed_outputs
from vehiclemor.registry import component
from vehiclemor.report.costs import cost_table, costs_text
from vehiclemor.report.default_studies import bounds, nominal, perturbed, unseen
from vehiclemor.report.labels import label_of, unit_of
from vehiclemor.report.predictive.paper_terms import paper_terms_rows
from vehiclemor.report.predictive.rows import predictive_comparison
from vehiclemor.report.predictive.text import predictive_text
from vehiclemor.report.printing import Row, power, table_text, wrapped
from vehiclemor.simulation.build import build
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

LEGEND = (
    "RMS errors in the nominal run, on which the methods are trained (replay is exact there), and "
    "the largest over perturbations of frequency and amplitude by up to 20 %, with the training "
    "unchanged; SI units"
)


def model_comparison(name: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """Every registered method that fits, on one model; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `error`: errors of one output of a method from one start, in
        the nominal run (`rms_error`, `floor`) and the largest over perturbations of the input
        (`perturbed_error`, from the first start), with `range`, `unit` and the `bound` that counts
        as good.  `cost`: as `cost_table`.  The others are those of `predictive_comparison`.
    """
    import pandas as pd

    rows = _error_rows(name, folder, jobs)
    costs = cost_table(name, folder).to_dict("records")
    rows += [{"kind": "cost", "model": name, **row} for row in costs]
    unknown = predictive_comparison(folder, jobs, study=unseen(name, folder))
    rows += unknown.to_dict("records") + paper_terms_rows([name], folder)
    return pd.DataFrame(rows)


def _error_rows(name: str, folder: Path, jobs: int) -> list[dict[str, Any]]:
    nominally = _only(run_studies(nominal(name, folder), folder, jobs))
    elsewhere = _only(run_studies(perturbed(name, folder), folder, jobs))
    limits = bounds(build(name))
    rows: list[dict[str, Any]] = []
    for method in nominally["method"].values:
        for start in nominally["start"].values:
            part = nominally.sel({"method": method, "start": start}).squeeze(drop=True)
            moved = elsewhere["rms_error"].sel({"method": method})
            known = start in elsewhere["start"].values
            for output in part["output"].values:
                point, errors = part.sel(output=output), moved.sel(output=output).values
                rows.append(
                    {
                        "kind": "error",
                        "model": name,
                        "method": str(method),
                        "start": str(start),
                        "status": str(part["status"].item()),
                        "rank": int(part["effective_rank"]),
                        "output": str(output),
                        "unit": unit_of(nominally, output),
                        "rms_error": float(point["rms_error"]),
                        "floor": float(point["floor_rms_error"]),
                        # A run that has failed leaves no error, and then there is no largest one.
                        "perturbed_error": float(np.max(errors)) if known else np.nan,
                        "range": float(point["signal_range"]),
                        "bound": limits.get(str(output), np.nan),
                    }
                )
    return rows


def _only(results: dict[str, xr.Dataset]) -> xr.Dataset:
    (dataset,) = results.values()
    return dataset


def model_text(name: str, rows: pd.DataFrame, folder: Path) -> str:
    """The comparison of a model as text."""
    outputs = printed_outputs(component("model", name))
    heads = ["", "start", "rank"]
    for output in outputs:
        short = label_of(output).short
        heads += [f"{short} nominal", f"{short} perturbed"]
    printed: list[Row] = []
    errors = rows[rows["kind"] == "error"]
    for (method, start), part in errors.groupby(["method", "start"], sort=False):
        by_output = part.set_index("output")
        cells = [str(method), str(start), str(int(part["rank"].iloc[0]))]
        for output in outputs:
            cells += [power(by_output.loc[output, f"{k}_error"]) for k in ("rms", "perturbed")]
        status = str(part["status"].iloc[0])
        printed.append(Row(cells, "" if status == "ok" else status))
    rest = rows[~rows["kind"].isin(("error", "cost"))]
    parts = [f"{name}\n{wrapped(LEGEND)}\n{table_text(heads, printed)}"]
    return "\n\n".join([*parts, costs_text(name, folder), predictive_text(rest)])
