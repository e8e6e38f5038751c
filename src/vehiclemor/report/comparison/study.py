"""Any study: errors of its methods over its grid; protocols and collections by their members."""

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.errors import warned_runs
from vehiclemor.report.labels import label_of, trained_runs
from vehiclemor.report.predictive.rows import protocol_rows
from vehiclemor.report.predictive.text import predictive_text
from vehiclemor.report.printing import (
    Footnotes,
    Line,
    fixed,
    power,
    short,
    table_text,
    terms,
    wrapped,
)
from vehiclemor.report.shown import main_outputs
from vehiclemor.simulation.trajectory import EVALUATIONS, FINISHED
from vehiclemor.study.plans.study_file import PARAMETER
from vehiclemor.study.run import run_studies

Row = dict[str, Any]
KIND = "errors"
# Places of the grid that stand in a column; longer ones are below the table.
LONGEST = 28
LEGEND = {
    "median, largest": "RMS errors of the runs of a method that have come to their end, over the "
    "grid, SI units; at: where in the grid the largest is",
    "floor": "RMS error of the best approximation of the coordinates in the same subspaces, at "
    "that place; -: exactly zero, or none",
    "failed": "of all runs; what is repeated in the grid, since it does not depend on a setting, "
    "counts once; warned: runs that the method, or a protocol, would not trust",
    "us": "CPU time of the compiled loop by its own account, median of the runs, each measured "
    "once beside whatever else ran: it orders methods, and costs are in vehiclemor compare MODEL; "
    "off.: offline, s, training and fit",
}


def study_comparison(
    study: str, folder: Path, jobs: int = 1, seed: int | None = None
) -> pd.DataFrame:
    """A study, all members of a collection, or a protocol; what is missing is run first.

    Returns
    -------
    pandas.DataFrame
        `study` and `kind` tell what a row is.  `errors`: an output of one method from one start
        over a study's grid, see `grid_rows`.  The others are those of `predictive_comparison`.
    """
    rows: list[Row] = []
    for dataset in run_studies(study, folder, jobs, seed=seed).values():
        rows += protocol_rows(dataset) if "scenario_set" in dataset.coords else grid_rows(dataset)
    return pd.DataFrame(rows)


def grid_rows(dataset: xr.Dataset) -> list[Row]:
    """A row for each method, start and output of a combined dataset.

    `runs` are different ones, `failures` says how those that have `failed` ended, `warned` counts
    those that aren't trusted (`warned_runs`), `trained` those that the method was trained on; of
    those that have ended
    `median` and `largest` are RMS errors over the grid, `largest_deviation` is at one time;
    `largest_at` is the place of the largest RMS error, `floor` that of the best approximation
    there.  `seconds` (of the compiled loop), `offline_seconds` and `evaluations` are medians.
    """
    head = {
        "kind": KIND,
        "study": str(dataset.attrs["study"]),
        "title": str(dataset.attrs["title"]),
        "model": str(dataset.attrs["model"]),
        "training": str(dataset.attrs["training"]),
        "grid": _grid_words(dataset),
    }
    count = EVALUATIONS[component("model", head["model"]).kind]
    errors = ["rms_error", "max_error", "floor_rms_error"]
    told = {"warned": warned_runs(dataset), "trained": trained_runs(dataset)}
    kept = [*errors, "cell_key", "status", "seconds", "offline_seconds", count, *told]
    small = dataset.assign(told)[kept].load()
    rows: list[Row] = []
    for start in dataset["start"].values:
        for method in small["label"].values:
            part = _different(small.sel(start=start, label=method))
            place = {**head, "start": str(start), "label": str(method)}
            rows += [place | row for row in _rows_of_method(part, count)]
    return rows


def _grid_words(dataset: xr.Dataset) -> str:
    """The grid's dimensions with their values."""
    words = []
    for name in map(str, dataset["status"].dims):
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in dataset[name].values]
        if name not in ("label", "start") and (len(values) > 1 or values != ["1"]):
            every = ", ".join(values) if len(values) <= 8 else f"{values[0]} to {values[-1]}"
            words.append(f"{name} {every}" + (f" ({len(values)})" if len(values) > 8 else ""))
    for name, values in dataset.coords.items():
        if values.dims == ("sample",) and name != "sample":
            words.append(f"{name} {float(values.min()):.4g} to {float(values.max()):.4g}")
    return "; ".join(words)


def _different(part: xr.Dataset) -> xr.Dataset:
    """Without dimensions of the grid that a method's runs do not depend on."""
    for name in part["status"].dims:
        first = part.isel({name: 0})
        if bool((part["cell_key"] == first["cell_key"]).all()):
            part = first.drop_vars(str(name))
    return part


def _rows_of_method(part: xr.Dataset, count: str) -> list[Row]:
    """One method from one start: a row for each output."""
    status = part["status"].values
    ended = np.isin(status, FINISHED)
    failures = Counter(str(s) for s in status[~ended].ravel())
    common: Row = {
        "runs": status.size,
        "failed": failures.total(),
        "failures": ", ".join(f"{n} {name}" for name, n in failures.most_common()),
        **{name: int(part[name].sum()) for name in ("warned", "trained")},
        **{name: _median(part[name].values[ended]) for name in ("seconds", "offline_seconds")},
        "evaluations": _median(part[count].values[ended]),
    }
    rows = []
    for output, unit in zip(part["output"].values, part["output_unit"].values, strict=True):
        chosen = part.sel(output=output)
        errors = np.where(ended, chosen["rms_error"].values, np.nan)
        row = {"output": str(output), "unit": str(unit), **common, "median": _median(errors)}
        row |= {"largest": math.nan, "largest_deviation": math.nan, "largest_at": ""}
        row["floor"] = math.nan
        if np.isfinite(errors).any():
            place = np.unravel_index(np.nanargmax(errors), errors.shape)
            dims = part["status"].dims
            at = [f"{d} {_value(part[d].values[i])}" for d, i in zip(dims, place, strict=True)]
            row["largest"] = float(errors[place])
            row["largest_deviation"] = float(np.max(chosen["max_error"].values[ended]))
            row["largest_at"] = ", ".join(at) if errors[place] > 0.0 else ""
            row["floor"] = float(chosen["floor_rms_error"].values[place])
        rows.append(row)
    return rows


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else math.nan


def study_text(rows: pd.DataFrame) -> str:
    """All studies one below the other: their errors, then what their runs took."""
    records: list[Row] = [dict(row) for row in rows.to_dict(orient="records")]
    grids = [row for row in records if row["kind"] == KIND]
    parts = [terms(LEGEND)] if grids else []
    studies = dict.fromkeys(row["study"] for row in grids)
    parts += [_grid_text([row for row in grids if row["study"] == study]) for study in studies]
    rest = rows.loc[rows["kind"] != KIND]
    return "\n\n".join([*parts, *([predictive_text(rest)] if len(rest) else [])])


def _grid_text(rows: list[Row]) -> str:
    """One study: a block for each start and output that the model shows, then costs."""
    first = rows[0]
    shown = main_outputs(component("model", first["model"]))
    starts, notes = list(dict.fromkeys(row["start"] for row in rows)), Footnotes()
    head = f"{first['study']}: {first['title']}"
    about = f"{first['model']}, training {first['training']}"
    about += f"; {first['grid']}" if first["grid"] else ""
    errors: list[Line] = []
    costs: list[Line] = []
    for start in starts:
        from_start = f"start {start}: " if len(starts) > 1 else ""
        part = [row for row in rows if row["start"] == start]
        for output in shown:
            found = [row for row in part if row["output"] == output]
            heading = f"{from_start}{label_of(output).words}, {found[0]['unit']}"
            cells = [_error_cells(row, notes) for row in found]
            errors += [Line(row, heading="" if i else heading) for i, row in enumerate(cells)]
        found = [row for row in part if row["output"] == shown[0]]
        costs += [
            Line(_cost_cells(row), heading="" if i else from_start.removesuffix(": "))
            for i, row in enumerate(found)
        ]
    tables = [
        table_text(["", "median", "largest", "floor", "at"], errors, (0, 4)),
        table_text(["", "runs", "failed", "warned", "evaluations", "us", "off."], costs),
    ]
    parts = [wrapped(head), wrapped(about, 2, 2), tables[0], notes.text(), tables[1]]
    return "\n".join(filter(None, parts))


def _error_cells(row: Row, notes: Footnotes) -> list[str]:
    trained = f"trained on {row['trained']:.0f} of its {row['runs']:.0f} runs"
    name = f"  {row['label']} {notes.marks(trained if row['trained'] else '')}".rstrip()
    cells = [name, *(power(row[name]) for name in ("median", "largest", "floor"))]
    lost = f"{row['failed']:.0f} failed" if row["failed"] else ""
    place = row["largest_at"].replace(PARAMETER, "")
    place = place if len(place) <= LONGEST else notes.marks(place)
    return [*cells, "; ".join(filter(None, (place, lost)))]


def _cost_cells(row: Row) -> list[str]:
    cells = [f"  {row['label']}", f"{row['runs']:.0f}", row["failures"] or "0"]
    cells += [f"{row['warned']:.0f}", fixed(row["evaluations"], 0), fixed(1e6 * row["seconds"], 1)]
    return [*cells, short(row["offline_seconds"]) if row["offline_seconds"] else "-"]
