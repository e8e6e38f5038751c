"""Errors of a study as a table: every cell, or of a large grid the least, median and largest."""

from collections.abc import Sequence
from typing import Any

import xarray as xr

from vehiclemor.report.errors import flat, warned_runs
from vehiclemor.report.figures.result_plot import shown_outputs
from vehiclemor.report.html.parts import MISSING, Entry, Table, count, quantity
from vehiclemor.report.html.provenance import name_of
from vehiclemor.report.labels import TRAINED, label_of, method_text, unit_of
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.study_file import PARAMETER

# A table with more rows is summed up.
MOST_ROWS = 200
SCALARS = ("effective_rank", "rhs_calls", "iterations", "steps")
NOTE = "Each number leads to the cell that it comes from, with all that determines it."
SUMMED = (
    "The grid has more places than a page can show: of each method and start the least, the median "
    "and the largest error over the grid, each leading to its cell. All of them stand in the "
    "study's netCDF file."
)
Place = dict[str, Any]


def places(dataset: xr.Dataset) -> list[Place]:
    """Every place of the grid: values, errors, counts, status, and the anchor of its cell."""
    table = flat(dataset, tuple(shown_outputs(dataset)))
    dims = dataset["status"].dims
    for name, values in {"remark": dataset["remark"], "warned": warned_runs(dataset)}.items():
        table[name] = values.transpose(*dims).values.ravel()
    if "cell_key" in dataset:
        keys = dataset["cell_key"].transpose(*dims).values.ravel()
        table["anchor"] = [f"cell-{key}" for key in keys]
    else:
        # Stored before cells were named.
        table["anchor"] = [f"place-{name_of(dataset)}-{n}" for n in range(len(table))]
    for name in sampled(dataset):
        values = dict(zip(dataset["sample"].values, dataset[name].values, strict=True))
        table[name] = [values[sample] for sample in table["sample"]]
    return [{str(k): v for k, v in row.items()} for row in table.to_dict("records")]


def sampled(dataset: xr.Dataset) -> list[str]:
    """What differs between samples, where a study has any."""
    found = {str(name): c for name, c in dataset.coords.items() if c.dims == ("sample",)}
    return [name for name in found if name != "sample"]


def error_table(dataset: xr.Dataset, rows: Sequence[Place]) -> Table:
    """RMS errors of the outputs that the model shows, with links."""
    dims = [str(d) for d in dataset["status"].dims]
    grid = [d for d in dims if d != "method" and dataset.sizes[d] > 1]
    grid += sampled(dataset)
    outputs = {o: _heading(dataset, o) for o in shown_outputs(dataset)}
    return (_every if len(rows) <= MOST_ROWS else _summary)(rows, outputs, grid)


def _heading(dataset: xr.Dataset, output: str) -> str:
    return f"{label_of(output).words}, RMS error ({unit_of(dataset, output)})"


def _every(rows: Sequence[Place], outputs: dict[str, str], grid: list[str]) -> Table:
    """A row for every place."""
    counts = [name for name in SCALARS if name in rows[0]]
    heads = ["method", *grid, *outputs.values(), *counts, "status"]
    entries = []
    for row in rows:
        anchor = str(row["anchor"])
        line = [Entry(method_text(str(row["method"])), anchor=anchor)]
        line += [_coordinate(row[d]) for d in grid]
        line += [quantity(row[f"rms_{output}"], anchor) for output in outputs]
        line += [count(int(row[name]), anchor) for name in counts]
        status = str(row["status"])
        said = row["message"] if status != "ok" else row["remark"] if row["warned"] else ""
        kind = "missed" if status not in FINISHED else "other" if said else "met"
        status += f" ({TRAINED})" if row.get("in_training") else ""
        told = f"{status}: {said}" if said else status
        entries.append([*line, Entry(told, None, anchor, kind)])
    return Table("Every place of the grid", _words(heads), entries, NOTE)


def _summary(rows: Sequence[Place], outputs: dict[str, str], grid: list[str]) -> Table:
    """Least, median and largest errors of each method over the grid."""
    groups: dict[tuple[str, ...], list[Place]] = {}
    by = ["method", *(["start"] if "start" in grid else [])]
    for row in rows:
        groups.setdefault(tuple(str(row[d]) for d in by), []).append(row)
    words = ("least", "median", "largest")
    heads = [*by, "places", "ok", *(f"{h}, {w}" for h in outputs.values() for w in words)]
    entries = []
    for (method, *start), part in groups.items():
        good = [row for row in part if row["status"] == "ok"]
        line = [Entry(method_text(method)), *map(Entry, start), count(len(part)), count(len(good))]
        for output in outputs:
            column = f"rms_{output}"
            ordered = sorted(good, key=lambda row, column=column: float(row[column]))
            chosen = [ordered[i] for i in (0, (len(ordered) - 1) // 2, -1)] if ordered else []
            line += [quantity(r[column], str(r["anchor"])) for r in chosen] or [MISSING] * 3
        entries.append(line)
    return Table("Errors over the grid", _words(heads), entries, SUMMED)


def _words(heads: Sequence[str]) -> tuple[str, ...]:
    return tuple(head.removeprefix(PARAMETER).replace("_", " ") for head in heads)


def _coordinate(value: Any) -> Entry:
    return Entry(value) if isinstance(value, str) else Entry(f"{value:g}", float(value))
