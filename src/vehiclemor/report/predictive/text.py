"""The predictive comparison as text."""

import math

import pandas as pd

from vehiclemor.report.criteria.finding import OWN
from vehiclemor.report.labels import label_of
from vehiclemor.report.predictive.paper_terms import paper_terms_text
from vehiclemor.report.predictive.targets import Row
from vehiclemor.report.printing import Footnotes, Line, fixed, short, table_text, terms, wrapped
from vehiclemor.report.verdicts import LARGEST_SPREAD, NOT_COMPARABLE, counted
from vehiclemor.study.plans.protocol import FULL_ORDER

LEGEND = {
    "score": "largest error of a bounded output in any test scenario, as a multiple of its bound; "
    "valid.: the same in validation, on which alone settings are chosen",
    "us": "CPU time of a run, mean of the test set; off. s: offline; even: runs until that is "
    "earned",
    "x=": "times faster than the fastest full-order row at least as accurate (+: there is none, so "
    "than the most accurate one); xb: than the fastest full-order row within the bounds",
    "errors": "the worst of the test set, RMS, or largest where marked max; SI units; of reduced "
    "models and of what the winner is measured against (all: --json)",
    "outside": "scenarios beyond the training range; inf: the run has failed",
    "bound": "with a * it is our own; n/c: not comparable, since the rounds scatter by more than "
    f"{100 * LARGEST_SPREAD:g} % (interquartile range over median)",
    "*": "the winner",
}


def predictive_text(rows: pd.DataFrame) -> str:
    """All models: summary, targets, methods on the test set, scenarios outside of the training."""
    records: list[Row] = [dict(row) for row in rows.to_dict(orient="records")]
    paper, targets = _of_kind(records, "paper"), _of_kind(records, "target")
    title = "Reduced models on inputs that they have not seen"
    if targets:
        title += f": of their targets {counted(str(row['verdict']) for row in targets)}"
    parts = [wrapped(f"{title}."), terms(LEGEND)]
    records = [row for row in records if row["kind"] != "paper"]
    parts += [
        _model_text(str(model), [row for row in records if row["model"] == model])
        for model in dict.fromkeys(row["model"] for row in records)
    ]
    if paper:
        parts.append(paper_terms_text(paper))
    return "\n\n".join(parts)


def _model_text(model: str, rows: list[Row]) -> str:
    columns, notes = _error_columns(rows), Footnotes()
    methods, outside = _of_kind(rows, "method"), _of_kind(rows, "outside")
    lines = [model, _target_table(_of_kind(rows, "target"), notes)]
    lines += [_method_table(methods, notes), _error_table(methods, columns)]
    lines += [_outside_table(outside, notes), notes.text()]
    return "\n".join(text for text in lines if text)


def _of_kind(rows: list[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _error_columns(rows: list[Row]) -> dict[str, str]:
    """Columns of errors that the model has -> their headings."""
    columns = [column for column in rows[0] if column.startswith("worst_")]
    found: dict[str, str] = {}
    for column in columns:
        if any(not math.isnan(row[column]) for row in rows):
            kind, _, output = column.removeprefix("worst_").partition("_")
            found[column] = label_of(output).short + (" max" if kind == "max" else "")
    return found


def _name(row: Row) -> str:
    return f"{'*' if row['winner'] else ' '} {row['method']}"


def _method_table(rows: list[Row], notes: Footnotes) -> str:
    heads = ["", "rank", "score", "calls", "us", "x=", "xb", "off. s", "even"]
    return table_text(heads, (Line(_costs(row, notes)) for row in rows))


def _costs(row: Row, notes: Footnotes) -> list[str]:
    offline = row["offline_seconds"]
    even = "never" if math.isinf(row["break_even"]) else fixed(row["break_even"], 0)
    share = f"{100 * row['stable_share']:.0f} % of the runs are stable: "
    told = notes.marks(share + row["failure"] if row["failure"] else "")
    cells = [f"{_name(row)} {told}".rstrip(), fixed(row["rank"], 0)]
    cells += [short(row["score"]), fixed(row["evaluations"], 0), fixed(1e6 * row["seconds"], 1)]
    reached = " " if row["equal_accuracy_reached"] else "+"
    cells.append(fixed(row["ratio_equal_accuracy"]) + reached)
    cells.append(fixed(row["ratio_within"]))
    return [*cells, *((short(offline), even) if offline else ("-", "-"))]


def _error_table(rows: list[Row], columns: dict[str, str]) -> str:
    """Errors of reduced models and of what the winner is measured against."""
    against = {row[name] for row in rows if row["winner"] for name in ("equal_accuracy", "within")}
    lines = [
        Line([_name(r), short(r["validation_score"]), *(short(r[column]) for column in columns)])
        for r in rows
        if r["role"] != FULL_ORDER or r["method"] in against
    ]
    return table_text(["  worst errors", "valid.", *columns.values()], lines)


def _outside_table(rows: list[Row], notes: Footnotes) -> str:
    """Scores of reduced models in the scenarios outside of the training range."""
    reduced = [row for row in rows if row["role"] != FULL_ORDER]
    scenarios = list(dict.fromkeys(row["scenario"] for row in reduced))
    if not scenarios:
        return ""
    lines = []
    for method in dict.fromkeys(row["method"] for row in reduced):
        scores = [short(row["score"]) for row in reduced if row["method"] == method]
        lines.append(Line([f"  {method}", *scores]))
    return table_text(["  scores outside", *map(notes.marks, scenarios)], lines)


def _target_table(rows: list[Row], notes: Footnotes) -> str:
    if not rows:
        return ""
    lines = []
    for row in rows:
        own = "*" if row["threshold_source"] == OWN else ""
        verdict = "n/c" if row["verdict"] == NOT_COMPARABLE else row["verdict"]
        cells = [f"  {row['item']}", short(row["bound"]) + own, short(row["measured"])]
        lines.append(Line([*cells, f"{verdict} {notes.marks(row['reason'])}"]))
    return table_text(["target for the winner", "bound", "measured", "verdict"], lines, (0, 3))
