"""A study on a grid as a section: errors of every cell, figures, paths and errors to look into."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from vehiclemor.errors import InputError
from vehiclemor.report.errors import flat
from vehiclemor.report.figures.result_plot import plot_result, shown_outputs
from vehiclemor.report.figures.saving import styled
from vehiclemor.report.html import interactive
from vehiclemor.report.html.cells import stored_cell
from vehiclemor.report.html.parts import Cell, Entry, Picture, Plot, Section, Table, count, quantity
from vehiclemor.report.html.provenance import facts, source_text
from vehiclemor.report.html.vector import svg_element
from vehiclemor.report.labels import label_of, method_text, unit_of
from vehiclemor.report.result_selection import drawn

# A table with more rows than this is summed up.
MOST_ROWS = 150
PICTURES = {
    "histories": "Outputs over the time, and differences from full order below",
    "paths": "Paths in the plane, and distances from full order below",
    "errors": "RMS errors as shares of the outputs' ranges",
}
SCALARS = ("effective_rank", "rhs_calls", "iterations", "steps")


def study_section(dataset: xr.Dataset, folder: Path) -> Section:
    """Everything that a combined dataset of a grid holds, within a bounded size."""
    name = str(dataset.attrs["study"])
    table = _flat(dataset)
    outputs = shown_outputs(dataset)
    grid = [d for d in dataset["status"].dims if d != "method" and dataset.sizes[d] > 1]
    shown = (_every if len(table) <= MOST_ROWS else _summary)(table, dataset, outputs, grid)
    anchors = {e.anchor for row in shown.rows for e in row if e.anchor}
    cells = {a: _cell(row, dataset, folder) for a, row in _rows_of(table) if a in anchors}
    counted = Counter(table["status"])
    ends = ", ".join(f"{n} {status}" for status, n in sorted(counted.items()))
    places = f"{len(table)} grid points of {table['anchor'].nunique()} cells: {ends}."
    definition = json.loads(dataset.attrs["configuration"])
    return Section(
        f"study-{name}",
        str(dataset.attrs["title"]),
        [
            f"Study {name} of {dataset.attrs['model']}, trained on: {definition['training']}.",
            places,
        ],
        [shown],
        _pictures(dataset, name, grid),
        _plots(dataset, name),
        facts(dataset, cells),
        cells,
        source_text(dataset, folder),
    )


def _flat(dataset: xr.Dataset) -> pd.DataFrame:
    """One row for each place, with the anchor of its cell."""
    table = flat(dataset, tuple(map(str, dataset["output"].values)))
    if "cell_key" in dataset:
        dims = dataset["status"].dims
        table["anchor"] = [f"cell-{k}" for k in dataset["cell_key"].transpose(*dims).values.ravel()]
    else:
        # Stored before cells were named.
        table["anchor"] = [f"point-{dataset.attrs['study']}-{n}" for n in range(len(table))]
    return table


def _rows_of(table: pd.DataFrame) -> list[tuple[str, dict[str, Any]]]:
    """Anchor -> first row; a cell may stand at several places."""
    rows = table.drop_duplicates("anchor").to_dict("records")
    return [(str(row["anchor"]), {str(k): v for k, v in row.items()}) for row in rows]


def _cell(row: dict[str, Any], dataset: xr.Dataset, folder: Path) -> Cell:
    definition = json.loads(dataset.attrs["configuration"])
    entry = next(e for e in definition["methods"] if (e["label"] or e["method"]) == row["method"])
    place = {str(d): row[str(d)] for d in dataset["status"].dims}
    known = {"place": place, "method": entry, "training": definition["training"]}
    if str(row["anchor"]).startswith("cell-"):
        return stored_cell(folder, str(row["anchor"]).removeprefix("cell-"), known)
    told = ", ".join(str(v) for v in place.values())
    return Cell(f"point {told}", known, "Stored by an older version, which named no cells.")


def _heading(dataset: xr.Dataset, output: str) -> str:
    return f"{label_of(output).words}, RMS error ({unit_of(dataset, output)})"


def _every(table: pd.DataFrame, dataset: xr.Dataset, outputs: list[str], grid: list[str]) -> Table:
    """A row for every place."""
    counts = [name for name in SCALARS if name in table]
    heads = ["method", *grid, *(_heading(dataset, o) for o in outputs), *counts, "status"]
    rows = []
    for row in table.to_dict("records"):
        anchor = str(row["anchor"])
        entries = [Entry(method_text(str(row["method"])), anchor=anchor)]
        entries += [_place(row[d]) for d in grid]
        entries += [quantity(float(row[f"rms_{o}"]), anchor) for o in outputs]
        entries += [count(int(row[name]), anchor) for name in counts]
        rows.append([*entries, _status(row)])
    return Table("Every cell", tuple(h.replace("_", " ") for h in heads), rows, NOTE)


NOTE = "Each number leads to the cell that it comes from, and to all that determines it."
SUMMED = (
    "The grid has more places than a page can show: of each method and start the least, the median "
    "and the largest error over the grid, each leading to its cell. All of them: vehiclemor table, "
    "or the stored netCDF file."
)


def _place(value: Any) -> Entry:
    return Entry(value) if isinstance(value, str) else Entry(f"{value:g}", float(value))


def _status(row: dict[Any, Any]) -> Entry:
    status = str(row["status"])
    text = status if status == "ok" else f"{status}: {row['message']}"
    return Entry(text, anchor=str(row["anchor"]), kind="ok" if status == "ok" else "missed")


def _summary(
    table: pd.DataFrame, dataset: xr.Dataset, outputs: list[str], grid: list[str]
) -> Table:
    """Least, median and largest errors of each method over the grid."""
    by = ["method", *(["start"] if "start" in grid else [])]
    words = ("least", "median", "largest")
    heads = [*by, "places", "ok", *(f"{_heading(dataset, o)}, {w}" for o in outputs for w in words)]
    rows = []
    for place, part in table.groupby(by, sort=False):
        good = part[part["status"] == "ok"]
        entries = [
            Entry(method_text(str(v)) if d == "method" else str(v))
            for d, v in zip(by, place, strict=True)
        ]
        entries += [count(len(part)), count(len(good))]
        for output in outputs:
            ordered = good.sort_values(f"rms_{output}", kind="stable")
            chosen = (
                [ordered.iloc[i] for i in (0, (len(ordered) - 1) // 2, -1)] if len(ordered) else []
            )
            entries += [quantity(float(r[f"rms_{output}"]), str(r["anchor"])) for r in chosen] or [
                Entry("–")
            ] * 3
        rows.append(entries)
    return Table("Errors over the grid", tuple(h.replace("_", " ") for h in heads), rows, SUMMED)


def _pictures(dataset: xr.Dataset, name: str, grid: list[str]) -> list[Picture]:
    """Every kind of picture that the dataset has the data for."""
    found = []
    starts = dataset["start"].values.tolist() if "start" in grid else [None]
    for kind, words in PICTURES.items():
        for number, start in enumerate(starts if kind != "errors" else [None]):
            try:
                part, point = drawn(dataset, kind, {} if start is None else {"start": start})
                figure = plot_result(part, None, kind)
            except InputError:
                # This study has nothing of that kind.
                continue
            caption = f"{words}{f', at {point}' if point else ''}."
            with styled():
                found.append(
                    Picture(caption, svg_element(figure, f"{name}-{kind}-{number}", caption))
                )
    return found


def _plots(dataset: xr.Dataset, name: str) -> list[Plot]:
    if not interactive.available():
        return []
    found: list[Plot] = []
    if set(interactive.PATH) <= set(dataset["output"].values) and dataset.sizes.get("time"):
        point, _ = drawn(dataset, "paths", {})
        found.append(interactive.path_plot(f"plot-{name}-paths", point))
    return found
