"""Comparisons as paragraphs and tables, for the terminal and for the page of a report."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

from vehiclemor.registry import component, names
from vehiclemor.report.comparison import ALL_MODELS, PAPER, cost_table, timing_of
from vehiclemor.report.findings import (
    IN_WORDS,
    INDISTINGUISHABLE,
    LARGEST_SPREAD,
    MISSED,
    OWN,
    VERDICTS,
    VISIBLE,
    counted,
)
from vehiclemor.report.frames import ERRORS
from vehiclemor.report.labels import ERROR, Column, column, main_outputs, of_kind
from vehiclemor.report.printing import Table, format_value, wrapped
from vehiclemor.study.plans.protocol import FULL_ORDER

Row = dict[str, Any]
Part = str | Table
# Measure of an error -> how it is printed.
MEASURES = {"max": "largest", "rms": "RMS", "relative": "RMS of its range"}


def comparison_text(what: str, rows: pd.DataFrame, folder: Path, show_all: bool = False) -> str:
    """A comparison as text; of that with the paper all claims with reasons, and costs."""
    if what == PAPER:
        parts = paper_parts(rows)
        if show_all:
            parts += claim_parts(rows)
            *models, last = [model for model in rows["model"].unique() if model != ALL_MODELS]
            parts += [cost_text(model, folder, brief=True) for model in models]
            parts.append(cost_text(last, folder))
        else:
            parts.append("vehiclemor compare --all: every claim with its reason, and the costs")
    elif what in names("model"):
        parts = _model_parts(what, rows, folder)
    else:
        parts = study_parts(rows)
    return "\n\n".join(map(str, parts))


def _groups(rows: Iterable[Row], key: str) -> dict[Any, list[Row]]:
    """Rows by the value of a column, in the order of the first of each."""
    table = list(rows)
    order = list(dict.fromkeys(row[key] for row in table))
    table.sort(key=lambda row: order.index(row[key]))
    return {value: list(group) for value, group in groupby(table, itemgetter(key))}


# The paper.


def paper_parts(rows: pd.DataFrame) -> list[Part]:
    """One screen: the printed errors and times, counts of the verdicts, what is missed."""
    records: list[Row] = rows.to_dict("records")
    errors = [row for row in records if "_rms_" in row["id"]]
    times = [row for row in records if "_time_reduction" in row["id"]]
    claims = [row for row in records if row not in errors and row not in times]
    title = "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390, beside this suite"
    counts: list[Row] = []
    for model, group in _groups(claims, "model").items():
        number = Counter(row["verdict"] for row in group)
        counts.append({"claims": model.replace("_", " ")} | {v: number[v] for v in VERDICTS})
    return [
        wrapped(f"{title}: {counted(rows['verdict'])}."),
        _errors(errors),
        _times(times),
        Table(counts),
        _missed(claims),
    ]


def _printed(rows: list[Row], text: Callable[[Row], str]) -> list[Row]:
    """A line of each printed number: default and literal settings side by side."""
    lines: list[Row] = []
    for group in _groups(rows, "id").values():
        line = group[0] | {"of": group[0]["model"].replace("_", " ")}
        for row in group:
            line[f"pod_{row['variant']}"] = f"{text(row)} {VERDICTS[row['verdict']]}"
        lines.append(line)
    return lines


def _errors(rows: list[Row]) -> Table:
    lines = _printed(rows, lambda row: format_value(row["reproduced"], ERROR))
    for line in lines:
        item = line["item"].removeprefix("RMS error of the ").partition(" (figure")[0]
        line["paper_error"] = item
    empty = [f"{r['paper_error']} ({r['of']})" for r in lines if r["signal_rms"] <= r["published"]]
    note = f"signal: {column('signal_rms').meaning}; literal: settings by the paper's words"
    if empty:
        note += f".  Empty bounds, which zero would meet: {', '.join(empty)}"
    columns = ("paper_error", "published", "signal_rms", "pod_default", "pod_literal", "unit")
    return Table(lines, columns, group="of", explain=False, below=f"({note}.)")


def _times(rows: list[Row]) -> Table:
    """Times over that of the full model, instead of the share that is saved."""
    lines = _printed(rows, lambda row: f"{1.0 - row['reproduced']:.2f}")
    for line in lines:
        line["published_time"] = 1.0 - line["published"]
        states = line["item"].removeprefix("simulation time saved").partition(" (figure")[0]
        line["paper_time"] = f"{line['of']}{states.replace(' with ', ', ')}"
    columns = ("paper_time", "published_time", "pod_default", "pod_literal", "strongest")
    return Table(lines, columns)


def _missed(rows: list[Row]) -> Table:
    """What is missed and by how much, for each claim."""
    lines: list[Row] = []
    missed = (row for row in rows if row["verdict"] == MISSED)
    for group in _groups(missed, "id").values():
        first = group[0]
        # A claim without a threshold is explained by what was seen.
        text = first["reason"]
        if first["threshold_source"] != IN_WORDS:
            values = [f"{format_value(r['reproduced'], '.3g')} ({r['variant']})" for r in group]
            measure, bound = first["measure"].split("; ")[0], format_value(first["bound"], ".3g")
            text = f"{measure}: {', '.join(values)}; bound {bound}"
        lines.append({"missed_claims": f"- {first['item']}: {text}"})
    return Table(lines)


def claim_parts(rows: pd.DataFrame) -> list[Part]:
    """All rows with their reasons, by model."""
    note = (
        "The paper's parameters were never published; these models use public data.  default: "
        "settings of POD chosen by a sweep over the runs that are judged here; literal: the "
        "paper's words.  A bound with * is added here, since the paper gives none: "
        f"{100 * VISIBLE:g} % of a signal's range is visible in a figure (2 mm on a curve 40 mm "
        f"high), {100 * INDISTINGUISHABLE:g} % is not.  "
        "replay: returns the training run.  Times are medians of interleaved rounds, not "
        f"comparable with an interquartile range above {100 * LARGEST_SPREAD:g} % of the median."
    )
    columns = ("variant", "limit", "reproduced", "best", "replay", "word")
    parts: list[Part] = [wrapped(note)]
    for model, group in _groups(rows.to_dict("records"), "model").items():
        lines: list[Row] = []
        for row in group:
            unit = "" if row["unit"] in ("1", "-") else f", {row['unit']}"
            measure = f" ({row['measure']})" if row["measure"] else ""
            about = {"of": f"{row['item']}{unit}{measure}", "best": row["floor"]}
            lines.append(row | _verdict(row) | about)
        parts.append(Table(lines, columns, model.replace("_", " "), group="of", note="reason"))
    return parts


def _verdict(row: Row) -> Row:
    """Bound, with a mark if it is added here, and verdict of a row as they are printed."""
    mark = "*" if row["threshold_source"] == OWN else ""
    return {
        "limit": format_value(float(row["bound"]), ".3g") + mark,
        "word": VERDICTS[row["verdict"]],
    }


# A model.


def cost_text(model: str, folder: Path, brief: bool = False) -> str:
    """Cost table of a model as text: times; then settings, counts and errors if not `brief`.

    A brief one is of the published start alone, and leaves the meanings of columns to another.
    """
    data = timing_of(model, folder)
    rows: Any = cost_table(model, folder)
    definition = component("model", model)
    kind = of_kind(definition.kind)
    rows["spread"] = 50.0 * rows["quartile_spread"]
    rows["from"] = "start " + rows["start"]
    ended = rows["status"].where(rows["status"] != "ok", "")
    rows["label"] += ended.map(lambda status: f" ({status})" if status else "")
    if brief:
        rows = rows[rows["start"] == rows["start"].iloc[0]]
    times = ["label", "us_per_run", "spread", "speed_up", "speed_up_strongest", "offline_us"]
    times += ["break_even", "break_even_strongest"]
    title = f"Cost on {data.attrs['title'].removeprefix('timing of ')} ({data.attrs['machine']})"
    against = f"same: against {kind.against[0]}; best: against {kind.against[1]}; -: never, or none"
    below = wrapped(against)
    parts = [str(Table(rows, times, title, group="from", explain=not brief)), below]
    if not brief:
        columns = {name: column(name) for name in ("label", "rank", "tolerance")}
        columns |= {name: Column(heading, ".0f") for name, heading in kind.counts.items()}
        columns |= {f"rms_{o}": column(f"rms_{o}") for o in main_outputs(definition)}
        parts += ["", str(Table(rows, columns, group="from"))]
    return "\n".join(parts)


def _model_parts(name: str, rows: pd.DataFrame, folder: Path) -> list[Part]:
    """Errors of every method in nominal and perturbed runs, costs, unseen inputs."""
    kinds = _groups(rows.to_dict("records"), "kind")
    nominal, perturbed = _groups(kinds[ERRORS], "study").values()
    key = itemgetter("start", "label", "output")
    largest = {key(row): row for row in perturbed}
    lines: list[Row] = []
    for output in main_outputs(component("model", name)):
        for row in (row for row in nominal if row["output"] == output):
            of = f"start {row['start']}: {output.replace('_', ' ')}"
            other = largest.get(key(row))
            errors = {"nominal": _largest_error(row), "perturbed": _largest_error(other)}
            lines.append(row | {"of": of} | errors)
    reasons = dict.fromkeys(f"{r['label']}: {r['reason']}" for r in nominal if r["reason"])
    columns = ("label", "effective_rank", "nominal", "perturbed")
    title = f"{name}: RMS errors, SI units"
    parts: list[Part] = [Table(lines, columns, title, group="of", below="; ".join(reasons))]
    parts.append(cost_text(name, folder))
    unseen = [*kinds["method"], *kinds.get("target", ()), *kinds.get("bound", ())]
    return parts + _unseen_parts(unseen)


def _largest_error(row: Row | None) -> float | str:
    """The largest error; a run that has failed leaves none."""
    if row is None:
        return math.nan
    return "failed" if row["failed"] else row["largest"]


# Studies.


def study_parts(rows: pd.DataFrame) -> list[Part]:
    """Grids, then protocols."""
    records: list[Row] = rows.to_dict("records")
    grids = [row for row in records if row["kind"] == ERRORS]
    unseen = [row for row in records if row["kind"] != ERRORS]
    parts: list[Part] = []
    for group in _groups(grids, "study").values():
        parts += _grid_parts(group)
    if unseen:
        parts += _unseen_parts(unseen)
    return parts


def _grid_parts(rows: list[Row]) -> list[Part]:
    """One study: errors by start and output, and what the runs took."""
    first = rows[0]
    about = (first["model"], f"training {first['training']}", first["grid"])
    outputs = main_outputs(component("model", first["model"]))
    lines: list[Row] = []
    runs: list[Row] = []
    for start, group in _groups(rows, "start").items():
        for output in outputs:
            for row in (row for row in group if row["output"] == output):
                of = f"start {start}: {output.replace('_', ' ')}, {row['unit']}"
                lines.append(row | {"of": of})
                if output == outputs[0]:
                    ends = {"failures": row["failures"] or "0", "seconds_in_loop": row["seconds"]}
                    runs.append(row | ends | {"of": f"start {start}"})
    title = wrapped(f"{first['study']}: {first['title']}") + "\n"
    errors = ("label", "median", "largest", "floor", "failed", "largest_at")
    costs = ["label", "runs", "failures", "warned", "trained", "evaluations", "seconds_in_loop"]
    saturated = {row["label"]: row["saturates_at"] for row in rows if row["saturates_at"]}
    below = "; ".join(f"{label} saturates at rank {rank}" for label, rank in saturated.items())
    return [
        title + wrapped("; ".join(filter(None, about)), 2, 2),
        Table(lines, errors, group="of", below=below),
        Table(runs, [*costs, "offline_seconds"], group="of"),
    ]


def _unseen_parts(rows: list[Row]) -> list[Part]:
    """By protocol: targets, errors of what was chosen, methods, full order beside them."""
    targets = [row["verdict"] for row in rows if row["kind"] == "target"]
    title = "Reduced models on inputs that they were not trained on"
    title += f": of their targets {counted(targets)}" if targets else ""
    parts: list[Part] = [wrapped(f"{title}.")]
    protocols = list(_groups(rows, "study").values())
    for group in protocols:
        parts += _protocol_parts(_groups(group, "kind"), explain=group is protocols[-1])
    return parts


def _protocol_parts(rows: Mapping[str, list[Row]], explain: bool) -> list[Part]:
    methods = rows["method"]
    first, winner = methods[0], next((row for row in methods if row["winner"]), None)
    head = first["study"].removeprefix("predictive-")
    if head != first["model"]:
        head += f" ({first['model']})"
    head += f": {first['runs']:.0f} runs (test set {first['test_set']})"
    if first["apart"]:
        head += f", {first['apart']:.0f} more not judged: full order fails or is sensitive there"
    parts: list[Part] = [] if winner else [wrapped(head)]
    if winner:
        parts += _winner_parts(head, winner, rows["target"], rows["bound"], explain)
    against = {*winner["equal_rows"].split(", "), winner["within"]} if winner else set()
    named: list[Row] = []
    for row in sorted(methods, key=lambda row: row["role"] != FULL_ORDER):
        if row["role"] == FULL_ORDER and row["label"] not in against:
            continue
        label = f"{row['label']} (chosen)" if row["winner"] else row["label"]
        ends = f"{100 * row['stable_share']:.0f} % of the runs end, {row['failure']}"
        named.append(row | {"label": label, "ends": ends if row["failure"] else ""})
    errors = ("label", "misses", "misses_at_ten", "silent", "flagged", "validation_score", "score")
    units = ("label", "median_m", "worst_m", "median_deg", "worst_deg")
    costs = ["label", "seconds", "loop_seconds", "ratio_equal", "ratio_equal_loop"]
    parts.append(Table(named, errors, note="ends", explain=explain))
    if pd.DataFrame(named)[[*units[1:]]].notna().to_numpy().any():
        parts.append(Table(named, units, explain=explain))
    parts.append(Table(named, [*costs, "offline_seconds"], explain=explain))
    chosen = [row for row in named if row["role"] != FULL_ORDER and row["chosen_settings"]]
    if chosen:
        parts.append(Table(chosen, ("label", "chosen_settings")))
    return parts


def _winner_parts(
    head: str, winner: Row, targets: list[Row], bounds: list[Row], explain: bool
) -> list[Part]:
    """What validation has chosen: its targets, and its errors beside their bounds."""
    outcomes = [row | _verdict(row) | {"target": row["item"]} for row in targets]
    for row in bounds:
        kind = MEASURES[row["measure"]]
        row["output"] = f"{row['item'].replace('_', ' ')}, {kind}"
    columns = {"target": Column(f"target for {winner['label']}")}
    columns |= {name: column(name) for name in ("limit", "measured", "word", "reason")}
    errors = {"output": Column(f"errors of {winner['label']}, SI units")}
    errors |= {name: column(name) for name in ("bound", "worst", "most")}
    errors["reason"] = Column("bound from")
    below = "*: bound added here" if explain else ""
    return [Table(outcomes, columns, head, below=below), Table(bounds, errors)]
