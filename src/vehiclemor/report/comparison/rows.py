"""Rows of the comparison with the paper: its numbers and claims beside what is reproduced."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from vehiclemor.registry import names
from vehiclemor.report.criteria import CRITERIA, WITHOUT_REPLAY, Results
from vehiclemor.report.published import Claim, Number

if TYPE_CHECKING:
    import xarray as xr

# Label of a method in the paper's studies, and preset -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}
PRESETS = {"recommended": "default", "literal": "literal"}
PARAMETERS = "the paper's parameters were never published; ours are public data"


class Row(NamedTuple):
    """A published number or claim beside what is reproduced.

    Attributes
    ----------
    published
        The number, or the bound of the criterion of a claim.
    floor, replay
        The same quantity of the best approximation in the subspaces, and of replay.
    verdict
        `met`, `missed` or `not_comparable`.
    """

    model: str | None
    item: str
    published: float
    reproduced: float
    unit: str
    floor: float
    replay: float
    verdict: str
    reason: str


COLUMNS = Row._fields


def verdict(met: bool) -> str:
    """Word for whether a bound is met."""
    return "met" if met else "missed"


def not_comparable(
    model: str | None, item: str, reason: str, published: float = math.nan, unit: str = "-"
) -> Row:
    """Row of something that can't be reproduced."""
    missing = math.nan
    return Row(model, item, published, missing, unit, missing, missing, "not_comparable", reason)


def error_rows(number: Number, nominal: xr.Dataset) -> list[Row]:
    """One row for each variant of the method and start of the model."""
    study = nominal.sel(rank=number.states, output=number.quantity)
    starts = [str(start) for start in study["start"].values]
    return [
        _error_row(
            number,
            study.sel(start=start).squeeze(drop=True),
            label,
            f", {start}" if len(starts) > 1 else "",
        )
        for label in VARIANTS
        for start in starts
    ]


def _error_row(number: Number, nominal: xr.Dataset, label: str, origin: str) -> Row:
    point = nominal.sel({"method": label})
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in nominal:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = nominal["rhs_calls"].sel({"method": "full_order"})
        counts = f"{int(point['rhs_calls'])} evaluations against {int(full)} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    return Row(
        model=number.model,
        item=f"{number.item}, {VARIANTS[label]}{origin}",
        published=number.value,
        reproduced=reproduced,
        unit=number.unit,
        floor=float(point["floor_rms_error"]),
        replay=float(nominal["rms_error"].sel({"method": "replay"})),
        verdict=verdict(status == "ok" and reproduced <= number.value),
        reason=(
            f"{failed}nominal-only error: trained on the run that it is tested on, where replay is "
            f"exact; {counts}; {PARAMETERS}"
        ),
    )


def claim_rows(name: str, claim: Claim, results: Results) -> list[Row]:
    """A row for each variant of the method; one without a number for what can't be measured."""
    item = f"figure {claim.figure}: {claim.statement}" if claim.figure else claim.statement
    if name not in CRITERIA:
        if claim.model not in names("model") or claim.kind == "setup":
            return []
        reason = "an explanation or a judgement; the paper prints nothing that could be measured"
        return [not_comparable(claim.model, item, reason)]
    criterion = CRITERIA[name]
    rows: list[Row] = []
    for label, variant in VARIANTS.items():
        finding = criterion(results, label)
        rows.append(
            Row(
                model=claim.model,
                item=f"{item}, {variant}",
                published=finding.bound,
                reproduced=finding.measured,
                unit="1",
                floor=math.nan,
                replay=math.nan
                if name in WITHOUT_REPLAY
                else criterion(results, "replay").measured,
                verdict=verdict(finding.met),
                reason=finding.explanation,
            )
        )
    return rows
