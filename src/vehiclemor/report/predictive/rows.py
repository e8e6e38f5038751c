"""Predictive comparison: reduced models on inputs that they have not seen, beside full order."""

import json
import math

import numpy as np
import xarray as xr

from vehiclemor.report.predictive.equal_error import at_error
from vehiclemor.report.predictive.targets import (
    Row,
    error_columns,
    ratio,
    target_rows,
    upper_bound,
)
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.protocol import FULL_ORDER
from vehiclemor.study.plans.results import judged_part, judged_set
from vehiclemor.study.plans.study_file import StudyFile

OUTSIDE = ("outside", "drawn_outside")
# Column of seconds -> what is timed.
CLOCKS = {"seconds": "whole call", "loop_seconds": "compiled loop"}


def protocol_rows(dataset: xr.Dataset) -> list[Row]:
    """Rows of one protocol: contestants and targets, as of `compare`."""
    protocol = protocol_of(dataset)
    methods = method_rows(dataset, protocol)
    rows = methods + target_rows(dataset, protocol, methods)
    return [{**row, "study": str(dataset.attrs["study"])} for row in rows]


def protocol_of(dataset: xr.Dataset) -> StudyFile:
    """The protocol of a combined dataset."""
    return StudyFile.model_validate_json(dataset.attrs["configuration"])


def method_rows(dataset: xr.Dataset, protocol: StudyFile) -> list[Row]:
    """One row for each contestant, full-order integrators as measures.

    `runs` of the `test_set` are judged, `apart` ones more are not: the full order is sensitive
    there.  Of the runs `misses` miss a bound, `silent` ones with the status ok; `flagged` are those
    of which the model says that it has left what it knows.  `rate_bound`: largest rate of misses
    that is not excluded at 95 %.
    `score` is the largest error of a bounded output as a multiple of its bound (infinite if a run
    has failed), `seconds` the mean of whole calls, `loop_seconds` of their compiled loops, with the
    `spread` of the rounds (interquartile range over median).  `ratio_equal` and `ratio_equal_loop`
    are against the full order interpolated at the row's own score, `ratio_within` against the
    fastest full-order row within the bounds.  `break_even`: runs after which the offline seconds
    are earned against the first of them.
    """
    part = judged_part(dataset)
    rows = [_method_row(dataset, part, str(label), protocol) for label in part["label"].values]
    full = [row for row in rows if row["role"] == FULL_ORDER and math.isfinite(row["score"])]
    ladders = [
        [row for row in full if row["contestant"] == name]
        for name in dict.fromkeys(row["contestant"] for row in full)
    ]
    for row in rows:
        row.update(_against(row, full, ladders))
    return rows


def _method_row(dataset: xr.Dataset, judged: xr.Dataset, label: str, protocol: StudyFile) -> Row:
    part, bounds = judged.sel(label=label), protocol.bounds
    found = outcomes(part, bounds)
    beyond = np.isin(dataset["scenario_set"].values, OUTSIDE)
    outside = outcomes(dataset.isel(scenario=beyond).sel(label=label), bounds)
    # What has come to its end, trusted or not, is timed.
    ok = np.isfinite(found.scores)
    runs, misses = part.sizes["scenario"], int(found.missed.sum())
    sets = dataset["scenario_set"].values
    of_set = dataset.isel(scenario=sets == judged_set(set(sets)))
    row: Row = {
        "kind": "method",
        "model": protocol.model,
        "label": label,
        "contestant": str(part["series"].item()),
        "role": str(part["role"].item()),
        "method": str(part["method"].item()),
        "rank": int(part["effective_rank"]),
        "settings": str(part["settings"].item()),
        "bounds": json.dumps({o: (b.bound, b.reason) for o, b in bounds.items()}),
        "winner": bool(part["winner"]),
        "test_set": str(dataset.attrs["test_set"]),
        "runs": runs,
        "apart": int((of_set["apart"].values != "").sum()),
        "misses": misses,
        "silent": int(found.silent.sum()),
        "flagged": int(found.flagged.sum()),
        "flagged_misses": int((found.missed & ~found.silent).sum()),
        "rate_bound": upper_bound(misses, runs),
        "score": float(found.scores.max()),
        "within_bounds": misses == 0,
        "stable_share": float(ok.mean()),
        "failure": _failure(part),
        "outside_runs": len(outside.scores),
        "outside_misses": int(outside.missed.sum()),
        "outside_silent": int(outside.silent.sum()),
        "outside_flagged": int(outside.flagged.sum()),
        **_errors(part, protocol),
        "validation_score": float(part["validation_score"]),
        "candidates": str(part["validation"].item()),
        "evaluations": _mean(part[dataset.attrs["evaluations"]].values, ok),
        "spread": _spread(part),
        "offline_seconds": float(part["offline_seconds"]),
        "offline_evaluations": int(part["offline_evaluations"]),
    }
    return row | {clock: _mean_time(part, clock) for clock in CLOCKS if clock in part}


def _mean(values: np.ndarray, ok: np.ndarray) -> float:
    return float(np.mean(values[ok])) if ok.any() else math.nan


def _mean_time(part: xr.Dataset, name: str) -> float:
    """Mean over the runs that were timed."""
    values = part[name].values
    return _mean(values, np.isfinite(values))


def _spread(part: xr.Dataset) -> float:
    """Interquartile range of the rounds over their median, of all scenarios together."""
    seconds = _mean_time(part, "seconds")
    width = _mean_time(part, "seconds_upper") - _mean_time(part, "seconds_lower")
    return width / seconds if seconds > 0.0 else 0.0


def _failure(part: xr.Dataset) -> str:
    """The first failure of a row, empty if there is none."""
    failed = ~np.isin(part["status"].values, FINISHED)
    if not failed.any():
        return ""
    run = part.isel(scenario=int(failed.argmax()))
    return f"{run['status'].item()} in ({run['scenario'].item()}): {run['message'].item()}"


def _errors(part: xr.Dataset, protocol: StudyFile) -> Row:
    """Worst and 99 % errors by output, of the runs that have come to their end."""
    found: Row = {}
    for name, (output, measure) in error_columns(protocol).items():
        values = part[f"{measure}_error"].sel(output=output).values
        finite = values[np.isfinite(values)]
        for word, share in (("worst", 1.0), ("most", 0.99)):
            value = float(np.quantile(finite, share)) if finite.size else math.nan
            found[f"{word}_{name}"] = value
    return found


def _against(row: Row, full: list[Row], ladders: list[list[Row]]) -> Row:
    """Ratios of a row to the full order, and its break-even."""
    within = [other for other in full if other["within_bounds"]]
    best = min(within, key=lambda other: other["seconds"], default=None)
    equal = {clock: at_error(ladders, row["score"], clock) for clock in CLOCKS if clock in row}
    # A recording that is played again is no solution of anything.
    solves = row["method"] != "replay"
    ratios = {c: e.seconds / row[c] if solves and row[c] else math.nan for c, e in equal.items()}
    saved = equal["seconds"].seconds - row["seconds"]
    return {
        "equal_rows": ", ".join(equal["seconds"].rows),
        "ratio_equal": ratios["seconds"],
        "ratio_equal_loop": ratios.get("loop_seconds", math.nan),
        "within": best["label"] if best else "",
        "ratio_within": ratio(best, row),
        "break_even": row["offline_seconds"] / saved if saved > 0.0 else math.inf,
    }
