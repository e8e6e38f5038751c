"""Comparisons as paragraphs and tables, for the terminal and for the page of a report."""

import math
from collections.abc import Callable, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

from vehiclemor.registry import component, names
from vehiclemor.report.comparison import PAPER, cost_table, timing_of
from vehiclemor.report.labels import ERROR, Column, column, main_outputs, of_kind
from vehiclemor.report.printing import Table, format_value, grouped, wrapped
from vehiclemor.report.published import VERDICTS, counted
from vehiclemor.report.results import ERRORS
from vehiclemor.study.plans.protocol import FULL_ORDER

Row = dict[str, Any]
Part = str | Table
# Measure of an error -> how it is printed.
MEASURES = {"max": "largest", "rms": "RMS", "relative": "RMS of its range"}


def comparison_text(what: str, rows: pd.DataFrame, folder: Path, show_all: bool = False) -> str:
    """A comparison as text; of that with the paper costs too, if all is shown."""
    if what == PAPER:
        parts = paper_parts(rows)
        if show_all:
            *models, last = rows["model"].unique()
            parts += [cost_text(model, folder, brief=True) for model in models]
            parts.append(cost_text(last, folder))
        else:
            parts.append("vehiclemor compare --all: the costs too")
    elif what in names("model"):
        parts = _model_parts(what, rows, folder)
    else:
        parts = study_parts(rows)
    return "\n\n".join(map(str, parts))


# The paper.


def paper_parts(rows: pd.DataFrame) -> list[Part]:
    """The printed errors and times beside those of this suite."""
    records: list[Row] = rows.to_dict("records")
    errors = [row for row in records if "_rms_" in row["id"]]
    times = [row for row in records if row not in errors]
    title = "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390, beside this suite"
    return [wrapped(f"{title}: {counted(rows['verdict'])}."), _errors(errors), _times(times)]


def _printed(rows: list[Row], text: Callable[[Row], str]) -> list[Row]:
    """A line of each printed number: default and literal settings side by side."""
    lines: list[Row] = []
    for group in grouped(rows, "id").values():
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


# A model.


def cost_text(model: str, folder: Path, brief: bool = False) -> str:
    """Cost table of a model as text: times; then settings, counts and errors if not `brief`.

    A brief one is of the published start alone, and leaves the meanings of columns to another.
    """
    data = timing_of(model, folder)
    rows: Any = cost_table(model, folder)
    definition = component("model", model)
    kind = of_kind(definition.kind)
    rows["from"] = "start " + rows["start"]
    ended = rows["status"].where(rows["status"] != "ok", "")
    rows["label"] += ended.map(lambda status: f" ({status})" if status else "")
    if brief:
        rows = rows[rows["start"] == rows["start"].iloc[0]]
    times = ["label", "us_per_run", "quartile_spread", "speed_up", "speed_up_strongest"]
    times += ["offline_us", "break_even", "break_even_strongest"]
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
    kinds = grouped(rows.to_dict("records"), "kind")
    nominal, perturbed = grouped(kinds[ERRORS], "study").values()
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
    for group in grouped(grids, "study").values():
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
    for start, group in grouped(rows, "start").items():
        by_output = grouped(group, "output")
        for output in outputs:
            for row in by_output[output]:
                of = f"start {start}: {output.replace('_', ' ')}, {row['unit']}"
                lines.append(row | {"of": of})
        for row in by_output[outputs[0]]:
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
    protocols = list(grouped(rows, "study").values())
    for group in protocols:
        parts += _protocol_parts(grouped(group, "kind"), explain=group is protocols[-1])
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
        parts += _winner_parts(head, winner, rows["target"], rows["bound"])
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


def _winner_parts(head: str, winner: Row, targets: list[Row], bounds: list[Row]) -> list[Part]:
    """What validation has chosen: its targets, and its errors beside their bounds."""
    outcomes: list[Row] = []
    for row in targets:
        words = {"target": row["item"], "word": VERDICTS[row["verdict"]]}
        outcomes.append(row | words | {"limit": format_value(float(row["bound"]), ".3g")})
    for row in bounds:
        kind = MEASURES[row["measure"]]
        row["output"] = f"{row['item'].replace('_', ' ')}, {kind}"
    columns = {"target": Column(f"target for {winner['label']}")}
    columns |= {name: column(name) for name in ("limit", "measured", "word", "reason")}
    errors = {"output": Column(f"errors of {winner['label']}, SI units")}
    errors |= {name: column(name) for name in ("bound", "worst", "most")}
    errors["reason"] = Column("bound from")
    return [Table(outcomes, columns, head), Table(bounds, errors)]
