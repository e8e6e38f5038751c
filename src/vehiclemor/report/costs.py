"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.labels import label_of
from vehiclemor.report.printing import Line, fixed, number, power, table_text, wrapped
from vehiclemor.report.shown import main_outputs, of_kind, timing_cases
from vehiclemor.simulation.build import build
from vehiclemor.study.timing import timed_model

LEGEND = (
    "Costs.  us: CPU time of the thread, median of interleaved rounds; +-%: half their "
    "interquartile range; offline: training and fit; even: break-even, the runs after which that "
    "is earned, against either baseline; errors: RMS"
)


def cost_table(model: str, folder: Path) -> pd.DataFrame:
    """Cost of every timing case of a model on its nominal maneuver, from every start.

    Returns
    -------
    pandas.DataFrame
        `case` (identifier) and `label`, `us_per_run`, `ns_per_sample`, counts, `speed_up` (against
        the paper's kind of baseline), `speed_up_strongest` (against the strongest full-order
        solver), errors, `offline_us`, and the number of runs after which a reduced model has paid
        for its training against either baseline (missing where it never does).
    """
    data, kind = timing_of(model, folder), component("model", model).kind
    rows = [
        _row(data.sel(start=start, case=case), list(of_kind(kind).counts))
        for start in data["start"].values
        for case in data["case"].values
    ]
    return pd.DataFrame(rows)


def timing_of(model: str, folder: Path) -> xr.Dataset:
    """Stored timing of the cases of a model, measured first if it is missing."""
    cases = timing_cases(component("model", model))
    return timed_model(build(model), cases, folder, f"timing-{model}")


def _row(data: xr.Dataset, counts: list[str]) -> dict[str, object]:
    """One case from one start."""
    own, offline = float(data["seconds"]), float(data["offline_seconds"])
    spread = float(data["seconds_upper"] - data["seconds_lower"])
    status = str(data["status"].item())
    speed_ups = {name: float(data[name]) for name in ("speed_up", "speed_up_strongest")}
    loops = {f"loop_{name}": float(data[f"loop_{name}"]) for name in speed_ups}
    # Time saved in a run; a run that has failed saves nothing.
    saved = [own * (ratio - 1.0) if status == "ok" else 0.0 for ratio in speed_ups.values()]
    even = [offline / s if s > 0.0 and offline > 0.0 else float("nan") for s in saved]
    return {
        "start": str(data["start"].item()),
        "case": str(data["case"].item()),
        "label": str(data["label"].item()),
        "status": status,
        "rank": int(data["effective_rank"]),
        "us_per_run": own * 1e6,
        "ns_per_sample": float(data["seconds_per_sample"]) * 1e9,
        **{name: int(data[name]) for name in counts},
        "tolerance": float(data["tolerance"]),
        "quartile_spread": spread / own if own > 0.0 else 0.0,
        **speed_ups,
        "loop_us": float(data["loop_seconds"]) * 1e6,
        **loops,
        **{f"rms_{o}": float(data["rms_error"].sel(output=o)) for o in data["output"].values},
        "offline_us": offline * 1e6,
        "break_even": even[0],
        "break_even_strongest": even[1],
    }


def costs_text(model: str, folder: Path, brief: bool = False) -> str:
    """Cost table of a model as text: times; then settings, counts and errors if not `brief`.

    A brief one is of the published start alone.
    """
    data, table = timing_of(model, folder), cost_table(model, folder)
    definition = component("model", model)
    shown, outputs = of_kind(definition.kind), main_outputs(definition)
    counts, (baseline, strongest) = shown.counts, shown.against
    first, *_ = counts.items()
    starts = list(dict.fromkeys(table["start"]))
    times: list[Line] = []
    details: list[Line] = []
    for start in starts[:1] if brief else starts:
        heading = f"start {start}" if len(starts) > 1 else ""
        for row in table.to_dict("records"):
            if row["start"] == start:
                times.append(Line(_times(row, first[0]), heading=heading))
                details.append(Line(_details(row, counts, outputs), heading=heading))
                heading = ""
    heads = ["", "us", "+-%", first[1], "x1", "x2", "offline us", "even x1", "even x2"]
    found = [f"{label_of(output).short} error" for output in outputs]
    tables = [table_text(heads, times)]
    if not brief:
        tables.append(table_text(["", "rank", "tol.", *counts.values(), *found], details))
    title = f"Cost on {data.attrs['title'].removeprefix('timing of ')} ({data.attrs['machine']})"
    against = f"x1: speed-up against {baseline}; x2: against {strongest}"
    return "\n".join([wrapped(title), wrapped(against), "\n\n".join(tables)])


def _times(row: dict, count: str) -> list[str]:
    cells = [row["label"], fixed(row["us_per_run"], 1), fixed(50.0 * row["quartile_spread"], 0)]
    cells += [str(row[count]), fixed(row["speed_up"]), fixed(row["speed_up_strongest"])]
    if row["offline_us"] == 0.0 or row["status"] != "ok":
        return cells
    even = [row["break_even"], row["break_even_strongest"]]
    runs = ["never" if count != count else fixed(count, 1) for count in even]
    return [*cells, fixed(row["offline_us"], 0), *runs]


def _details(row: dict, counts: Iterable[str], outputs: Iterable[str]) -> list[str]:
    cells = [row["label"], str(row["rank"]), number(row["tolerance"])]
    cells += [str(row[name]) for name in counts]
    if row["status"] != "ok":
        return [*cells, row["status"]]
    return [*cells, *(power(row[f"rms_{output}"]) for output in outputs)]
