"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.printing import Column, column, table, wrapped
from vehiclemor.report.shown import main_outputs, of_kind, timing_cases
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import Experiment, complete_settings, make_experiment
from vehiclemor.study.plans.study_file import MethodEntry
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.timing import timed_starts


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
    built, cases = build(model), timing_cases(component("model", model))
    maneuver = built.definition.maneuver
    runs = {start: Scenario.of(maneuver, (1.0, 1.0), start) for start in built.starts}
    experiments = {
        start: {case.id: _experiment(built, case, run) for case in cases}
        for start, run in runs.items()
    }
    data = timed_starts(experiments, folder / "studies" / f"timing-{model}.nc")
    return data.assign_coords(label=("case", [case.label for case in cases]))


def _experiment(model: Model, case: MethodEntry, run: Scenario) -> Experiment:
    """A case, trained on the run that is timed."""
    settings = complete_settings(model, case.method, case.settings, case.preset)
    return make_experiment(model, case.method, settings, (run,), (run,), "metrics")


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
    counts = {name: Column(heading, ".0f") for name, heading in kind.counts.items()}
    times = ["label", "us_per_run", "spread", "speed_up", "speed_up_strongest", "offline_us"]
    times += ["break_even", "break_even_strongest"]
    title = f"Cost on {data.attrs['title'].removeprefix('timing of ')} ({data.attrs['machine']})"
    against = f"same: against {kind.against[0]}; best: against {kind.against[1]}; -: never, or none"
    parts = [wrapped(title), table(rows, times, group="from", explain=not brief), wrapped(against)]
    if not brief:
        columns = {name: column(name) for name in ("label", "rank", "tolerance")} | counts
        errors = {f"rms_{o}": column(f"rms_{o}") for o in main_outputs(definition)}
        parts += ["", table(rows, columns | errors, group="from")]
    return "\n".join(parts)
