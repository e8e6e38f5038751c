"""The comparison with the paper as text: a summary, then one table for each model."""

from pathlib import Path

import pandas as pd

from vehiclemor.report.comparison.rows import ALL_MODELS, PARAMETERS, Row
from vehiclemor.report.costs import LEGEND as COSTS
from vehiclemor.report.costs import costs_text
from vehiclemor.report.criteria.finding import INDISTINGUISHABLE, OWN, VISIBLE
from vehiclemor.report.printing import Footnotes, Line, number, table_text, terms, wrapped
from vehiclemor.report.verdicts import (
    LARGEST_SPREAD,
    MET,
    MISSED,
    NOT_COMPARABLE,
    OURS,
    PUBLISHED_START,
    counted,
)

# A column of the printed table -> variants that it shows.
SHOWN = ("default", "literal")
HEADINGS = ("", "bound", *("default", ""), *("literal", ""), "replay")
LEFT = (0, 3, 5)
# Term -> what it means.
LEGEND = {
    "default, literal": "our settings of POD, and the paper's words.  Our defaults differ by model "
    "and were picked after a sweep over all settings on the very runs that are judged here",
    "springs and dampers, hard points": "two design studies of ours, by several reduced models; "
    "cars: as many cars as the reason tells, by one reduced model; all are kept as they were found",
    "bound": f"the published number; {PARAMETERS}.  Of a claim: of our criterion; with a * the "
    f"threshold is our own, since the paper gives none: {100 * VISIBLE:g} % of a signal's range is "
    'visible in a figure (2 mm on a curve 40 mm high; so for "excellent"), '
    f'{100 * INDISTINGUISHABLE:g} % is not ("practically the same")',
    "n/c": "not comparable",
    "start dropped": "ours: judged by nothing, but within or beyond the bound.  The paper doesn't "
    "say how its runs start; the equilibrium stands for it",
    "floor": "RMS error of the best approximation of the coordinates in the same subspaces; an "
    "output can undercut it",
    "replay": "returns the training run and integrates nothing",
    "time": "CPU time, median of interleaved rounds; not comparable with an interquartile range "
    f"above {100 * LARGEST_SPREAD:g} % of the median; time saved is met only where the errors are",
}


def paper_text(rows: pd.DataFrame, folder: Path) -> str:
    """Summary, one table for each model with the reasons as footnotes, and the costs."""
    records = [Row(**record) for record in rows.to_dict("records")]
    models = list(dict.fromkeys(row.model for row in records))
    own = sum(row.verdict == MET and row.threshold_source == OWN for row in records)
    title = f"Comparison with the paper: {counted(row.verdict for row in records)}"
    parts = [
        wrapped(f"{title}.  Of those met, {own} are met by a threshold that is our own (*)."),
        _summary(records, models),
        terms(LEGEND),
    ]
    for model in models:
        notes = Footnotes()
        part = [row for row in records if row.model == model]
        names = dict.fromkeys(row.id for row in part)
        lines = [line for n in names for line in _lines([r for r in part if r.id == n], notes)]
        parts.append(f"{model}\n{table_text(HEADINGS, lines, LEFT)}\n{notes.text()}")
    named = [model for model in models if model != ALL_MODELS]
    parts.append(wrapped(f"{COSTS}.  More: vehiclemor compare MODEL; all reasons: --json."))
    parts += [costs_text(model, folder, brief=True) for model in named]
    return "\n\n".join(parts)


def _summary(rows: list[Row], models: list[str]) -> str:
    """Counts of the verdicts by model, and what is missed."""
    kinds = (MET, MISSED, NOT_COMPARABLE, OURS)
    lines = []
    for model in [*models, "sum"]:
        verdicts = [row.verdict for row in rows if model in (row.model, "sum")]
        lines.append(Line([model, *(str(verdicts.count(kind)) for kind in kinds)]))
    missed = [row for row in rows if row.verdict == MISSED]
    items = [f"Missed, {row.model.replace('_', ' ')}: {_item(row)}" for row in missed]
    found: dict[str, list[str]] = {}
    for row, item in zip(missed, items, strict=True):
        found.setdefault(item, []).append(_found(row))
    text = [wrapped(f"{item} ({', '.join(numbers)})", 2, 4) for item, numbers in found.items()]
    heads = ["", "met", "missed", "not comparable", "ours"]
    return "\n".join([table_text(heads, lines), "", *text])


def _found(row: Row) -> str:
    return f"{row.variant} {number(row.reproduced)} for {number(row.bound)}{_own(row)}"


def _own(row: Row) -> str:
    """Mark of a threshold that is our own."""
    return "*" if row.threshold_source == OWN else ""


def _item(row: Row) -> str:
    return row.item if row.unit in ("1", "-") else f"{row.item}, {row.unit}"


def _lines(rows: list[Row], notes: Footnotes) -> list[Line]:
    """Lines of one number or claim: for each start, and its floor."""
    first = rows[0]
    heading = f"{_item(first)} {notes.marks(first.measure)}".rstrip()
    if not first.variant:
        return [Line([], heading=f"{heading}: n/c {notes.marks(first.reason)}")]
    lines: list[Line] = []
    if not any(row.variant.startswith(SHOWN) for row in rows):
        cells = [[row.variant, number(row.bound) + _own(row), *_cells(row, notes)] for row in rows]
        return [Line([], heading=heading), *(Line([*own, "", "", "-"]) for own in cells)]
    for start in dict.fromkeys(row.start for row in rows):
        found = {row.variant.split(",")[0]: row for row in rows if row.start == start}
        published = start == PUBLISHED_START
        values = [cell for name in SHOWN for cell in _cells(found.get(name), notes)]
        bound = number(first.bound) + _own(first) if published else ""
        replay = number(next(iter(found.values())).replay)
        label = "" if published else f"start {start} (ours)"
        lines.append(Line([label, bound, *values, replay], heading=heading if published else ""))
        floors = [number(found[name].floor) if name in found else "" for name in SHOWN]
        if published and set(floors) - {"-", ""}:
            lines.append(Line(["floor", "", floors[0], "", floors[1]]))
    return lines


def _cells(row: Row | None, notes: Footnotes) -> list[str]:
    """Number and verdict, with a mark for the first reason where it isn't met."""
    if row is None:
        return ["", ""]
    words = {MET: "met", MISSED: "missed", NOT_COMPARABLE: "n/c"}
    word = words.get(row.verdict) or {True: "within", False: "beyond", None: "n/c"}[row.within]
    settings = row.variant.partition(", ")[2] if row.variant.startswith(SHOWN) else ""
    told = [] if settings in ("", *SHOWN) else [f"with {settings}"]
    reason = row.reason.split("; ")[0]
    if not row.within and reason not in (PARAMETERS.split("; ")[0], row.measure):
        told.append(reason)
    return [number(row.reproduced), f"{word} {notes.marks(*told)}".rstrip()]
