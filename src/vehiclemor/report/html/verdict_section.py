"""The comparison with the paper as a section: verdicts, and what its models cost."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.comparison.paper import paper_rows
from vehiclemor.report.comparison.rows import from_start
from vehiclemor.report.costs import LEGEND, cost_rows
from vehiclemor.report.criteria import CRITERIA, VARIANTS, variants
from vehiclemor.report.html.parts import Cell, Entry, Section, Table, judged_entry, quantity
from vehiclemor.report.html.provenance import facts, name_of
from vehiclemor.report.published import Published, load_published
from vehiclemor.report.verdicts import counted

HEADS = ("item", "verdict", "variant", "start", "published", "bound", "reproduced", "unit", "why")
INTRO = (
    "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390: every printed number and claim beside "
    "what is reproduced. A number leads to its cell, a time to what was timed, the number of a "
    "claim to the first study that it follows from."
)
Studies = Mapping[str, xr.Dataset]


def verdict_section(results: Studies, timings: Studies) -> Section:
    """Verdicts on what the paper prints, from its studies and the timings of its models."""
    costs = {model: cost_rows(model, data) for model, data in timings.items()}
    rows = [dict(row) for row in paper_rows(results, costs).to_dict("records")]
    published = load_published()
    tables: dict[str, Table] = {}
    for row in rows:
        caption = f"Verdicts: {str(row['model']).replace('_', ' ')}"
        table = tables.setdefault(caption, Table(caption, HEADS, []))
        table.rows.append(_entries(row, _origin(row, published, results)))
    told = counted(str(row["verdict"]) for row in rows)
    models = ", ".join(timings)
    first = next(iter(timings.values()))
    return Section(
        "comparison-paper",
        "Published beside reproduced",
        [INTRO, f"{len(rows)} rows: {told}."],
        [*tables.values(), *(_cost_table(m, table) for m, table in costs.items())],
        [],
        [],
        {"times of": models} | facts(first, {}),
        {a: c for model in timings for a, c in _cases(model).items()},
    )


def _entries(row: dict[str, Any], origin: tuple[str, str]) -> list[Entry]:
    anchor, studies = origin
    why = "; ".join(filter(None, (row["measure"], row["reason"], studies)))
    return [
        Entry(row["item"]),
        judged_entry(row["verdict"]),
        Entry(row["variant"]),
        Entry(row["start"]),
        quantity(row["published"]),
        quantity(row["bound"]),
        quantity(row["reproduced"], anchor),
        Entry(row["unit"]),
        Entry(why),
    ]


def _origin(row: dict[str, Any], published: Published, results: Studies) -> tuple[str, str]:
    """Anchor of what a row's number comes from, and the studies that a claim follows from."""
    name, number = row["id"], published.numbers.get(row["id"])
    if number is None:
        if name not in CRITERIA:
            return "", ""
        asked = _Asked(from_start(results, row["start"]))
        CRITERIA[name](asked, next(iter(variants(name))))
        if not asked.names:
            return "", "from the training runs alone"
        return (
            f"study-{name_of(results[asked.names[0]])}",
            f"from {', '.join(dict.fromkeys(asked.names))}",
        )
    if number.kind == "time_reduction":
        return f"costs-{number.model}", ""
    label = next((label for label, text in VARIANTS.items() if text == row["variant"]), "")
    dataset = results.get(component("model", number.model).report.study)
    if dataset is None or not label:
        return "", ""
    place = {"rank": number.states, "start": row["start"], "method": label}
    return f"cell-{dataset['cell_key'].sel(place).item()}", ""


class _Asked(dict[str, xr.Dataset]):
    """Studies that tell which of them were asked for."""

    def __init__(self, found: Studies) -> None:
        super().__init__(found)
        self.names: list[str] = []

    def __getitem__(self, name: str) -> xr.Dataset:
        self.names.append(name)
        return super().__getitem__(name)


def _cases(model: str) -> dict[str, Cell]:
    cases = component("model", model).shown.timing
    return {
        f"case-{model}-{case.id}": Cell(f"timed on {model}: {case.label}", _plain(asdict(case)))
        for case in cases
    }


def _plain(case: dict[str, Any]) -> dict[str, Any]:
    return case | {"settings": dict(case["settings"])}


def _cost_table(model: str, table: pd.DataFrame) -> Table:
    """Times of all timing cases of a model, with what they were measured against."""
    baseline, strongest = component("model", model).shown.baselines
    heads = ("case", "start", "CPU time (µs)", "±%", "x1", "x2", "offline (µs)", "status")
    entries = []
    for row in table.to_dict("records"):
        anchor = f"case-{model}-{row['case']}"
        values = [row["us_per_run"], 50.0 * row["quartile_spread"]]
        values += [row["speed_up"], row["speed_up_strongest"], row["offline_us"]]
        line = [Entry(str(row["label"]), anchor=anchor), Entry(str(row["start"]))]
        line += [quantity(float(value), anchor) for value in values]
        good = "met" if row["status"] == "ok" else "missed"
        entries.append([*line, Entry(str(row["status"]), kind=good)])
    note = f"{LEGEND}. x1: speed-up against {baseline}; x2: against {strongest}."
    return Table(f"Costs on {model.replace('_', ' ')}", heads, entries, note, f"costs-{model}")
