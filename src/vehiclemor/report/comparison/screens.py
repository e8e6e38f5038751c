"""Comparisons as text: one screen, or all of it."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vehiclemor.registry import component, names
from vehiclemor.report.comparison.kinds import PAPER
from vehiclemor.report.comparison.rows import ALL_MODELS, PARAMETERS
from vehiclemor.report.costs import costs_text
from vehiclemor.report.criteria.finding import IN_WORDS, INDISTINGUISHABLE, OWN, VISIBLE
from vehiclemor.report.frames import ERRORS
from vehiclemor.report.predictive.targets import chosen
from vehiclemor.report.printing import ERROR, Column, column, shown, table, wrapped
from vehiclemor.report.shown import main_outputs
from vehiclemor.report.verdicts import (
    LARGEST_SPREAD,
    MET,
    MISSED,
    NOT_COMPARABLE,
    OURS,
    PUBLISHED_START,
    VERDICTS,
    counted,
)
from vehiclemor.study.plans.protocol import FULL_ORDER

Row = dict[str, Any]
# Share of missed runs above which a contender is only named.
HOPELESS = 0.1
# A claim with more misses than this gives the first as an example.
FEW = 2
DEFAULT, LITERAL = "default", "literal"


def comparison_text(what: str, rows: pd.DataFrame, folder: Path, every: bool = False) -> str:
    """A comparison as text.

    Parameters
    ----------
    every
        Of the comparison with the paper: all claims with their reasons, and costs.
    """
    records: list[Row] = [{str(k): v for k, v in row.items()} for row in rows.to_dict("records")]
    if what == PAPER:
        return "\n\n".join(_paper(records) + (_claims(records, folder) if every else []))
    if what in names("model"):
        return "\n\n".join(_model(what, records, folder))
    grids = [row for row in records if row["kind"] == ERRORS]
    protocols = [row for row in records if row["kind"] != ERRORS]
    parts = [part for own in _by(grids, "study").values() for part in _grid(own)]
    return "\n\n".join([*parts, *(_predictive(protocols) if protocols else [])])


def _by(rows: Sequence[Row], key: str) -> dict[Any, list[Row]]:
    """Rows by the value of a column."""
    return {
        value: [r for r in rows if r[key] == value]
        for value in dict.fromkeys(row[key] for row in rows)
    }


# The paper.


def _paper(rows: list[Row]) -> list[str]:
    """One screen: the printed errors and times, counts of the verdicts, what is missed."""
    errors = [row for row in rows if "_rms_" in row["id"]]
    times = [row for row in rows if "_time_reduction" in row["id"]]
    claims = [row for row in rows if row not in errors and row not in times]
    title = "Masoudi, Uchida, McPhee (2015), doi:10.1115/1.4029390, beside this suite"
    verdicts = counted(row["verdict"] for row in rows)
    return [
        wrapped(f"{title}: {verdicts}."),
        _errors(errors),
        _times(times),
        _counts(claims),
        _missed(claims),
        "vehiclemor compare --all: every claim with its reason, and the costs",
    ]


def _printed(rows: list[Row], text: Callable[[Row], str]) -> list[Row]:
    """A line of each printed number, by the published start: default and literal settings."""
    lines = []
    for own in _by([row for row in rows if row["start"] == PUBLISHED_START], "id").values():
        found = {row["variant"]: f"{text(row)} {VERDICTS[row['verdict']]}" for row in own}
        line = own[0] | {name: found.get(name) for name in (DEFAULT, LITERAL)}
        item = own[0]["item"].removeprefix("RMS error of the ").partition(" (figure")[0]
        lines.append(line | {"item": item, "of": own[0]["model"].replace("_", " ")})
    return lines


def _errors(rows: list[Row]) -> str:
    lines = _printed(rows, lambda row: shown(row["reproduced"], ERROR))
    columns = {
        "item": Column("RMS error, trained run"),
        "published": Column("paper", ERROR),
        "signal_rms": column("signal_rms"),
        DEFAULT: Column("POD"),
        LITERAL: Column("POD, literal"),
        "unit": Column("unit"),
    }
    empty = [f"{r['item']} ({r['of']})" for r in lines if r["signal_rms"] <= r["published"]]
    note = f"signal: {columns['signal_rms'].meaning}; literal: settings by the paper's words"
    note += f".  Empty bounds, which zero would meet: {', '.join(empty)}" if empty else ""
    return f"{table(lines, columns, group='of', explain=False)}\n{wrapped(f'({note}.)', 0, 1)}"


def _times(rows: list[Row]) -> str:
    """Times over that of the full model, instead of the share that is saved."""
    lines = _printed(rows, lambda row: f"{1.0 - row['reproduced']:.2f}")
    for line in lines:
        line["paper"] = 1.0 - line["published"]
        states = line["item"].removeprefix("simulation time saved").removeprefix(" with ")
        line["item"] = f"{line['of']}{', ' if states else ''}{states}"
    columns = {
        "item": Column("time over full model's"),
        "paper": Column("paper", ".2f"),
        DEFAULT: Column("POD"),
        LITERAL: Column("POD, literal"),
        "strongest": Column(
            "best solver",
            ".2f",
            "time of POD over that of the fastest full-order solver; met: if the errors are, too",
        ),
    }
    return table(lines, columns)


def _counts(rows: list[Row]) -> str:
    lines = []
    for model, own in _by(rows, "model").items():
        verdicts = [row["verdict"] for row in own]
        counts = {kind: verdicts.count(kind) for kind in (MET, MISSED, NOT_COMPARABLE)}
        lines.append({"claims": model.replace("_", " ")} | counts)
    return table(lines, ("claims", MET, MISSED, NOT_COMPARABLE))


def _missed(rows: list[Row]) -> str:
    """What is missed and by how much, a paragraph for each claim."""
    parts = ["Missed claims"]
    for own in _by(rows, "id").values():
        missed = [row for row in own if row["verdict"] == MISSED]
        if not missed:
            continue
        row = missed[0]
        listed = missed if len(missed) <= FEW else missed[:1]
        values = [f"{shown(r['reproduced'], '.3g')} ({r['variant']})" for r in listed]
        more = [f"{len(missed)} of {len(own)} missed"] * (len(missed) > FEW)
        bound = f"bound {shown(row['bound'], '.3g')}"
        found = f"{row['measure'].split('; ')[0]}: {'; '.join([', '.join(values), bound, *more])}"
        if row["threshold_source"] == IN_WORDS and not more:
            # No threshold of ours: what was seen says why.
            found = row["reason"].split("; ")[0]
        parts.append(wrapped(f"- {row['item']}: {found}", 0, 2))
    return "\n".join(parts)


def _claims(rows: list[Row], folder: Path) -> list[str]:
    """All rows with their reasons, by model, and the costs."""
    note = (
        f"{PARAMETERS[0].upper()}{PARAMETERS[1:]}.  default: our settings of POD, picked by model "
        "after a sweep over all settings on the runs that are judged here; literal: the paper's "
        "words.  A bound with * is our own, since the paper gives none: "
        f"{100 * VISIBLE:g} % of a signal's range is visible in a figure (2 mm on a curve 40 mm "
        f"high), {100 * INDISTINGUISHABLE:g} % is not.  dropped: a start that we added, since the "
        "paper doesn't say how its runs start; it is within or beyond a bound, but not judged.  "
        "replay: returns the training run.  Times are medians of interleaved rounds, not "
        f"comparable with an interquartile range above {100 * LARGEST_SPREAD:g} % of the median.  "
        "Design and cars: results as earlier versions measured them."
    )
    parts = [wrapped(note)]
    columns = {
        "who": Column("settings"),
        "bound": Column("bound"),
        "reproduced": column("reproduced"),
        "floor": Column("projection", ".2g"),
        "replay": Column("replay", ".3g"),
        "verdict": Column("verdict"),
    }
    for model, own in _by(rows, "model").items():
        lines = []
        for row in own:
            unit = "" if row["unit"] in ("1", "-") else f", {row['unit']}"
            measure = f" ({row['measure']})" if row["measure"] else ""
            mark = "*" if row["threshold_source"] == OWN else ""
            start = "" if row["start"] == PUBLISHED_START else f", {row['start']}"
            words = {True: "within", False: "beyond", None: "not comparable"}[row["within"]]
            verdict = words if row["verdict"] == OURS else VERDICTS[row["verdict"]]
            reason = row["reason"].replace(f"{PARAMETERS}; ", "").replace(row["measure"], "")
            lines.append(
                row
                | {"heading": wrapped(f"{row['item']}{unit}{measure}", 0, 2), "reason": reason}
                | {"who": f"{row['variant']}{start}", "verdict": verdict}
                | {"bound": shown(row["bound"], ".3g") + mark}
            )
        parts.append(
            f"{model.replace('_', ' ')}\n{table(lines, columns, group='heading', note='reason')}"
        )
    models = [model for model in _by(rows, "model") if model != ALL_MODELS]
    parts += [costs_text(model, folder, brief=model != models[-1]) for model in models]
    return parts


# A model.


def _model(name: str, rows: list[Row], folder: Path) -> list[str]:
    """Errors of every method in nominal and perturbed runs, costs, modes, unseen inputs."""
    outputs = main_outputs(component("model", name))
    kinds = _by(rows, "kind")
    lines, reasons = [], []
    for output in outputs:
        for row in kinds["nominal"]:
            place = (row["label"], row["start"])
            same = [r for r in kinds["perturbed"] if (r["label"], r["start"]) == place]
            errors = {"nominal": row[f"rms_{output}"], "perturbed": _largest(same, f"rms_{output}")}
            words = f"start {row['start']}: {output.replace('_', ' ')}"
            lines.append({"of": words, **row, **errors})
            reasons += [f"{row['label']}: {row['message']}"] if row["status"] != "ok" else []
    columns = ("label", "effective_rank", "nominal", "perturbed")
    head = [f"{name}: RMS errors, SI units", table(lines, columns, group="of")]
    head += [wrapped(reason, 0, 2) for reason in dict.fromkeys(reasons)]
    parts = ["\n".join(head), costs_text(name, folder)]
    if modes := kinds.get("spectrum"):
        text = "Singular values of POD over all control periods of the nominal run"
        shares = ["median_singular_value", "largest_singular_value", "largest_left_out"]
        numbered = [row | {"mode": f"{row['mode']:.0f}"} for row in modes]
        parts.append(f"{text}\n{table(numbered, ['mode', *shares], group='preset')}")
    judged = [*kinds.get("method", ()), *kinds.get("target", ())]
    return parts + _predictive(judged)


def _largest(rows: Sequence[Mapping[str, Any]], key: str) -> float | str:
    """The largest error; a run that has failed leaves none, and then there is no largest one."""
    if any(row["status"] != "ok" for row in rows):
        return "failed"
    return max((row[key] for row in rows), default=math.nan)


# A study.


def _grid(rows: list[Row]) -> list[str]:
    """One study: errors by start and output, and what the runs took."""
    first = rows[0]
    about = "; ".join(
        filter(None, (first["model"], f"training {first['training']}", first["grid"]))
    )
    outputs = main_outputs(component("model", first["model"]))
    lines = [
        row | {"of": f"start {row['start']}: {row['output'].replace('_', ' ')}, {row['unit']}"}
        for start in _by(rows, "start").values()
        for output in outputs
        for row in start
        if row["output"] == output
    ]
    runs = [
        row
        | {"of": f"start {row['start']}", "failures": row["failures"] or "0"}
        | {"seconds_in_loop": row["seconds"]}
        for row in rows
        if row["output"] == outputs[0]
    ]
    head = wrapped(f"{first['study']}: {first['title']}") + "\n" + wrapped(about, 2, 2)
    errors = table(
        lines, ("label", "median", "largest", "floor", "failed", "largest_at"), group="of"
    )
    costs = ["label", "runs", "failures", "warned", "trained", "evaluations", "seconds_in_loop"]
    return [head, errors, table(runs, [*costs, "offline_seconds"], group="of")]


# Unseen inputs.


def _predictive(rows: list[Row]) -> list[str]:
    """By protocol: targets, errors of what was chosen, methods, full order beside them."""
    targets = [str(row["verdict"]) for row in rows if row["kind"] == "target"]
    title = "Reduced models on inputs that they were not trained on"
    title += f": of their targets {counted(targets)}" if targets else ""
    parts, protocols = [wrapped(f"{title}.")], list(_by(rows, "study").values())
    for own in protocols:
        parts += _protocol(own, explain=own is protocols[-1])
    return parts


def _protocol(rows: list[Row], explain: bool) -> list[str]:
    methods = [row for row in rows if row["kind"] == "method"]
    targets = [row for row in rows if row["kind"] == "target"]
    first, winner = methods[0], chosen(methods)
    known = first["study"].removeprefix("predictive-")
    of_model = "" if known == first["model"] else f" ({first['model']})"
    head = f"{known}{of_model}: {first['runs']:.0f} runs (test set {first['test_set']})"
    if first["apart"]:
        head += f", {first['apart']:.0f} more not judged: full order fails or is sensitive there"
    parts = [wrapped(head)]
    if targets:
        lines = []
        for row in targets:
            mark = "*" if row["threshold_source"] == OWN else ""
            bound = shown(float(row["bound"]), ".3g") + mark
            item = row["item"].replace("silent", "undetected")
            lines.append(row | {"item": item, "bound": bound, "verdict": VERDICTS[row["verdict"]]})
        columns = {"item": Column(f"target for {targets[0]['label']}"), "bound": Column("bound")}
        columns |= {key: column(key) for key in ("measured", "verdict", "reason")}
        parts[0] += "\n" + table(lines, columns) + ("\n*: bound of our own" if explain else "")
    if winner:
        parts.append(_winner_errors(winner))
    return [*parts, *_methods(methods, winner, explain)]


def _winner_errors(winner: Row) -> str:
    """Errors of what was chosen, each beside its bound and the bound's reason."""
    bounds = json.loads(winner["bounds"])
    lines = []
    for key in (c for c in winner if c.startswith("worst_") and not math.isnan(winner[c])):
        kind, _, output = key.removeprefix("worst_").partition("_")
        bound, reason = bounds.get(output, (math.nan, ""))
        item = f"{output.replace('_', ' ')}, {'largest' if kind == 'max' else 'RMS'}"
        line = {"item": item, "bound": float(bound), "worst": winner[key], "reason": reason}
        lines.append(line | {"most": winner[key.replace("worst_", "most_", 1)]})
    columns = {"item": Column(f"errors of {winner['label']}, SI units"), "bound": column("bound")}
    columns |= {"worst": Column("worst run", ".3g"), "most": column("most")}
    return table(lines, columns | {"reason": Column("bound from")})


def _methods(rows: list[Row], winner: Row | None, explain: bool) -> list[str]:
    """Reduced models, and the full-order rows that what was chosen is measured against.

    Those that miss most runs are named below.
    """
    against = set(winner["equal_rows"].split(", ")) | {winner["within"]} if winner else set()
    reduced = [row for row in rows if row["role"] != FULL_ORDER]
    kept = [row for row in reduced if row["winner"] or row["misses"] <= HOPELESS * row["runs"]]
    lost = [row for row in reduced if row not in kept]
    full = [row for row in rows if row["role"] == FULL_ORDER and row["label"] in against]
    named = [r | {"label": r["label"] + " (chosen)" * bool(r["winner"])} for r in (*full, *kept)]
    errors = ["label", "misses", "silent", "flagged", "validation_score", "score"]
    costs = ["label", "seconds", "loop_seconds", "ratio_equal", "ratio_equal_loop"]
    parts = [table(named, errors, explain=explain)]
    failed = [
        f"{r['label']}: {100 * r['stable_share']:.0f} % of the runs end, {r['failure']}"
        for r in (*full, *kept)
        if r["failure"]
    ]
    words = ", ".join(f"{r['label']} {r['misses']:.0f} ({shown(r['score'], '.3g')})" for r in lost)
    failed += [f"Miss more than {100 * HOPELESS:g} % of the runs (worst error): {words}."] * bool(
        lost
    )
    parts[0] = "\n".join([parts[0], *(wrapped(text, 0, 2) for text in failed)])
    return [*parts, table(named, [*costs, "offline_seconds"], explain=explain)]
