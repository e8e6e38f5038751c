"""Cost table: seconds, counts, speed-up against both baselines, offline cost, break-even."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.report.timing import BASELINE, STRONGEST, timing

if TYPE_CHECKING:
    import pandas as pd

# Per model: the error that is printed beside the times.
ERROR_COLUMN = {"double_wishbone": "rms_second_euler_angle"}
# Columns of the table, of which a model has those that its solvers count.
COUNTS = (
    "iterations",
    "residual_evaluations",
    "rhs_calls",
    "steps",
    "rejected_steps",
    "jacobian_evaluations",
    "factorisations",
)


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
            **{name: int(row[name]) for name in COUNTS if name in data},
            "tolerance": float(row["tolerance"]),
            "quartile_spread": _share(float(row["seconds_upper"] - row["seconds_lower"]), own),
        }
        for name in ("speed_up", "speed_up_strongest"):
            entry[name] = float(row[name])
        for output in data["output"].values:
            entry[f"rms_{output}"] = float(row["rms_error"].sel(output=output))
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
                "speed-up x1: against Newton with fresh Jacobians at 1e-12; x2: against the "
                "strongest full-order solver; break-even in runs; +-%: half the quartile spread"
            ),
            (
                f"{'':<25}{'rank':>5}{'tol.':>7}{'us/run':>8}{'+-%':>5}{'ns/point':>9}"
                f"{'iterations':>11}{'residuals':>10}{'Jacobians':>10}{'x1':>6}{'x2':>6}"
                f"{'RMS angle':>10}{'offline us':>11}{'break-even x1/x2':>17}"
            ),
        ]
        for row in table.to_dict("records"):
            speed = f"{_cell(row['speed_up'], 2):>6}{_cell(row['speed_up_strongest'], 2):>6}"
            even = f"{_even(row['break_even'])} / {_even(row['break_even_strongest'])}"
            if row["offline_us"] == 0.0:
                even = "-"
            lines.append(
                f"{row['contestant']:<25}{row['rank']:>5}{_power(row['tolerance']):>7}"
                f"{row['us_per_run']:>8.1f}{50.0 * row['quartile_spread']:>5.0f}"
                f"{row['ns_per_sample']:>9.1f}{row['iterations']:>11}"
                f"{row['residual_evaluations']:>10}{row['jacobian_evaluations']:>10}"
                f"{speed}{row[ERROR_COLUMN[model]]:>10.1e}{row['offline_us']:>11.1f}{even:>17}"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0


def _power(value: float) -> str:
    return "-" if value != value else f"{value:.0e}"


def _cell(value: float, digits: int) -> str:
    return "-" if value != value else f"{value:.{digits}f}"


def _even(value: float) -> str:
    return "never" if value != value else f"{value:.1f}"
