"""The predictive comparison as text: one screen a model."""

import json
import math

import pandas as pd

from vehiclemor.report.criteria.finding import OWN
from vehiclemor.report.labels import label_of
from vehiclemor.report.predictive.targets import Row, chosen
from vehiclemor.report.printing import Footnotes, Line, fixed, short, table_text, terms, wrapped
from vehiclemor.report.verdicts import LARGEST_SPREAD, NOT_COMPARABLE, counted
from vehiclemor.study.plans.protocol import FULL_ORDER

# Share of missed runs above which a contender is only named.
HOPELESS = 0.1
LEGEND = {
    "miss": "runs outside of a bound; sil.: of these with the status ok; flag: runs of which the "
    "model says that it has left what it knows",
    "score": "largest error as a multiple of its bound; valid.: in validation, which alone chooses",
    "us": "CPU time of a whole call, all outputs delivered; loop: of its compiled loop; x, xl: "
    "times faster than the full order interpolated at the same score, in calls and loops; off.: "
    "offline, s",
    "bound": "with a * it is our own; n/c: not comparable, since the rounds scatter by more than "
    f"{100 * LARGEST_SPREAD:g} % (interquartile range over median)",
    "*": "chosen by validation",
}


def predictive_text(rows: pd.DataFrame) -> str:
    """All models: targets, errors of what was chosen, contenders, full order beside them."""
    records: list[Row] = [dict(row) for row in rows.to_dict(orient="records")]
    targets = _of_kind(records, "target")
    title = "Reduced models on inputs that they have not seen"
    if targets:
        title += f": of their targets {counted(str(row['verdict']) for row in targets)}"
    parts = [wrapped(f"{title}."), terms(LEGEND)]
    parts += [
        _protocol_text([row for row in records if row["study"] == study])
        for study in dict.fromkeys(row["study"] for row in records)
    ]
    return "\n\n".join(parts)


def _protocol_text(rows: list[Row]) -> str:
    methods, notes = _of_kind(rows, "method"), Footnotes()
    winner = chosen(methods)
    name, model = (str(methods[0][key]) for key in ("study", "model"))
    known = name.removeprefix("predictive-")
    of_model = "" if known == model else f" ({model})"
    lines = [wrapped(f"{known}{of_model}: {_test_set(methods[0])}")]
    lines += [_target_table(_of_kind(rows, "target"), notes)]
    lines += [_error_table(winner, notes) if winner else ""]
    lines += [_method_table(methods, winner, notes)]
    lines += [notes.text()]
    return "\n".join(text for text in lines if text)


def _test_set(row: Row) -> str:
    text = f"{row['runs']:.0f} runs (test set {row['test_set']})"
    if row["apart"]:
        text += f", {row['apart']:.0f} more not judged, on which the full order is sensitive"
    return text


def _of_kind(rows: list[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _target_table(rows: list[Row], notes: Footnotes) -> str:
    if not rows:
        return ""
    lines = []
    for row in rows:
        own = "*" if row["threshold_source"] == OWN else ""
        verdict = "n/c" if row["verdict"] == NOT_COMPARABLE else row["verdict"]
        cells = [f"  {row['item']}", short(row["bound"]) + own, short(row["measured"])]
        lines.append(Line([*cells, f"{verdict} {notes.marks(row['reason'])}"]))
    return table_text(["target for what was chosen", "bound", "measured", "verdict"], lines, (0, 3))


def _error_table(winner: Row, notes: Footnotes) -> str:
    """Errors of what was chosen, each beside its bound and the bound's reason."""
    bounds = json.loads(winner["bounds"])
    lines = []
    for column in (c for c in winner if c.startswith("worst_")):
        kind, _, output = column.removeprefix("worst_").partition("_")
        if math.isnan(winner[column]):
            continue
        bound, reason = bounds.get(output, (math.nan, ""))
        values = (winner[column], winner[column.replace("worst_", "most_", 1)])
        name = f"  {label_of(output).short}{' max' if kind == 'max' else ''} {notes.marks(reason)}"
        lines.append(Line([name, *map(short, (bound, *values))]))
    heading = f"  errors of {winner['label']}"
    return table_text([heading, "bound", "worst", "99 %"], lines)


def _method_table(rows: list[Row], winner: Row | None, notes: Footnotes) -> str:
    """Reduced models, and the full-order rows that what was chosen is measured against.

    Those that miss most runs are named below.
    """
    against = set(winner["equal_rows"].split(", ")) | {winner["within"]} if winner else set()
    reduced = [row for row in rows if row["role"] != FULL_ORDER]
    shown = [row for row in reduced if row["winner"] or row["misses"] <= HOPELESS * row["runs"]]
    lost = [row for row in reduced if row not in shown]
    heads = ["", "miss", "sil.", "flag", "valid.", "score", "us", "loop", "x", "xl", "off."]
    full = [row for row in rows if row["role"] == FULL_ORDER and row["label"] in against]
    table = table_text(heads, [Line(_costs(row, notes)) for row in (*full, *shown)])
    if not lost:
        return table
    words = ", ".join(
        f"{row['label']} {row['misses']:.0f} ({short(row['score'])})" for row in lost
    )
    return f"{table}\n{wrapped(f'Miss more (worst score): {words}.', 2, 4)}"


def _costs(row: Row, notes: Footnotes) -> list[str]:
    share = f"{100 * row['stable_share']:.0f} % of the runs come to their end: "
    told = notes.marks(share + row["failure"] if row["failure"] else "")
    cells = [f"{'*' if row['winner'] else ' '} {row['label']} {told}".rstrip()]
    cells += [f"{row[name]:.0f}" for name in ("misses", "silent", "flagged")]
    cells += [short(row["validation_score"]), short(row["score"])]
    cells += [fixed(1e6 * row.get(clock, math.nan), 0) for clock in ("seconds", "loop_seconds")]
    cells += [fixed(row["ratio_equal"], 1), fixed(row["ratio_equal_loop"], 1)]
    return [*cells, short(row["offline_seconds"]) if row["offline_seconds"] else "-"]
