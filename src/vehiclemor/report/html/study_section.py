"""A study on a grid as a section: errors of every cell, figures, paths and errors to look into."""

import json
from functools import partial
from pathlib import Path

import xarray as xr

from vehiclemor.report.errors import counted_ends
from vehiclemor.report.figures.curves import PATH
from vehiclemor.report.figures.result_plot import plot_result
from vehiclemor.report.figures.saving import styled
from vehiclemor.report.html.cells import UNNAMED, stored_cell
from vehiclemor.report.html.interactive import available
from vehiclemor.report.html.parts import Cell, Picture, Section
from vehiclemor.report.html.provenance import facts, name_of, source_text
from vehiclemor.report.html.study_plots import study_plots
from vehiclemor.report.html.study_table import Place, error_table, places
from vehiclemor.report.html.vector import svg_element
from vehiclemor.report.result_selection import drawn
from vehiclemor.study.failure import attempt_apart

PICTURES = {
    "histories": "Outputs over the time, differences from full order below",
    "paths": "Paths in the plane, distances from full order below",
    "errors": "RMS errors",
}


def study_section(dataset: xr.Dataset, folder: Path, left_out: dict[str, str]) -> Section:
    """What a combined dataset of a grid holds; `left_out` is told what can't be drawn."""
    name, definition = name_of(dataset), json.loads(dataset.attrs["configuration"])
    rows = places(dataset)
    table = error_table(dataset, rows)
    linked = {entry.anchor for row in table.rows for entry in row if entry.anchor}
    dims = [str(d) for d in dataset["status"].dims]
    cells = {
        str(row["anchor"]): _cell(row, dims, definition, folder)
        for row in reversed(rows)
        if row["anchor"] in linked
    }
    what = f"Study {dataset.attrs['study']} of {dataset.attrs['model']}"
    size = f"{len(rows)} places of the grid, {len({row['anchor'] for row in rows})} cells"
    plots = partial(study_plots, dataset, name)
    plots = attempt_apart(f"plots of {name}", left_out, plots) if available() else []
    return Section(
        f"study-{name}",
        str(dataset.attrs["title"]),
        [f"{what}, trained on: {definition['training']}. {size}: {counted_ends(dataset)}."],
        [table],
        _pictures(dataset, name, left_out),
        plots[0] if plots else [],
        facts(dataset, cells),
        dict(reversed(cells.items())),
        source_text(dataset, folder),
    )


def _cell(row: Place, dims: list[str], definition: dict, folder: Path) -> Cell:
    entry = next(e for e in definition["methods"] if (e["label"] or e["method"]) == row["method"])
    place = {d: row[d] for d in dims}
    known = {"place": place, "method": entry, "training": definition["training"]}
    kind, _, key = str(row["anchor"]).partition("-")
    if kind == "cell":
        return stored_cell(folder, key, known)
    return Cell(f"place {', '.join(map(str, place.values()))}", known, UNNAMED)


def _pictures(dataset: xr.Dataset, name: str, left_out: dict[str, str]) -> list[Picture]:
    """Every kind of picture that the dataset has the data for; histories from every start."""
    starts = [str(start) for start in dataset["start"].values]
    found: list[Picture] = []
    held = {"histories": bool(dataset.sizes.get("time")), "errors": True}
    held["paths"] = held["histories"] and set(PATH) <= set(dataset["output"].values)
    for kind in filter(held.get, PICTURES):
        for start in starts if kind != "errors" else [""]:
            picture = partial(_picture, dataset, kind, start, f"{name}-{kind}-{len(found)}")
            found += attempt_apart(f"{kind} of {name}", left_out, picture)
    return found


def _picture(dataset: xr.Dataset, kind: str, start: str, name: str) -> Picture:
    part = drawn(dataset, kind, {"start": start} if start else {})[0]
    if kind == "errors":
        part = part.drop_dims([d for d in ("time", "input") if d in part.dims])
    # Of a large study only this is read.
    figure = plot_result(part.load(), None, kind)
    at = figure.get_suptitle().removeprefix(str(dataset.attrs["title"])).strip("; ")
    several = f"start {start}" if start and dataset.sizes["start"] > 1 else ""
    at = ", ".join(filter(None, (at, several)))
    caption = f"{PICTURES[kind]}{f': {at}' if at else ''}."
    figure.suptitle("")
    with styled():
        return Picture(caption, svg_element(figure, name, caption))
