"""Predictive comparison: reduced models on inputs that they have not seen, beside full order."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.report.predictive.paper_terms import paper_terms_rows
from vehiclemor.report.predictive.targets import Row, error_columns, ratio, target_rows
from vehiclemor.study.plans.choice import scores
from vehiclemor.study.plans.protocol import FULL_ORDER
from vehiclemor.study.plans.protocol_file import ProtocolFile
from vehiclemor.study.run import run_studies

STUDY = "predictive"


def predictive_comparison(folder: Path, jobs: int = 1, study: str = STUDY) -> pd.DataFrame:
    """The comparison as a table; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `kind` tells what a row is.  `method`: one contestant on the test set, with the columns of
        `method_rows`.  `outside`: its errors in one scenario outside of the training range.
        `target`: what the winner must reach, with `id`, `bound`, `measured`, `unit`, `verdict`
        (`met`, `missed` or `not_comparable`), `reason` and `threshold_source`.  `paper`: POD at the
        paper's rank and control period, see `paper_terms`.  Errors
        `worst_<measure>_<output>` are in SI units.
    """
    rows: list[Row] = []
    models: list[str] = []
    for dataset in run_studies(study, folder, jobs).values():
        protocol = protocol_of(dataset)
        models.append(protocol.model)
        methods = method_rows(dataset, protocol)
        rows += methods + outside_rows(dataset, protocol)
        rows += target_rows(dataset, protocol, methods)
    if study == STUDY:
        rows += paper_terms_rows(models, folder)
    return pd.DataFrame(rows)


def protocol_of(dataset: xr.Dataset) -> ProtocolFile:
    """The protocol of a combined dataset."""
    return ProtocolFile.model_validate_json(dataset.attrs["configuration"])


def method_rows(dataset: xr.Dataset, protocol: ProtocolFile) -> list[Row]:
    """One row for each contestant, fastest full-order integrators as measures.

    `score` is the largest error of a bounded output as a multiple of its bound (infinite if a run
    has failed), `seconds` the mean of the test scenarios that are ok, with the `spread` of their
    rounds (interquartile range over median).  `ratio_equal_accuracy` is
    against the fastest full-order row whose score is not larger (`equal_accuracy`; if there is
    none, against the most accurate one and `equal_accuracy_reached` is false), `ratio_within`
    against the fastest full-order row within the bounds.  `break_even`: runs after which the
    offline seconds are earned against the first of them.
    """
    test = dataset.isel(scenario=dataset["scenario_set"].values == "test")
    rows: list[Row] = []
    for label in test["row"].values:
        part = test.sel(row=label)
        ok = part["status"].values == "ok"
        score = float(scores(part, protocol.bounds).max())
        row: Row = {
            "kind": "method",
            "model": protocol.model,
            "method": str(label),
            "role": str(part["role"].item()),
            "component": str(part["method"].item()),
            "rank": int(part["effective_rank"]),
            "settings": str(part["settings"].item()),
            "score": score,
            "within_bounds": score <= 1.0,
            "winner": False,
            "stable_share": float(ok.mean()),
            "failure": _failure(part),
            **_errors(part, protocol),
            "validation_score": float(part["validation_score"]),
            "candidates": str(part["validation"].item()),
            "evaluations": _mean(part[dataset.attrs["evaluations"]].values, ok),
            "seconds": _mean(part["seconds"].values, ok),
            "spread": _spread(part, ok),
            "offline_seconds": float(part["offline_seconds"]),
            "offline_evaluations": int(part["offline_evaluations"]),
        }
        rows.append(row)
    full = [row for row in rows if row["role"] == FULL_ORDER and math.isfinite(row["score"])]
    for row in rows:
        row.update(_against(row, full))
    winner = find_winner(rows)
    if winner is not None:
        winner["winner"] = True
    return rows


def _mean(values: np.ndarray, ok: np.ndarray) -> float:
    return float(np.mean(values[ok])) if ok.any() else math.nan


def _spread(part: xr.Dataset, ok: np.ndarray) -> float:
    """Interquartile range of the rounds over their median, of all scenarios together."""
    seconds = _mean(part["seconds"].values, ok)
    width = _mean((part["seconds_upper"] - part["seconds_lower"]).values, ok)
    return width / seconds if seconds > 0.0 else 0.0


def _failure(part: xr.Dataset) -> str:
    """The first failure of a row, empty if there is none."""
    for scenario, status, message in zip(
        part["scenario"].values, part["status"].values, part["message"].values, strict=True
    ):
        if status != "ok":
            return f"{status} in ({scenario}): {message}"
    return ""


def _errors(part: xr.Dataset, protocol: ProtocolFile) -> Row:
    """Worst error by output; of the runs that are ok only, since the others have none."""
    found: Row = {}
    for column, (output, measure) in error_columns(protocol).items():
        values = part[f"{measure}_error"].sel(output=output).values
        finite = values[np.isfinite(values)]
        found[column] = float(finite.max()) if finite.size else math.nan
    return found


def _against(row: Row, full: list[Row]) -> Row:
    """Ratios of a row to full-order rows, and its break-even."""
    accurate = [other for other in full if other["score"] <= row["score"]]
    within = [other for other in full if other["within_bounds"]]
    equal = _fastest(accurate) or min(full, key=lambda o: o["score"], default=None)
    best = _fastest(within)
    saved = equal["seconds"] - row["seconds"] if equal and row["stable_share"] == 1.0 else -1.0
    return {
        "equal_accuracy": equal["method"] if equal else "",
        "equal_accuracy_reached": bool(accurate),
        "ratio_equal_accuracy": ratio(equal, row),
        "within": best["method"] if best else "",
        "ratio_within": ratio(best, row),
        "break_even": row["offline_seconds"] / saved if saved > 0.0 else math.inf,
    }


def _fastest(rows: list[Row]) -> Row | None:
    return min(rows, key=lambda row: row["seconds"], default=None)


def find_winner(rows: list[Row]) -> Row | None:
    """The fastest reduced model within the bounds; if there is none, the most accurate one."""
    racing = [r for r in rows if r["role"] != FULL_ORDER and r["component"] != "replay"]
    within = [row for row in racing if row["within_bounds"] and row["stable_share"] == 1.0]
    if within:
        return _fastest(within)
    return min(racing, key=lambda row: (row["score"], -row["stable_share"]), default=None)


def outside_rows(dataset: xr.Dataset, protocol: ProtocolFile) -> list[Row]:
    """Errors in every scenario outside of the training range, one by one."""
    outside = dataset.isel(scenario=dataset["scenario_set"].values == "outside")
    rows: list[Row] = []
    for label in outside["row"].values:
        for index in range(outside.sizes["scenario"]):
            part = outside.sel(row=label).isel(scenario=[index])
            rows.append(
                {
                    "kind": "outside",
                    "model": protocol.model,
                    "method": str(label),
                    "role": str(part["role"].item()),
                    "scenario": str(part["scenario"].item()),
                    "score": float(scores(part, protocol.bounds).max()),
                    "stable_share": float((part["status"].values == "ok").mean()),
                    "failure": _failure(part),
                    **_errors(part, protocol),
                }
            )
    return rows
