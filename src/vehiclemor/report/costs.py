"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.report.timing_cases import COST_TABLES
from vehiclemor.simulation.build import build
from vehiclemor.study.timing import timed_model

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def timings(model: str, folder: Path) -> xr.Dataset:
    """Stored timing of the cases of a model, measured first if it is missing or out of date."""
    return timed_model(build(model), COST_TABLES[model].cases, folder, f"timing-{model}")


def cost_table(model: str, folder: Path) -> pd.DataFrame:
    """Cost of every case of a model on its nominal maneuver, from every start.

    Returns
    -------
    pandas.DataFrame
        `us_per_run`, `ns_per_sample`, counts, `speed_up` (against the paper's kind of baseline),
        `speed_up_strongest` (against the strongest full-order solver), errors, `offline_us`, and
        the number of runs after which a reduced model has paid for its training against either
        baseline (missing where it never does).
    """
    import pandas as pd

    data = timings(model, folder)
    rows = [row for start in data["start"].values for row in _rows(model, data.sel(start=start))]
    return pd.DataFrame(rows)


def _rows(model: str, data: xr.Dataset) -> list[dict[str, object]]:
    """Rows of one start."""
    rows: list[dict[str, object]] = []
    for case in data["case"].values:
        row = data.sel(case=case)
        own, offline = float(row["seconds"]), float(row["offline_seconds"])
        entry: dict[str, object] = {
            "start": str(data["start"].item()),
            "case": str(case),
            "contestant": str(row["label"].item()),
            "status": str(row["status"].item()),
            "rank": int(row["effective_rank"]),
            "us_per_run": own * 1e6,
            "ns_per_sample": float(row["seconds_per_sample"]) * 1e9,
            **{name: int(row[name]) for name in COST_TABLES[model].counts},
            "tolerance": float(row["tolerance"]),
            "quartile_spread": _share(float(row["seconds_upper"] - row["seconds_lower"]), own),
        }
        for name in ("speed_up", "speed_up_strongest"):
            entry[name] = float(row[name])
        for output in data["output"].values:
            entry[f"rms_{output}"] = float(row["rms_error"].sel(output=output))
        entry["offline_us"] = offline * 1e6
        for name, ratio in (
            ("break_even", float(row["speed_up"])),
            ("break_even_strongest", float(row["speed_up_strongest"])),
        ):
            # Time saved in a run; a run that has failed saves nothing.
            saved = own * (ratio - 1.0) if entry["status"] == "ok" else 0.0
            pays = saved > 0.0 and offline > 0.0
            entry[name] = offline / saved if pays else float("nan")
        rows.append(entry)
    return rows


def printed_costs(folder: Path) -> str:
    """Cost tables of all timed models as text."""
    return "\n\n".join(_printed(model, folder) for model in COST_TABLES)


def _printed(model: str, folder: Path) -> str:
    data, table, shown = timings(model, folder), cost_table(model, folder), COST_TABLES[model]
    head = f"{'':<27}{'rank':>5}{'tol.':>8}{'us/run':>9}{'+-%':>5}{'ns/point':>9}"
    head += "".join(f"{heading:>11}" for heading in shown.counts.values())
    head += f"{'x1':>7}{'x2':>7}" + "".join(f"{_heading(name):>10}" for name in shown.errors)
    lines = [
        f"Cost on {model}, nominal input ({data.attrs['title']}; {data.attrs['machine']})",
        (
            f"speed-up x1: against {shown.baseline}; x2: against {shown.strongest}; "
            f"break-even in runs; +-%: half the quartile spread; errors are RMS"
        ),
        f"{head}{'offline us':>11}{'break-even x1/x2':>17}",
    ]
    starts = list(dict.fromkeys(table["start"]))
    for start in starts:
        if len(starts) > 1:
            lines.append(f"start {start}")
        rows = table.loc[table["start"] == start].to_dict(orient="records")
        lines += [_line(dict(row), shown.counts, shown.errors) for row in rows]
    return "\n".join(lines)


def _line(row: dict, counts: Iterable[str], errors: Iterable[str]) -> str:
    text = f"{row['contestant']:<27}{row['rank']:>5}{_power(row['tolerance']):>8}"
    text += f"{row['us_per_run']:>9.1f}{50.0 * row['quartile_spread']:>5.0f}"
    text += f"{row['ns_per_sample']:>9.1f}" + "".join(f"{row[name]:>11}" for name in counts)
    text += f"{_cell(row['speed_up'], 2):>7}{_cell(row['speed_up_strongest'], 2):>7}"
    if row["status"] != "ok":
        return f"{text}  {row['status']}"
    text += "".join(f"{row[f'rms_{name}']:>10.1e}" for name in errors)
    even = f"{_even(row['break_even'])} / {_even(row['break_even_strongest'])}"
    if row["offline_us"] == 0.0:
        even = "-"
    return f"{text}{row['offline_us']:>11.1f}{even:>17}"


def _heading(output: str) -> str:
    short = {
        "second_euler_angle": "angle",
        "lateral_position": "Y",
        "lateral_speed": "v_y",
        "vertical_speed": "v_z",
    }
    return short.get(output, output)


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0


def _power(value: float) -> str:
    return "-" if value != value else f"{value:.1e}".replace(".0e", "e")


def _cell(value: float, digits: int) -> str:
    return "-" if value != value else f"{value:.{digits}f}"


def _even(value: float) -> str:
    return "never" if value != value else f"{value:.1f}"
