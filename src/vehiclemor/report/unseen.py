"""Methods on inputs that they were not trained on: errors, times beside full order, targets.

Times of the full order at the error of a method are interpolated on work-precision curves, each of
one integrator at several tolerances.  Between two useful rows a curve is a power law, which is what
an integrator of fixed order gives.  One that ends just above the error is continued by the law of
its last two rows: else a slower integrator would stand in for it.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise, product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from vehiclemor.report.labels import unit_of
from vehiclemor.report.published import NOT_COMPARABLE, judged, scatter
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.choice import errors_by, outcomes
from vehiclemor.study.plans.protocol import FULL_ORDER
from vehiclemor.study.plans.results import judged_part, judged_set
from vehiclemor.study.plans.study_file import ProtocolFile, SpeedTarget

Row = dict[str, Any]
OUTSIDE = ("outside", "drawn_outside")
# Column of seconds -> its ratio to the full order at equal error.
CLOCKS = {"seconds": "ratio_equal", "loop_seconds": "ratio_equal_loop"}
# SI unit of a bounded output -> the unit in which errors are printed, and its factor.
PRINTED_UNITS = {"m": ("m", 1.0), "rad": ("deg", 180.0 / math.pi)}
# A work-precision curve is continued to this part of the error of its last row.
CONTINUED = 0.5


def protocol_rows(dataset: xr.Dataset) -> list[Row]:
    """Rows of one protocol, by `kind`: `method`, then `target` and `bound` of what was chosen."""
    protocol = protocol_of(dataset)
    methods = method_rows(dataset)
    rows = methods + target_rows(dataset, protocol, methods)
    rows += [row for method in methods if method["winner"] for row in bound_rows(protocol, method)]
    head = {"study": str(dataset.attrs["study"]), "model": protocol.model}
    return [head | row for row in rows]


def protocol_of(dataset: xr.Dataset) -> ProtocolFile:
    """The protocol of a combined dataset."""
    return ProtocolFile.model_validate_json(dataset.attrs["configuration"])


def method_rows(dataset: xr.Dataset) -> list[Row]:
    """One row for each method, full-order integrators as measures.

    `runs` of the `test_set` are judged, `apart` ones more are not: the full order is sensitive
    there.  Of the runs `misses` miss a bound, `silent` ones with the status ok; of `flagged` ones
    the model says that it has left what it knows.  `score` is the largest error of a bounded output
    as a multiple of its bound (infinite if a run has failed), `worst_MEASURE_OUTPUT` and `most_...`
    the largest error and the 99 % quantile; `median_m`, `worst_deg` and so on are of the largest
    error of all bounded positions or angles, `misses_at_ten` of ten times the bounds.
    `chosen_settings` are those of the candidate that validation chose.  `seconds` is the mean of
    whole calls, `loop_seconds` of their compiled loops, with the `spread` of the rounds
    (interquartile range over median).
    `ratio_equal` and `ratio_equal_loop` are against the full order interpolated at the row's
    score on the rows `equal_rows`, `ratio_within` against `within`, the fastest full-order row
    within the bounds.
    """
    part, protocol = judged_part(dataset), protocol_of(dataset)
    rows = [_method_row(dataset, part, str(label), protocol) for label in part["label"].values]
    full = [row for row in rows if row["role"] == FULL_ORDER and math.isfinite(row["score"])]
    curves = [list(group) for _, group in groupby(full, key=lambda row: row["series"])]
    return [row | _ratios_to_full_order(row, full, curves) for row in rows]


def _method_row(dataset: xr.Dataset, judged: xr.Dataset, label: str, protocol: ProtocolFile) -> Row:
    part, every = judged.sel(label=label), dataset.sel(label=label)
    sets = dataset["scenario_set"].values
    outside = outcomes(every.isel(scenario=np.isin(sets, OUTSIDE)), protocol.bounds)
    tested = outcomes(part, protocol.bounds)
    row: Row = {
        "kind": "method",
        "label": label,
        **{name: str(part[name].item()) for name in ("series", "role", "method", "settings")},
        "rank": int(part["effective_rank"]),
        "winner": bool(part["winner"]),
        "test_set": str(dataset.attrs["test_set"]),
        **tested.counts,
        "apart": int((sets == judged_set(set(sets))).sum()) - part.sizes["scenario"],
        "misses_at_ten": int((tested.scores > 10.0).sum()),
        "score": float(tested.scores.max()),
        # What has come to its end, trusted or not.
        "stable_share": float(np.isfinite(tested.scores).mean()),
        "failure": _failure(part),
        **{f"outside_{name}": number for name, number in outside.counts.items()},
        "validation_score": float(part["validation_score"]),
        "offline_seconds": float(part["offline_seconds"]),
        "chosen_settings": _chosen_settings(json.loads(part["validation"].item())),
    }
    row |= _errors_in_units(part, protocol)
    for name, (output, measure) in error_columns(protocol).items():
        errors: Any = errors_by(part, output, measure).to_series()
        # Of the runs that have come to their end.
        errors = errors[np.isfinite(errors)]
        row |= {f"worst_{name}": float(errors.max()), f"most_{name}": float(errors.quantile(0.99))}
    # Means over the runs that were timed; the spread of all of them together.
    times = {n: float(part[n].mean()) for n in (*CLOCKS, "seconds_lower", "seconds_upper")}
    spread = times.pop("seconds_upper") - times.pop("seconds_lower")
    return row | times | {"spread": spread / times["seconds"] if times["seconds"] > 0.0 else 0.0}


def count_rows(dataset: xr.Dataset) -> Iterator[Row]:
    """How many runs of each reduced model are right, warned and so on: all, by maneuver or log."""
    bounds, sets = protocol_of(dataset).bounds, dataset["scenario_set"].values
    tested = dataset.isel(scenario=sets == judged_set(set(sets)))
    part = judged_part(dataset)
    reduced = part["label"].values[part["role"].values != FULL_ORDER]
    for label, name in product(reduced, ["all", *dict.fromkeys(tested["maneuver"].values)]):
        here, there = (np.isin(d["maneuver"], name) | (name == "all") for d in (part, tested))
        counts = outcomes(part.sel(label=label).isel(scenario=here), bounds).counts
        apart = int(there.sum() - here.sum())
        yield {"item": name, "label": str(label), **counts, "apart": apart}


def _chosen_settings(candidates: list[Row]) -> str:
    """What sets the chosen candidate apart from the others; empty if there is no other."""
    tables = [candidate["settings"] for candidate in candidates]
    chosen = next(candidate["settings"] for candidate in candidates if candidate["chosen"])
    differing = [name for name in chosen if any(table[name] != chosen[name] for table in tables)]
    return ", ".join(f"{name}={chosen[name]}" for name in differing)


def _errors_in_units(part: xr.Dataset, protocol: ProtocolFile) -> dict[str, float]:
    """Median and worst run, by the largest error of all outputs whose bounds are in a unit."""
    columns = {}
    for si_unit, (unit, factor) in PRINTED_UNITS.items():
        errors = [
            errors_by(part, output, bound.measure).values
            for output, bound in protocol.bounds.items()
            if bound.measure != "relative" and unit_of(part, output) == si_unit
        ]
        of_runs = factor * np.max(errors or [[math.nan]], axis=0)
        finite = of_runs[np.isfinite(of_runs)]
        columns[f"median_{unit}"] = float(np.median(finite)) if finite.size else math.nan
        columns[f"worst_{unit}"] = float(finite.max(initial=0.0)) if finite.size else math.nan
    return columns


def error_columns(protocol: ProtocolFile) -> dict[str, tuple[str, str]]:
    """Name of a column of errors -> (output, measure): the bounded outputs, then the reported."""
    bounded = {f"{b.measure}_{o}": (o, b.measure) for o, b in protocol.bounds.items()}
    return bounded | {f"rms_{output}": (output, "rms") for output in protocol.reported}


def _failure(part: xr.Dataset) -> str:
    """The first failure of a row, empty if there is none."""
    failed = ~np.isin(part["status"].values, FINISHED)
    if not failed.any():
        return ""
    run = part.isel(scenario=int(failed.argmax()))
    return f"{run['status'].item()} in ({run['scenario'].item()}): {run['message'].item()}"


def _ratios_to_full_order(row: Row, full: list[Row], curves: list[list[Row]]) -> Row:
    within = (other for other in full if other["misses"] == 0)
    best = min(within, key=lambda other: other["seconds"], default=None)
    equal = {clock: at_error(curves, row["score"], clock) for clock in CLOCKS}
    ratios: Row = {"equal_rows": ", ".join(equal["seconds"].rows)}
    ratios |= {"within": best["label"] if best else "", "ratio_within": ratio(best, row)}
    for clock, name in CLOCKS.items():
        # A recording that is played again is no solution of anything.
        solves = row["method"] != "replay" and row[clock]
        ratios[name] = equal[clock].seconds / row[clock] if solves else math.nan
    return ratios


def ratio(other: Row | None, row: Row) -> float:
    """How many times the other's time a row's is; none for a row that computes nothing."""
    return other["seconds"] / row["seconds"] if other and row["seconds"] > 0.0 else math.nan


class Equal(NamedTuple):
    """The fastest full order at an error: seconds of a run, and the rows between which it lies.

    The seconds are NaN if no curve reaches the error.
    """

    seconds: float
    rows: tuple[str, ...] = ()


def at_error(curves: Iterable[Sequence[Row]], error: float, clock: str) -> Equal:
    """The fastest of all work-precision curves at an error (a score), by a column of seconds."""
    equals = [_on_curve(_useful(curve, clock), error, clock) for curve in curves]
    reached = [equal for equal in equals if not math.isnan(equal.seconds)]
    return min(reached, key=lambda equal: equal.seconds, default=Equal(math.nan))


def _useful(curve: Sequence[Row], clock: str) -> list[Row]:
    """Rows of which none of the curve is both faster and more accurate, least accurate first."""
    useful: list[Row] = []
    for row in sorted(curve, key=lambda row: (row[clock], row["score"])):
        if row[clock] > 0.0 and (not useful or row["score"] < useful[-1]["score"]):
            useful.append(row)
    return useful


def _on_curve(curve: Sequence[Row], error: float, clock: str) -> Equal:
    """Seconds at an error: looser than all rows, between two of them, or just beyond the last."""
    # A row that has failed has the error NaN, and is nowhere on a curve.
    if not curve or math.isnan(error):
        return Equal(math.nan)
    if error >= curve[0]["score"]:
        return Equal(curve[0][clock], (curve[0]["label"],))
    for loose, tight in pairwise(curve):
        reach = CONTINUED if tight is curve[-1] else 1.0
        if error >= reach * tight["score"]:
            return _interpolated(loose, tight, error, clock)
    return Equal(math.nan)


def _interpolated(loose: Row, tight: Row, error: float, clock: str) -> Equal:
    """Seconds at an error on the line through two rows in logarithms, also beyond them."""
    if tight["score"] <= 0.0:
        return Equal(tight[clock], (tight["label"],))
    part = math.log(error / loose["score"]) / math.log(tight["score"] / loose["score"])
    seconds = loose[clock] * (tight[clock] / loose[clock]) ** part
    return Equal(seconds, (loose["label"], tight["label"]))


def upper_bound(misses: int, runs: int) -> float:
    """Rate of misses that so many in so many runs exclude at 95 % (C. Clopper, E. Pearson, 1934).

    The one-sided exact bound: without a miss in 299 runs it is below 1 %.
    """
    from scipy.stats import binomtest

    if runs == 0:
        return 1.0
    test = binomtest(misses, runs, alternative="less")
    return float(test.proportion_ci(0.95, method="exact").high)


def bound_rows(protocol: ProtocolFile, winner: Row) -> Iterator[Row]:
    """Errors of what was chosen, each beside its bound and the bound's reason."""
    for name, (output, measure) in error_columns(protocol).items():
        bound = protocol.bounds.get(output)
        row = {"kind": "bound", "label": winner["label"], "item": output, "measure": measure}
        row |= {"worst": winner[f"worst_{name}"], "most": winner[f"most_{name}"]}
        row |= {"bound": bound.bound, "reason": bound.reason} if bound else {"reason": ""}
        yield row


def target_rows(dataset: xr.Dataset, protocol: ProtocolFile, methods: list[Row]) -> list[Row]:
    """What the chosen one must reach: misses, warnings, ratios, the straight line."""
    winner = next((row for row in methods if row["winner"]), None)
    if winner is None:
        return []
    runs, misses = f"of {winner['runs']} runs", winner["misses"]
    warned = f"{winner['flagged']} warned {runs}"
    rows = [
        _target("undetected failures", 0, winner["silent"], runs),
        _target(
            "failures with a warning", protocol.flagged_misses, misses - winner["silent"], warned
        ),
    ]
    if protocol.failure_rate is not None:
        rate, reason = upper_bound(misses, winner["runs"]), "Clopper-Pearson, 95 %"
        reason = f"{misses} misses {runs}, {reason}"
        rows.append(_target("failure rate below", protocol.failure_rate, rate, reason))
    if winner["outside_runs"]:
        reason = (
            f"of {winner['outside_runs']} runs, {winner['outside_flagged']} warned, "
            f"{winner['outside_misses']} outside of the bounds"
        )
        rows.append(_target("undetected failures outside", 0, winner["outside_silent"], reason))
    if straight := protocol.straight:
        here = [str(s).startswith(f"{straight.maneuver},") for s in dataset["scenario"].values]
        part = dataset["largest_output"].isel(scenario=here)
        part = part.sel(label=winner["label"], output=straight.output)
        largest = float(part.max(skipna=False)) if any(here) else math.nan
        item = f"largest {straight.output} without steering"
        reason = f"first 10 s of {straight.maneuver}, {sum(here)} runs"
        row = _target(item, straight.bound, largest, reason)
        rows.append(row | {"unit": unit_of(dataset, straight.output)})
    rows += [_speed_target(target, winner, methods) for target in protocol.targets]
    head = {"kind": "target", "label": winner["label"]}
    return [head | {"id": row["item"].replace(" ", "_")} | row for row in rows]


def _target(item: str, bound: float, measured: float, reason: str, sign: float = 1.0) -> Row:
    """What is at most a bound, or at least with the sign -1."""
    row = {"item": item, "bound": bound, "measured": measured, "unit": "1", "reason": reason}
    return row | {"verdict": judged(sign * measured <= sign * bound)}


def _speed_target(target: SpeedTarget, winner: Row, methods: list[Row]) -> Row:
    """Speed-up of whole calls against the full order, unless one of the times scatters."""
    if target.against == "equal accuracy":
        names, factor = winner["equal_rows"].split(", "), winner["ratio_equal"]
        beside = f"; compiled loops alone {winner['ratio_equal_loop']:.2g}"
    else:
        name = winner["within"] if target.against == "within bounds" else target.against
        names, beside = [name], ""
        factor = ratio(next((row for row in methods if row["label"] == name), None), winner)
    rivals = " and ".join(filter(None, names))
    is_full = any(row["role"] == FULL_ORDER for row in methods)
    missing = "no full-order row is as accurate" if is_full else "`rows` takes no full order"
    reason = f"against {rivals}{beside}" if rivals else missing
    if target.aim:
        reason += f"; the aim is {target.aim:g}"
    row = _target(f"speed-up, {target.against}", target.ratio, factor, reason, -1.0)
    timed = [r for r in methods if r["label"] in {winner["label"], *names}]
    scattered = scatter({r["label"]: r["spread"] for r in timed})
    if scattered:
        row |= {"verdict": NOT_COMPARABLE, "reason": f"{scattered}; {reason}"}
    return row
