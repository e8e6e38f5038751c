"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.report.timing import BASELINE, STRONGEST, timing

if TYPE_CHECKING:
    import pandas as pd


def cost_table(model: str, folder: Path) -> pd.DataFrame:
    """Cost of every contestant of a model on its nominal maneuver.

    Returns
    -------
    pandas.DataFrame
        `us_per_run`, `ns_per_sample`, counts, `speed_up` (against Newton's method with fresh
        Jacobians, the paper's kind of baseline), `speed_up_strongest` (against the strongest
        full-order solver), `offline_us`, and the number of runs after which a reduced model has
        paid for its training against either baseline (missing where it never does).
    """
    import pandas as pd

    data = timing(model, folder)
    seconds = data["seconds"]
    rows = []
    for label in data["contestant"].values:
        row = data.sel(contestant=label)
        own, offline = float(row["seconds"]), float(row["offline_seconds"])
        entry: dict[str, object] = {
            "contestant": str(label),
            "rank": int(row["effective_rank"]),
            "us_per_run": own * 1e6,
            "ns_per_sample": float(row["seconds_per_sample"]) * 1e9,
            "iterations": int(row["iterations"]),
            "residual_evaluations": int(row["residual_evaluations"]),
            "jacobian_evaluations": int(row["jacobian_evaluations"]),
        }
        for name, baseline in (("speed_up", BASELINE), ("speed_up_strongest", STRONGEST)):
            other = float(seconds.sel(contestant=baseline))
            entry[name] = other / own if own > 0.0 else float("nan")
        entry["offline_us"] = offline * 1e6
        for name, baseline in (("break_even", BASELINE), ("break_even_strongest", STRONGEST)):
            saved = float(seconds.sel(contestant=baseline)) - own
            pays = saved > 0.0 and offline > 0.0
            entry[name] = offline / saved if pays else float("nan")
        rows.append(entry)
    return pd.DataFrame(rows)


def printed_costs(folder: Path) -> str:
    """Cost tables of all timed models as text."""
    from vehiclemor.report.timing import CONTESTANTS

    parts = []
    for model in CONTESTANTS:
        data = timing(model, folder)
        table = cost_table(model, folder)
        lines = [
            f"Cost on {model}, nominal input ({data.attrs['title']}; {data.attrs['machine']})",
            (
                "speed-up x1: against Newton with fresh Jacobians; x2: against the strongest "
                "full-order solver"
            ),
            (
                f"{'':<22}{'rank':>5}{'us/run':>9}{'ns/point':>10}{'iterations':>12}"
                f"{'residuals':>11}{'Jacobians':>11}{'x1':>7}{'x2':>7}{'offline us':>12}"
                f"{'break-even x1/x2 (runs)':>26}"
            ),
        ]
        for row in table.to_dict("records"):
            speed = f"{_cell(row['speed_up'], 2):>7}{_cell(row['speed_up_strongest'], 2):>7}"
            even = f"{_even(row['break_even'])} / {_even(row['break_even_strongest'])}"
            if row["offline_us"] == 0.0:
                even = "-"
            lines.append(
                f"{row['contestant']:<22}{row['rank']:>5}{row['us_per_run']:>9.1f}"
                f"{row['ns_per_sample']:>10.1f}{row['iterations']:>12}"
                f"{row['residual_evaluations']:>11}{row['jacobian_evaluations']:>11}"
                f"{speed}{row['offline_us']:>12.1f}{even:>26}"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _cell(value: float, digits: int) -> str:
    return "-" if value != value else f"{value:.{digits}f}"


def _even(value: float) -> str:
    return "never" if value != value else f"{value:.1f}"
