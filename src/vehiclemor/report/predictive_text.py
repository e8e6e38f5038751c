"""The predictive comparison as text."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

from vehiclemor.report.paper_terms import printed_terms

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]
SHORT = {
    "lateral_position": "Y",
    "lateral_speed": "v_y",
    "vertical_speed": "v_z",
    "spindle_x": "x",
    "spindle_y": "y",
    "second_euler_angle": "angle",
}
LEGEND = (
    "Score: largest error of a bounded output in any test scenario, as a multiple of its bound.",
    "x=: times faster than the fastest full-order row at least as accurate (+: there is none, so",
    "than the most accurate one); xb: than the fastest full-order row within the bounds.",
    "Errors are the worst of the test set (rms, or max where marked), SI units; even: runs until",
    "the offline cost is earned.  Settings are chosen on the validation set alone.  *: the winner.",
)


def printed(rows: pd.DataFrame) -> str:
    """All models: methods on the test set, scenarios outside of the training range, targets."""
    records: list[Row] = [dict(row) for row in rows.to_dict(orient="records")]
    paper = _of_kind(records, "paper")
    records = [row for row in records if row["kind"] != "paper"]
    lines = ["Reduced models on inputs that they have not seen.", *LEGEND]
    for model in dict.fromkeys(row["model"] for row in records):
        part = [row for row in records if row["model"] == model]
        columns = _error_columns(part)
        lines += ["", str(model), *_methods(_of_kind(part, "method"), columns)]
        lines += _outside(_of_kind(part, "outside"), columns)
        lines += _targets(_of_kind(part, "target"))
    lines += printed_terms(paper) if paper else []
    verdicts = [row["verdict"] for row in records]
    lines += ["", ", ".join(f"{verdicts.count(v)} {v}" for v in ("met", "missed"))]
    return "\n".join(lines)


def _of_kind(rows: list[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _error_columns(rows: list[Row]) -> list[str]:
    """Columns of errors that the model has."""
    columns = [column for column in rows[0] if column.startswith("worst_")]
    return [c for c in columns if any(not math.isnan(row[c]) for row in rows)]


def _heading(column: str) -> str:
    measure, _, output = column.removeprefix("worst_").partition("_")
    return SHORT.get(output, output) + (" max" if measure == "max" else "")


def _methods(rows: list[Row], columns: list[str]) -> list[str]:
    head = f"  {'':<24}{'rank':>5}{'score':>9}{'valid.':>9}{'stable':>7}"
    head += "".join(f"{_heading(column):>9}" for column in columns)
    lines = [f"{head}{'calls':>8}{'us':>9}{'x=':>8}{'xb':>7}{'off. s':>8}{'even':>8}"]
    for row in rows:
        mark = "*" if row["winner"] else " "
        text = f"{mark} {row['method']:<24}{row['rank']:>5.0f}{_short(row['score']):>9}"
        text += f"{_short(row['validation_score']):>9}{100 * row['stable_share']:>6.0f}%"
        text += "".join(f"{_short(row[column]):>9}" for column in columns)
        ratio = _ratio(row["ratio_equal_accuracy"])
        ratio += " " if row["equal_accuracy_reached"] else "+"
        text += f"{_ratio(row['evaluations'], 0):>8}{_ratio(1e6 * row['seconds'], 1):>9}"
        text += f"{ratio:>8}{_ratio(row['ratio_within']):>7}"
        offline = row["offline_seconds"]
        text += f"{_short(offline) if offline else '-':>8}"
        even = "never" if math.isinf(row["break_even"]) else f"{row['break_even']:.0f}"
        lines.append(text + f"{even if offline else '-':>8}")
        lines += [f"      {line}" for line in textwrap.wrap(str(row["failure"]), 104)]
    return lines


def _outside(rows: list[Row], columns: list[str]) -> list[str]:
    """Reduced models scenario by scenario; full-order rows are in the data, not in print."""
    lines: list[str] = []
    for scenario in dict.fromkeys(row["scenario"] for row in rows):
        head = f"  {'outside: ' + str(scenario):<62}{'score':>9}"
        lines.append(head + "".join(f"{_heading(column):>9}" for column in columns))
        for row in rows:
            if row["scenario"] != scenario or row["role"] == "full order":
                continue
            text = f"    {row['method']:<60}{_short(row['score']):>9}"
            lines.append(text + "".join(f"{_short(row[column]):>9}" for column in columns))
            lines += [f"      {line}" for line in textwrap.wrap(str(row["failure"]), 104)]
    return lines


def _targets(rows: list[Row]) -> list[str]:
    lines = [f"  {'target for the winner':<54}{'bound':>9}{'measured':>10}  verdict"]
    for row in rows:
        text = f"    {row['item']:<52}{_short(row['bound']):>9}{_short(row['measured']):>10}"
        lines.append(f"{text}  {row['verdict']}")
        lines += [f"      {line}" for line in textwrap.wrap(str(row["reason"]), 104)]
    return lines


def _short(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2g}" if 0.01 <= abs(value) < 1e4 or value == 0.0 else f"{value:.1e}"


def _ratio(value: float, digits: int = 2) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
