"""Results as frames: a row for each run, of grids and protocols alike, and tables made of them."""

import itertools
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.labels import trained_runs
from vehiclemor.report.printing import ends_text, shown
from vehiclemor.simulation.trajectory import EVALUATIONS, FINISHED

# Kind of the rows of a grid in a comparison, and of what they have the median.
ERRORS = "errors"
MEDIANS = ("seconds", "offline_seconds", "evaluations")


def frame(dataset: xr.Dataset, variables: Iterable[str] = ()) -> pd.DataFrame:
    """A row for each run, in the order of the grid; histories are left out.

    Columns are what varies (factors, parameters, start, label and its method, scenario), then the
    wanted variables, all by default; one with further dimensions has a column for each of their
    values: `rms_error.toe`.
    """
    like, wanted = dataset["status"], set(variables)
    columns: dict[str, np.ndarray] = {}
    for name, rest in sorted(_further(dataset).items(), key=lambda e: e[0] not in dataset.coords):
        if not wanted or name in wanted or name in dataset.coords:
            whole = xr.broadcast(dataset[name], like)[0].transpose(*like.dims, *rest)
            values = whole.values.reshape(like.size, -1)
            names = _names(dataset, name, rest)
            columns |= {column: values[:, place] for place, column in enumerate(names)}
    return pd.DataFrame(columns)


def _further(dataset: xr.Dataset) -> dict[str, list[str]]:
    """Variable of a frame -> its dimensions beyond the runs'."""
    runs = set(dataset["status"].dims)
    found: dict[str, list[str]] = {}
    for name, variable in dataset.variables.items():
        rest = [str(d) for d in variable.dims if d not in runs]
        inside = name not in dataset.coords or (not rest and variable.dims)
        if inside and not {"time", "input"} & set(rest):
            found[str(name)] = rest
    return found


def _names(dataset: xr.Dataset, name: str, rest: list[str]) -> list[str]:
    labels = itertools.product(*(dataset[d].values.astype(str).tolist() for d in rest))
    return [".".join((name, *label)) for label in labels]


def column_meanings(dataset: xr.Dataset) -> pd.DataFrame:
    """Name, unit and meaning of every column of a dataset's frame."""
    rows: list[dict[str, str]] = []
    for name, rest in _further(dataset).items():
        attributes, names = dataset[name].attrs, _names(dataset, name, rest)
        units = [attributes.get("units", "")] * len(names)
        # Of outputs that do not share one unit each has its own.
        if "units" not in attributes and len(rest) == 1 and f"{rest[0]}_unit" in dataset.coords:
            units = dataset[f"{rest[0]}_unit"].values.tolist()
        meaning = str(attributes.get("long_name", ""))
        pairs = zip(names, units, strict=True)
        rows += [{"column": column, "unit": unit, "meaning": meaning} for column, unit in pairs]
    return pd.DataFrame(rows)


def grid_rows(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """A row for each start, method and output of a combined dataset.

    `runs` are different ones; `failures` says how those that have `failed` ended, `reason` why.  Of
    those that have ended there are `median` and `largest` RMS errors over the grid, and at the
    place of the largest that of the best approximation (`floor`).  Seconds (of the compiled loop)
    and evaluations are medians.  `saturates_at` is the largest rank that the training allows, where
    more is asked for; else 0.
    """
    attributes = {key: str(dataset.attrs[key]) for key in ("study", "title", "model", "training")}
    head = {"kind": ERRORS, **attributes, "grid": _grid_text(dataset)}
    count = EVALUATIONS[component("model", head["model"]).kind]
    extended = dataset.assign(trained=trained_runs(dataset), evaluations=dataset[count])
    kept = ["rms_error", "floor_rms_error", "cell_key", "status", "message"]
    runs: Any = frame(extended, [*kept, *MEDIANS, "effective_rank", "warned", "trained"])
    saturated = saturated_ranks(dataset)
    rows: list[dict[str, Any]] = []
    for start, label in itertools.product(dataset["start"].values, dataset["label"].values):
        own = runs[(runs["start"] == start) & (runs["label"] == label)]
        # Points of the grid that a method does not depend on are one run.
        own = own.drop_duplicates("cell_key")
        place = head | {"start": str(start), "label": str(label)} | _counts(own)
        place["saturates_at"] = saturated.get(str(label), 0)
        varied = [str(d) for d in dataset["status"].dims if len(set(own[d])) > 1]
        ended = own[own["status"].isin(FINISHED)]
        for output, unit in dataset["output_unit"].to_series().items():
            about = {"output": str(output), "unit": unit}
            rows.append(place | about | _errors(ended, str(output), varied))
    return rows


def saturated_ranks(dataset: xr.Dataset) -> dict[str, int]:
    """Label -> largest rank of its runs, where the grid asks for more than the training has."""
    wanted = ["effective_rank", "cell_key", "status"]
    if not {"rank", *wanted} <= set(dataset.variables) or "rank" not in dataset["status"].dims:
        return {}
    # A method that has no rank is one run at all ranks.
    runs: Any = frame(dataset, wanted).drop_duplicates(["label", "cell_key"])
    runs = runs[runs["status"].isin(FINISHED)]
    ranks = runs.groupby("label", sort=False)["rank"].agg(["min", "max"])
    reached = runs.groupby("label", sort=False)["effective_rank"].max()
    less = reached[(ranks["min"] < ranks["max"]) & (reached < ranks["max"])]
    return {str(label): int(rank) for label, rank in less.items()}


def _counts(runs: Any) -> dict[str, Any]:
    """How runs have ended, and what they took."""
    failed = runs[~runs["status"].isin(FINISHED)]
    ended = runs.drop(failed.index).astype(dict.fromkeys(MEDIANS, float))
    ends = Counter(map(str, failed["status"])).most_common()
    return {
        "effective_rank": int(runs["effective_rank"].max()),
        "runs": len(runs),
        "failed": len(failed),
        "failures": ", ".join(f"{n} {status}" for status, n in ends),
        "reason": next(iter(failed["message"]), ""),
        **{name: int(runs[name].sum()) for name in ("warned", "trained")},
        **{name: float(ended[name][np.isfinite(ended[name])].median()) for name in MEDIANS},
    }


def _errors(ended: Any, output: str, varied: list[str]) -> dict[str, Any]:
    """Errors of an output in the runs that have ended."""
    errors = ended[f"rms_error.{output}"].astype(float)
    errors = errors[np.isfinite(errors)]
    if errors.empty:
        return {"median": np.nan, "largest": np.nan, "largest_at": "", "floor": np.nan}
    worst, largest = ended.loc[errors.idxmax()], float(errors.max())
    places = [f"{d} {shown(worst[d], '.4g')}" for d in varied]
    return {
        "median": float(errors.median()),
        "largest": largest,
        "largest_at": ", ".join(places) if largest > 0.0 else "",
        "floor": float(worst[f"floor_rms_error.{output}"]),
    }


def _grid_text(dataset: xr.Dataset) -> str:
    """The grid's dimensions with their values, and the ranges of a sample."""
    parts = []
    for name in (d for d in map(str, dataset["status"].dims) if d not in ("label", "start")):
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in dataset[name].values]
        if len(values) > 8:
            parts.append(f"{name} {values[0]} to {values[-1]} ({len(values)})")
        elif values != ["1"]:
            parts.append(f"{name} {', '.join(values)}")
    for name, values in dataset.coords.items():
        if values.dims == ("sample",) and name != "sample":
            parts.append(f"{name} {float(values.min()):.4g} to {float(values.max()):.4g}")
    return "; ".join(parts)


def counted_ends(dataset: xr.Dataset) -> str:
    """How the runs of a study have ended; a run that stands at several points counts once."""
    extended = dataset.assign(trained=trained_runs(dataset))
    runs: Any = frame(extended, ["status", "cell_key", "warned", "trained"])
    # A protocol's runs have no files of their own.
    runs = runs.drop_duplicates("cell_key") if "cell_key" in runs else runs
    trained, warned = int(runs["trained"].sum()), runs["warned"] & (runs["status"] == "ok")
    note = f"; {trained} trained on the tested run" if trained else ""
    return ends_text(runs["status"], int(warned.sum())) + note
