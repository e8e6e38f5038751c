"""Comparisons as paragraphs and tables, for the terminal and for the page of a report."""

import math
from collections.abc import Callable, Mapping, Sequence
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
from vehiclemor.report.labels import ERROR, Column, column, declared, main_outputs, of_kind
from vehiclemor.report.printing import Table, shown, wrapped
from vehiclemor.report.sizes import EXPLAINED, KIND, growth_text
from vehiclemor.study.plans.protocol import FULL_ORDER

Row = dict[str, Any]
Part = str | Table
# Measure of an error -> how it is printed.
MEASURES = {"max": "largest", "rms": "RMS", "relative": "RMS of its range"}


def comparison_text(what: str, rows: pd.DataFrame, folder: Path, every: bool = False) -> str:
    """A comparison as text; of that with the paper `every` claim with its reason, and costs."""
    if what == PAPER:
        parts = paper_parts(rows)
        if every:
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


def _by(rows: Sequence[Row], key: str) -> dict[Any, list[Row]]:
    """Rows by the value of a column."""
    found: dict[Any, list[Row]] = {}
    for row in rows:
        found.setdefault(row[key], []).append(row)
    return found


# The paper.


def paper_parts(rows: pd.DataFrame) -> list[Part]:
    """One screen: the printed errors and times, counts of the verdicts, what is missed."""
    records: list[Row] = rows.to_dict("records")
    errors = [row for row in records if "_rms_" in row["id"]]
    times = [row for row in records if "_time_reduction" in row["id"]]
    claims = [row for row in records if row not in errors and row not in times]
    title = "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390, beside this suite"
    counts = []
    for model, own in _by(claims, "model").items():
        verdicts = [row["verdict"] for row in own]
        found = {kind: verdicts.count(kind) for kind in VERDICTS}
        counts.append({"claims": model.replace("_", " ")} | found)
    return [
        wrapped(f"{title}: {counted(rows['verdict'])}."),
        _errors(errors),
        _times(times),
        Table(counts),
        _missed(claims),
    ]


def _printed(rows: list[Row], text: Callable[[Row], str]) -> list[Row]:
    """A line of each printed number: default and literal settings side by side."""
    lines = []
    for own in _by(rows, "id").values():
        found = {f"pod_{r['variant']}": f"{text(r)} {VERDICTS[r['verdict']]}" for r in own}
        lines.append(own[0] | found | {"of": own[0]["model"].replace("_", " ")})
    return lines


def _errors(rows: list[Row]) -> Table:
    lines = _printed(rows, lambda row: shown(row["reproduced"], ERROR))
    for line in lines:
        item = line["item"].removeprefix("RMS error of the ").partition(" (figure")[0]
        line["paper_error"] = item
    empty = [f"{r['paper_error']} ({r['of']})" for r in lines if r["signal_rms"] <= r["published"]]
    note = f"signal: {column('signal_rms').meaning}; literal: settings by the paper's words"
    note += f".  Empty bounds, which zero would meet: {', '.join(empty)}" if empty else ""
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
    lines = []
    for own in _by([row for row in rows if row["verdict"] == MISSED], "id").values():
        first = own[0]
        values = ", ".join(f"{shown(r['reproduced'], '.3g')} ({r['variant']})" for r in own)
        measure, bound = first["measure"].split("; ")[0], shown(first["bound"], ".3g")
        # A claim without a threshold is explained by what was seen.
        by_claim = first["threshold_source"] == IN_WORDS
        found = first["reason"] if by_claim else f"{measure}: {values}; bound {bound}"
        lines.append({"missed_claims": f"- {first['item']}: {found}"})
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
    for model, own in _by(rows.to_dict("records"), "model").items():
        lines = []
        for row in own:
            unit = "" if row["unit"] in ("1", "-") else f", {row['unit']}"
            measure = f" ({row['measure']})" if row["measure"] else ""
            about = {"of": f"{row['item']}{unit}{measure}", "best": row["floor"]}
            lines.append(row | _judged(row) | about)
        parts.append(Table(lines, columns, model.replace("_", " "), group="of", note="reason"))
    return parts


def _judged(row: Row) -> Row:
    """Bound, with a mark if it is added here, and verdict of a row as they are printed."""
    mark = "*" if row["threshold_source"] == OWN else ""
    return {"limit": shown(float(row["bound"]), ".3g") + mark, "word": VERDICTS[row["verdict"]]}


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
    rows = rows[rows["start"] == rows["start"].iloc[0]] if brief else rows
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
    kinds = _by(rows.to_dict("records"), "kind")
    nominal, perturbed = _by(kinds[ERRORS], "study").values()
    key = ("start", "label", "output")
    largest = {tuple(row[k] for k in key): row for row in perturbed}
    lines = []
    for output in main_outputs(component("model", name)):
        for row in (row for row in nominal if row["output"] == output):
            of = f"start {row['start']}: {output.replace('_', ' ')}"
            other = largest.get(tuple(row[k] for k in key))
            lines.append(row | {"of": of, "nominal": _ended(row), "perturbed": _ended(other)})
    reasons = dict.fromkeys(f"{r['label']}: {r['reason']}" for r in nominal if r["reason"])
    columns = ("label", "effective_rank", "nominal", "perturbed")
    title = f"{name}: RMS errors, SI units"
    parts: list[Part] = [Table(lines, columns, title, group="of", below="; ".join(reasons))]
    parts.append(cost_text(name, folder))
    judged = [row for kind in ("method", "target", "bound") for row in kinds.get(kind, ())]
    return parts + _unseen_parts(judged)


def _ended(row: Row | None) -> float | str:
    """The largest error; a run that has failed leaves none."""
    return math.nan if row is None else "failed" if row["failed"] else row["largest"]


# Studies.


def study_parts(rows: pd.DataFrame) -> list[Part]:
    """Grids, then protocols."""
    records: list[Row] = rows.to_dict("records")
    grids = [row for row in records if row["kind"] == ERRORS]
    parts = [part for own in _by(grids, "study").values() for part in _grid_parts(own)]
    sized = [row for row in records if row["kind"] == KIND]
    for own in _by(sized, "study").values():
        title = f"{own[0]['study']}: what a reduced model gains"
        parts.append(Table(own, declared().sizes["costs"], title, below=growth_text(own)))
        compared = [row for row in own if row["error_motion"] == row["error_motion"]]
        parts.append(Table(compared, declared().sizes["rivals"], below=EXPLAINED))
    judged = [row for row in records if row["kind"] not in (ERRORS, KIND)]
    return parts + (_unseen_parts(judged) if judged else [])


def _grid_parts(rows: list[Row]) -> list[Part]:
    """One study: errors by start and output, and what the runs took."""
    first = rows[0]
    about = (first["model"], f"training {first['training']}", first["grid"])
    outputs = main_outputs(component("model", first["model"]))
    lines, runs = [], []
    for start, own in _by(rows, "start").items():
        for output in outputs:
            for row in (row for row in own if row["output"] == output):
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
    protocols = list(_by(rows, "study").values())
    for own in protocols:
        parts += _protocol_parts(_by(own, "kind"), explain=own is protocols[-1])
    return parts


def _protocol_parts(rows: Mapping[str, list[Row]], explain: bool) -> list[Part]:
    methods = rows["method"]
    first, winner = methods[0], next((row for row in methods if row["winner"]), None)
    known = first["study"].removeprefix("predictive-")
    of_model = "" if known == first["model"] else f" ({first['model']})"
    head = f"{known}{of_model}: {first['runs']:.0f} runs (test set {first['test_set']})"
    if first["apart"]:
        head += f", {first['apart']:.0f} more not judged: full order fails or is sensitive there"
    parts: list[Part] = [] if winner else [wrapped(head)]
    if winner:
        parts += _winner_parts(head, winner, rows["target"], rows["bound"], explain)
    against = {*winner["equal_rows"].split(", "), winner["within"]} if winner else set()
    named = [
        row | {"label": row["label"] + " (chosen)" * bool(row["winner"])}
        for row in sorted(methods, key=lambda row: row["role"] != FULL_ORDER)
        if row["role"] != FULL_ORDER or row["label"] in against
    ]
    for row in named:
        ends = f"{100 * row['stable_share']:.0f} % of the runs end, {row['failure']}"
        row["ends"] = ends if row["failure"] else ""
    errors = ("label", "misses", "misses_at_ten", "silent", "flagged", "validation_score", "score")
    units = ("label", "median_m", "worst_m", "median_deg", "worst_deg")
    costs = ["label", "seconds", "loop_seconds", "ratio_equal", "ratio_equal_loop"]
    parts.append(Table(named, errors, note="ends", explain=explain))
    if any(row[unit] == row[unit] for row in named for unit in units[1:]):
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
    reached = [row | _judged(row) | {"target": row["item"]} for row in targets]
    for row in bounds:
        kind = MEASURES[row["measure"]]
        row["output"] = f"{row['item'].replace('_', ' ')}, {kind}"
    columns = {"target": Column(f"target for {winner['label']}")}
    columns |= {name: column(name) for name in ("limit", "measured", "word", "reason")}
    errors = {"output": Column(f"errors of {winner['label']}, SI units")}
    errors |= {name: column(name) for name in ("bound", "worst", "most")}
    errors["reason"] = Column("bound from")
    below = "*: bound added here" if explain else ""
    return [Table(reached, columns, head, below=below), Table(bounds, errors)]
