"""What the chosen reduced model must reach, and what it has reached."""

import math
from typing import Any

import xarray as xr

from vehiclemor.report.criteria.finding import OWN
from vehiclemor.report.labels import unit_of
from vehiclemor.report.verdicts import NOT_COMPARABLE, judged, scatter
from vehiclemor.study.plans.study_file import SpeedTarget, Straight, StudyFile

Row = dict[str, Any]
# Of the bounds of rates.
CONFIDENCE = 0.95


def error_columns(protocol: StudyFile) -> dict[str, tuple[str, str]]:
    """Name of a column of errors -> (output, measure): the bounded outputs, then the reported."""
    bounded = {
        f"{bound.measure}_{output}": (output, bound.measure)
        for output, bound in protocol.bounds.items()
    }
    return bounded | {f"rms_{output}": (output, "rms") for output in protocol.reported}


def upper_bound(misses: int, runs: int) -> float:
    """Rate of misses that so many in so many runs exclude at 95 % (C. Clopper, E. Pearson, 1934).

    The one-sided exact bound: without a miss in 299 runs it is below 1 %.
    """
    from scipy.stats import binomtest

    if runs == 0:
        return 1.0
    test = binomtest(misses, runs, alternative="less")
    return float(test.proportion_ci(CONFIDENCE, method="exact").high)


def ratio(other: Row | None, row: Row) -> float:
    """How many times the other's time a row's is; none for a row that computes nothing."""
    return other["seconds"] / row["seconds"] if other and row["seconds"] > 0.0 else math.nan


def chosen(rows: list[Row]) -> Row | None:
    """The contender that validation has chosen."""
    return next((row for row in rows if row["winner"]), None)


def target_rows(dataset: xr.Dataset, protocol: StudyFile, methods: list[Row]) -> list[Row]:
    """What the chosen one must reach: misses, warnings, ratios, the straight line."""
    winner = chosen(methods)
    if winner is None:
        return []
    runs = f"of {winner['runs']} runs"
    rows = [_at_most("silent misses", 0, winner["silent"], runs)]
    flagged = f"{winner['flagged']} flagged {runs}"
    most = protocol.flagged_misses
    rows.append(_at_most("flagged misses", most, winner["flagged_misses"], flagged))
    if protocol.failure_rate is not None:
        reason = f"{winner['misses']} misses {runs}, Clopper-Pearson, 95 %"
        rows.append(
            _at_most("failure rate below", protocol.failure_rate, winner["rate_bound"], reason)
        )
    if winner["outside_runs"]:
        reason = (
            f"of {winner['outside_runs']} runs, {winner['outside_flagged']} flagged, "
            f"{winner['outside_misses']} outside of the bounds"
        )
        rows.append(_at_most("silent misses outside", 0, winner["outside_silent"], reason))
    if protocol.straight is not None:
        rows.append(_straight_row(dataset, protocol.straight, winner))
    rows += [_ratio_row(target, winner, methods) for target in protocol.targets]
    name = {"kind": "target", "model": protocol.model, "label": winner["label"]}
    return [name | {"id": row["item"].replace(" ", "_")} | row for row in rows]


def _at_least(item: str, bound: float, measured: float, reason: str) -> Row:
    row = {"item": item, "bound": bound, "measured": measured, "unit": "1", "reason": reason}
    return row | {"verdict": judged(measured >= bound), "threshold_source": OWN}


def _at_most(item: str, bound: float, measured: float, reason: str, unit: str = "1") -> Row:
    row = _at_least(item, bound, measured, reason)
    return row | {"unit": unit, "verdict": judged(measured <= bound)}


def _straight_row(dataset: xr.Dataset, straight: Straight, winner: Row) -> Row:
    """Largest value of an output in the scenarios without steering."""
    here = [str(s).startswith(f"{straight.maneuver},") for s in dataset["scenario"].values]
    part = dataset.isel(scenario=here).sel(label=winner["label"], output=straight.output)
    measured = float(part["largest_output"].max(skipna=False)) if any(here) else math.nan
    reason = f"first 10 s of {straight.maneuver}, {sum(here)} runs"
    item = f"largest {straight.output} without steering"
    return _at_most(item, straight.bound, measured, reason, unit_of(dataset, straight.output))


def _ratio_row(target: SpeedTarget, winner: Row, methods: list[Row]) -> Row:
    """Speed-up of whole calls against the full order, unless one of the times scatters."""
    if target.against == "equal accuracy":
        names, factor = winner["equal_rows"].split(", "), winner["ratio_equal"]
        beside = f"; compiled loops alone {winner['ratio_equal_loop']:.2g}"
    else:
        name = winner["within"] if target.against == "within bounds" else target.against
        names, beside = [name], ""
        factor = ratio(next((row for row in methods if row["label"] == name), None), winner)
    found = " and ".join(filter(None, names))
    reason = f"against {found}" if found else "no full-order row is as accurate"
    reason += beside + (f"; the aim is {target.aim:g}" if target.aim else "")
    row = _at_least(f"speed-up, {target.against}", target.ratio, factor, reason)
    timed = [r for r in methods if r["label"] in {winner["label"], *names}]
    scattered = scatter({r["label"]: r["spread"] for r in timed})
    if scattered:
        row |= {"verdict": NOT_COMPARABLE, "reason": f"{scattered}; {reason}"}
    return row
