"""A protocol as a section: what was chosen must reach, all contestants, the worst runs, draws."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from vehiclemor.report.figures.pareto import figure_pareto
from vehiclemor.report.figures.saving import styled
from vehiclemor.report.html.cells import UNNAMED, stored_cell
from vehiclemor.report.html.interactive import available
from vehiclemor.report.html.parts import (
    MISSING,
    Cell,
    Entry,
    Picture,
    Section,
    Table,
    count,
    judged_entry,
    quantity,
)
from vehiclemor.report.html.protocol_plots import runs_plot
from vehiclemor.report.html.provenance import facts, name_of, source_text
from vehiclemor.report.html.vector import svg_element
from vehiclemor.report.labels import label_of, unit_of
from vehiclemor.report.leaderboard import RULE, rank
from vehiclemor.report.predictive.rows import draws_of, method_rows, protocol_of
from vehiclemor.report.predictive.targets import Row, chosen, error_columns, target_rows
from vehiclemor.study.failure import attempt_apart
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.ledger import Drawn
from vehiclemor.study.plans.protocol_file import ProtocolFile
from vehiclemor.study.plans.protocol_results import judged_part, judged_set

# Runs of the chosen model that are listed, the worst first.
WORST_RUNS = 20
COUNTS = ("misses", "silent", "flagged")


def protocol_section(dataset: xr.Dataset, folder: Path, left_out: dict[str, str]) -> Section:
    """What a combined dataset of a protocol holds; `left_out` is told what can't be drawn."""
    name, protocol = name_of(dataset), protocol_of(dataset)
    draws = draws_of(dataset, folder)
    rows = sorted(method_rows(dataset, protocol, draws), key=rank)
    anchors = _anchors(dataset)
    winner = chosen(rows)
    tables = [_targets(target_rows(dataset, protocol, rows), anchors)]
    tables += [_contestants(rows, protocol, dataset, anchors)]
    if winner is not None:
        tables.append(_worst_runs(dataset, protocol, winner, anchors))
    tables.append(_draws([draw for draw in draws if draw.rules == dataset.attrs["rules"]]))
    cells = {anchors[r["method"]]: _cell(r, anchors[r["method"]], dataset, folder) for r in rows}
    caption = "Worst error over its bound on the judged runs, over the time of a whole call."

    def picture() -> Picture:
        with styled():
            svg = svg_element(figure_pareto({name: dataset}), f"{name}-pareto", caption)
        return Picture(caption, svg)

    return Section(
        f"study-{name}",
        str(dataset.attrs["title"]),
        _intro(dataset, rows, winner),
        [table for table in tables if table.rows],
        attempt_apart(f"errors over times of {name}", left_out, picture),
        runs_plot(name, judged_part(dataset), protocol) if available() else [],
        facts(dataset, cells),
        cells,
        source_text(dataset, folder),
    )


def _intro(dataset: xr.Dataset, rows: list[Row], winner: Row | None) -> list[str]:
    runs = f"{len(rows)} contestants on {judged_part(dataset).sizes['scenario']} judged runs of"
    told = [f"Study {dataset.attrs['study']}: {runs} {dataset.attrs['model']}."]
    if winner is not None:
        told.append(
            f"Validation alone has chosen {winner['method']}: {winner['misses']} of "
            f"{winner['runs']} runs outside of a bound, {winner['silent']} of them silent."
        )
    return told


def _anchors(dataset: xr.Dataset) -> dict[str, str]:
    """Label of a row -> anchor of the cell of what is judged."""
    judged = judged_set(set(dataset["scenario_set"].values))
    found = {}
    for number, label in enumerate(map(str, dataset["row"].values)):
        own = f"row-{name_of(dataset)}-{number}"
        if "cell_keys" in dataset:
            own = f"cell-{json.loads(dataset['cell_keys'].values[number])[judged]}"
        found[label] = own
    return found


def _cell(row: Row, anchor: str, dataset: xr.Dataset, folder: Path) -> Cell:
    part = dataset.sel(row=row["method"])
    known = {
        "method": row["component"],
        "settings": json.loads(row["settings"]),
        "role": row["role"],
        "candidates": json.loads(str(part["validation"].item())),
    }
    if anchor.startswith("cell-"):
        return stored_cell(folder, anchor.removeprefix("cell-"), known)
    return Cell(f"{row['method']} on {row['model']}", known, UNNAMED)


def _targets(rows: list[Row], anchors: dict[str, str]) -> Table:
    entries = [
        [
            Entry(row["item"]),
            quantity(row["bound"]),
            quantity(row["measured"], anchors[row["method"]]),
            Entry(row["unit"]),
            judged_entry(row["verdict"]),
            Entry(f"{row['reason']}; bound: {row['threshold_source']}"),
        ]
        for row in rows
    ]
    heads = ("target for what was chosen", "bound", "measured", "unit", "verdict", "why")
    return Table("Verdicts", heads, entries)


def _contestants(
    rows: list[Row], protocol: ProtocolFile, dataset: xr.Dataset, anchors: dict[str, str]
) -> Table:
    columns = error_columns(protocol)
    errors = [
        f"{label_of(output).words}, worst {measure} error ({unit_of(dataset, output)})"
        for output, measure in columns.values()
    ]
    heads = ["contestant", "role", *COUNTS, "worst error / bound", *errors]
    heads += ["whole call (µs)", "loop (µs)", "times faster at equal error", "offline (s)"]
    entries = []
    for row in rows:
        anchor = anchors[row["method"]]
        star = Entry(f"{row['method']}{' (chosen)' if row['winner'] else ''}", anchor=anchor)
        line = [star, Entry(row["role"])]
        line += [count(int(row[name]), anchor) for name in COUNTS]
        line += [quantity(row["score"], anchor)]
        line += [quantity(row[f"worst_{column}"], anchor) for column in columns]
        line += [quantity(1e6 * row.get(c, math.nan), anchor) for c in ("seconds", "loop_seconds")]
        line += [quantity(row["ratio_equal"], anchor), quantity(row["offline_seconds"], anchor)]
        entries.append(line)
    note = (
        "misses: runs outside of a bound; silent: of these with the status ok; flagged: runs of "
        f"which the model says that it has left what it knows. In order: {RULE}."
    )
    return Table("Contestants on the judged runs", tuple(heads), entries, note)


def _worst_runs(
    dataset: xr.Dataset, protocol: ProtocolFile, winner: Row, anchors: dict[str, str]
) -> Table:
    """The runs of the chosen model with the largest errors."""
    part = judged_part(dataset).sel(row=winner["method"])
    found = outcomes(part, protocol.bounds)
    order = np.argsort(-found.scores, kind="stable")[:WORST_RUNS]
    anchor, columns = anchors[winner["method"]], error_columns(protocol)
    heads = ["run", "error / bound"]
    heads += [
        f"{label_of(o).words}, {m} error ({unit_of(dataset, o)})" for o, m in columns.values()
    ]
    entries = []
    for place in order:
        run = part.isel(scenario=int(place))
        line = [Entry(str(run["scenario"].item())), quantity(float(found.scores[place]), anchor)]
        line += [
            quantity(float(run[f"{measure}_error"].sel(output=output)), anchor)
            for output, measure in columns.values()
        ]
        status = str(run["status"].item())
        good = "ok" if not found.missed[place] else "missed"
        entries.append([*line, Entry(status, kind=good)])
    caption = (
        f"The {len(order)} worst of {part.sizes['scenario']} judged runs of {winner['method']}"
    )
    return Table(caption, (*heads, "status"), entries)


def _draws(draws: Sequence[Drawn]) -> Table:
    """All draws under the rules of the one that is shown."""
    heads = ("opened", "seal", "runs", "chosen", *COUNTS)
    entries = []
    for draw in draws:
        label, row = next(((n, r) for n, r in draw.rows.items() if r.winner), ("", None))
        found = [getattr(row, name) if row else None for name in COUNTS]
        told = [MISSING if value is None else count(value) for value in found]
        head = [Entry(draw.date[:10]), Entry(draw.digest[:10]), count(draw.runs), Entry(label)]
        entries.append([*head, *told])
    return Table("Draws of the ledger under the same rules", heads, entries)
