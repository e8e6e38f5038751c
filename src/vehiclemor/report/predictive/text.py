"""The predictive comparison as text."""

import math

import pandas as pd

from vehiclemor.report.labels import label_of
from vehiclemor.report.predictive.paper_terms import paper_terms_text
from vehiclemor.report.predictive.targets import Row
from vehiclemor.report.printing import Row as Printed
from vehiclemor.report.printing import fixed, short, table_text
from vehiclemor.study.plans.protocol import FULL_ORDER

LEGEND = (
    "Score: largest error of a bounded output in any test scenario, as a multiple of its bound.",
    "x=: times faster than the fastest full-order row at least as accurate (+: there is none, so",
    "than the most accurate one); xb: than the fastest full-order row within the bounds.",
    "Errors are the worst of the test set (rms, or max where marked), SI units; even: runs until",
    "the offline cost is earned.  Settings are chosen on the validation set alone.  *: the winner.",
)


def predictive_text(rows: pd.DataFrame) -> str:
    """All models: methods on the test set, scenarios outside of the training range, targets."""
    records: list[Row] = [dict(row) for row in rows.to_dict(orient="records")]
    paper = _of_kind(records, "paper")
    records = [row for row in records if row["kind"] != "paper"]
    lines = ["Reduced models on inputs that they have not seen.", *LEGEND]
    for model in dict.fromkeys(row["model"] for row in records):
        part = [row for row in records if row["model"] == model]
        columns = _error_columns(part)
        methods, outside = _of_kind(part, "method"), _of_kind(part, "outside")
        lines += ["", str(model), _method_table(methods), _error_table(methods, columns)]
        for scenario in dict.fromkeys(row["scenario"] for row in outside):
            lines.append(_outside_table(scenario, outside, columns))
        lines.append(_target_table(_of_kind(part, "target")))
    if paper:
        lines += ["", paper_terms_text(paper)]
    verdicts = [row["verdict"] for row in records]
    lines += ["", ", ".join(f"{verdicts.count(v)} {v}" for v in ("met", "missed"))]
    return "\n".join(lines)


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


def _method_table(rows: list[Row]) -> str:
    heads = ["", "rank", "score", "valid.", "stable", "calls", "us", "x=", "xb", "off. s", "even"]
    return table_text(heads, (Printed(_costs(row), str(row["failure"])) for row in rows))


def _costs(row: Row) -> list[str]:
    offline = row["offline_seconds"]
    even = "never" if math.isinf(row["break_even"]) else fixed(row["break_even"], 0)
    cells = [_name(row), fixed(row["rank"], 0), short(row["score"])]
    cells += [short(row["validation_score"]), f"{100 * row['stable_share']:.0f}%"]
    cells += [fixed(row["evaluations"], 0), fixed(1e6 * row["seconds"], 1)]
    reached = " " if row["equal_accuracy_reached"] else "+"
    cells.append(fixed(row["ratio_equal_accuracy"]) + reached)
    cells.append(fixed(row["ratio_within"]))
    return [*cells, *((short(offline), even) if offline else ("-", "-"))]


def _error_table(rows: list[Row], columns: dict[str, str]) -> str:
    printed = [Printed([_name(row), *(short(row[column]) for column in columns)]) for row in rows]
    return table_text(["worst errors", *columns.values()], printed)


def _outside_table(scenario: str, rows: list[Row], columns: dict[str, str]) -> str:
    """Reduced models in one scenario; full-order rows are in the data, not in print."""
    printed = [
        Printed(
            [f"  {row['method']}", short(row["score"]), *(short(row[c]) for c in columns)],
            str(row["failure"]),
        )
        for row in rows
        if row["scenario"] == scenario and row["role"] != FULL_ORDER
    ]
    return table_text([f"outside: {scenario}", "score", *columns.values()], printed)


def _target_table(rows: list[Row]) -> str:
    printed = [
        Printed(
            [f"  {row['item']}", short(row["bound"]), short(row["measured"]), str(row["verdict"])],
            str(row["reason"]),
        )
        for row in rows
    ]
    heads = ["target for the winner", "bound", "measured", "verdict"]
    return table_text(heads, printed, last_left=True)
