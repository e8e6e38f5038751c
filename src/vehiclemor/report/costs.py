"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from pathlib import Path

import pandas as pd
import xarray as xr

from vehiclemor.models.report import baselines, printed_counts, printed_outputs, timing_cases
from vehiclemor.registry import component
from vehiclemor.report.labels import label_of
from vehiclemor.report.printing import Row, fixed, power, table_text, wrapped
from vehiclemor.simulation.build import build
from vehiclemor.study.timing import timed_model


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
    data = _timing(model, folder)
    rows = [
        _row(data.sel(start=start, case=case), list(printed_counts(component("model", model))))
        for start in data["start"].values
        for case in data["case"].values
    ]
    return pd.DataFrame(rows)


def _timing(model: str, folder: Path) -> xr.Dataset:
    cases = timing_cases(component("model", model))
    return timed_model(build(model), cases, folder, f"timing-{model}")


def _row(data: xr.Dataset, counts: list[str]) -> dict[str, object]:
    """One case from one start."""
    own, offline = float(data["seconds"]), float(data["offline_seconds"])
    spread = float(data["seconds_upper"] - data["seconds_lower"])
    status = str(data["status"].item())
    speed_ups = {name: float(data[name]) for name in ("speed_up", "speed_up_strongest")}
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
        **{f"rms_{o}": float(data["rms_error"].sel(output=o)) for o in data["output"].values},
        "offline_us": offline * 1e6,
        "break_even": even[0],
        "break_even_strongest": even[1],
    }


def costs_text(model: str, folder: Path) -> str:
    """The cost table of a model as text: times and counts, then errors and training."""
    data, table = _timing(model, folder), cost_table(model, folder)
    definition = component("model", model)
    counts, outputs = printed_counts(definition), printed_outputs(definition)
    baseline, strongest = baselines(definition)
    title = f"Cost on {model}, nominal input ({data.attrs['title']}; {data.attrs['machine']})"
    legend = (
        f"speed-up x1: against {baseline}; x2: against {strongest}; break-even in runs; "
        f"+-%: half the quartile spread; errors are RMS"
    )
    times: list[Row] = []
    errors: list[Row] = []
    starts = list(dict.fromkeys(table["start"]))
    for start in starts:
        if len(starts) > 1:
            times.append(Row([f"start {start}"]))
            errors.append(Row([f"start {start}"]))
        for row in table.to_dict(orient="records"):
            if row["start"] == start:
                times.append(Row(_times(row, list(counts))))
                errors.append(Row(_errors(row, outputs)))
    heads = ["", "rank", "tol.", "us/run", "+-%", "ns/ point", *counts.values(), "x1", "x2"]
    found = [f"{label_of(output).short} error" for output in outputs]
    tails = ["", *found, "offline us", "break-even x1", "break-even x2"]
    tables = table_text(heads, times), table_text(tails, errors)
    return "\n".join([wrapped(title), wrapped(legend), "\n\n".join(tables)])


def _times(row: dict, counts: list[str]) -> list[str]:
    cells = [row["label"], str(row["rank"]), power(row["tolerance"]), fixed(row["us_per_run"], 1)]
    cells += [fixed(50.0 * row["quartile_spread"], 0), fixed(row["ns_per_sample"], 1)]
    cells += [str(row[name]) for name in counts]
    return [*cells, fixed(row["speed_up"]), fixed(row["speed_up_strongest"])]


def _errors(row: dict, outputs: tuple[str, ...]) -> list[str]:
    if row["status"] != "ok":
        return [row["label"], row["status"]]
    cells = [row["label"], *(f"{row[f'rms_{output}']:.1e}" for output in outputs)]
    if row["offline_us"] == 0.0:
        return [*cells, fixed(0.0, 1), "-", "-"]
    even = [row["break_even"], row["break_even_strongest"]]
    runs = ["never" if count != count else fixed(count, 1) for count in even]
    return [*cells, fixed(row["offline_us"], 1), *runs]
