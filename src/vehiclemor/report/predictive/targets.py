"""What the winner of the predictive comparison must reach, and what it has reached."""

import math
from typing import Any

import xarray as xr

from vehiclemor.report.criteria.finding import OWN, PRINTED
from vehiclemor.report.labels import unit_of
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.verdicts import NOT_COMPARABLE, judged, scatter
from vehiclemor.study.plans.protocol_file import ProtocolFile, SpeedTarget, Straight

Row = dict[str, Any]


def error_columns(protocol: ProtocolFile) -> dict[str, tuple[str, str]]:
    """Column -> (output, measure) of the bounded outputs and those reported beside them."""
    bounded = {
        f"worst_{bound.measure}_{output}": (output, bound.measure)
        for output, bound in protocol.bounds.items()
    }
    return bounded | {f"worst_rms_{output}": (output, "rms") for output in protocol.reported}


def ratio(other: Row | None, row: Row) -> float:
    """How many times the other's time a row's is; none for a row that computes nothing."""
    return other["seconds"] / row["seconds"] if other and row["seconds"] > 0.0 else math.nan


def target_rows(dataset: xr.Dataset, protocol: ProtocolFile, methods: list[Row]) -> list[Row]:
    """What the winner must reach: bounds, ratios, and the straight line without steering."""
    winner = next((row for row in methods if row["winner"]), None)
    if winner is None:
        return []
    rows = [_bound_row(dataset, protocol, winner, output) for output in protocol.bounds]
    stable = winner["stable_share"]
    rows.append(_at_least("share of stable runs", 1.0, stable, winner["failure"] or "test set"))
    if protocol.straight is not None:
        rows.append(_straight_row(dataset, protocol.straight, winner))
    rows += [_ratio_row(target, winner, methods) for target in protocol.targets]
    name = {"kind": "target", "model": protocol.model, "method": winner["method"]}
    return [name | {"id": row["item"].replace(" ", "_")} | row for row in rows]


def _at_least(item: str, bound: float, measured: float, reason: str) -> Row:
    row = {"item": item, "bound": bound, "measured": measured, "unit": "1", "reason": reason}
    return row | {"verdict": judged(measured >= bound), "threshold_source": OWN}


def _at_most(item: str, bound: float, measured: float, unit: str, reason: str) -> Row:
    row = _at_least(item, bound, measured, reason)
    return row | {"unit": unit, "verdict": judged(measured <= bound)}


def _bound_row(dataset: xr.Dataset, protocol: ProtocolFile, winner: Row, output: str) -> Row:
    bound = protocol.bounds[output]
    word = {"rms": "RMS", "max": "largest"}[bound.measure]
    row = _at_most(
        f"worst {word} error of {output}",
        bound.bound,
        winner[f"worst_{bound.measure}_{output}"],
        unit_of(dataset, output),
        f"test set; settings chosen on validation: {winner['settings']}",
    )
    printed = rms_numbers(protocol.model).get(output)
    published = printed is not None and bound.measure == "rms" and printed.value == bound.bound
    return row | {"threshold_source": PRINTED if published else OWN}


def _straight_row(dataset: xr.Dataset, straight: Straight, winner: Row) -> Row:
    """Largest value of an output in the scenarios without steering."""
    here = [str(s).startswith(f"{straight.maneuver},") for s in dataset["scenario"].values]
    part = dataset.isel(scenario=here).sel(row=winner["method"], output=straight.output)
    measured = float(part["largest_output"].max(skipna=False)) if any(here) else math.nan
    return _at_most(
        f"largest {straight.output} without steering",
        straight.bound,
        measured,
        unit_of(dataset, straight.output),
        f"first 10 s of {straight.maneuver}, {sum(here)} runs",
    )


def _ratio_row(target: SpeedTarget, winner: Row, methods: list[Row]) -> Row:
    """Speed-up of the winner against a full-order row, unless one of their times scatters."""
    aim = f"; the aim is {target.aim:g}" if target.aim else ""
    against = {"equal accuracy": winner["equal_accuracy"], "within bounds": winner["within"]}
    name = against.get(target.against, target.against)
    other = next((row for row in methods if row["method"] == name), None)
    reason = f"against {name}" if name else "no full-order row to compare with"
    if target.against == "equal accuracy" and not winner["equal_accuracy_reached"]:
        reason += ", the most accurate; none is as accurate"
    factor = ratio(other, winner)
    row = _at_least(f"speed-up, {target.against}", target.ratio, factor, reason + aim)
    scattered = scatter({r["method"]: r["spread"] for r in (winner, other) if r})
    if scattered:
        row |= {"verdict": NOT_COMPARABLE, "reason": f"{scattered}; {reason}{aim}"}
    return row
