"""Rows of the comparison with the paper: its numbers and claims beside what is reproduced."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import xarray as xr

from vehiclemor.report.criteria import CRITERIA, VARIANTS, WITHOUT_REPLAY, variants
from vehiclemor.report.criteria.finding import PRINTED, Finding
from vehiclemor.report.published import Claim, Number
from vehiclemor.report.verdicts import NOT_COMPARABLE, PUBLISHED_START, judged

PARAMETERS = "the paper's parameters were never published; ours are public data"
ALL_MODELS = "all three models"
NOMINAL_ERROR = "nominal-only: trained on the run that it is tested on, where replay is exact"
Results = Mapping[str, xr.Dataset]


class Row(NamedTuple):
    """A published number or claim beside what is reproduced.

    Attributes
    ----------
    id
        Of the number or claim in `data/published`.
    variant
        Settings of the method: `default`, `literal` (the paper's words), or what differs from them.
    start
        Initial condition.
    published
        The printed number; none for a claim.
    bound
        What the reproduced number is compared with, and in `threshold_source` whose it is:
        `published`, `the claim's words` or `ours`.
    floor, replay
        The same quantity of the best approximation in the subspaces, and of replay.
    within
        Whether the claim holds, or the number is within the published one; None if unknown.
    verdict
        `met`, `missed`, `not_comparable`, or `ours`: from a start that the paper doesn't have.
    measure
        What the number is.
    reason
        Why the verdict, and what else was seen.
    """

    id: str
    model: str
    item: str
    variant: str
    start: str
    published: float
    bound: float
    reproduced: float
    unit: str
    floor: float
    replay: float
    within: bool | None
    verdict: str
    measure: str
    reason: str
    threshold_source: str


COLUMNS = Row._fields
_UNKNOWN = Row(
    *("", ALL_MODELS, "", "", PUBLISHED_START, math.nan, math.nan, math.nan, "-"),
    *(math.nan, math.nan, None, NOT_COMPARABLE, "", "", ""),
)


def number_row(number: Number, variant: str, start: str, reproduced: float, within: bool) -> Row:
    """Row of a printed number, judged by it."""
    return _UNKNOWN._replace(
        id=number.id,
        model=number.model,
        item=f"{number.item} (figure {number.figure})" if number.figure else number.item,
        variant=variant,
        start=start,
        published=number.value,
        bound=number.value,
        reproduced=reproduced,
        unit=number.unit,
        within=within,
        verdict=judged(within, start),
        threshold_source=PRINTED,
    )


def not_comparable(entry: Number | Claim, reason: str) -> Row:
    """Row of something that can't be reproduced."""
    if isinstance(entry, Number):
        row = number_row(entry, "", PUBLISHED_START, math.nan, False)
        return row._replace(within=None, verdict=NOT_COMPARABLE, reason=reason)
    return _of_claim(entry)._replace(reason=reason)


def _of_claim(claim: Claim) -> Row:
    statement = f"figure {claim.figure}: {claim.statement}" if claim.figure else claim.statement
    return _UNKNOWN._replace(id=claim.id, model=claim.model or ALL_MODELS, item=statement)


def claim_row(claim: Claim, variant: str, finding: Finding, start: str = PUBLISHED_START) -> Row:
    """Row of a claim by its criterion."""
    return _of_claim(claim)._replace(
        variant=variant,
        start=start,
        bound=finding.bound,
        reproduced=finding.measured,
        unit="1",
        within=finding.met,
        verdict=judged(finding.met, start),
        measure=finding.measure,
        reason=finding.seen or finding.measure,
        threshold_source=finding.threshold,
    )


def error_rows(number: Number, nominal: xr.Dataset) -> list[Row]:
    """One row for each start of the model and variant of the method."""
    study = nominal.sel(rank=number.states, output=number.quantity)
    return [
        _error_row(number, study.sel(start=start).squeeze(drop=True), label, variant, str(start))
        for start in study["start"].values
        for label, variant in VARIANTS.items()
    ]


def _error_row(number: Number, nominal: xr.Dataset, label: str, variant: str, start: str) -> Row:
    point = nominal.sel(label=label)
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in nominal:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = nominal["rhs_calls"].sel(label="full_order")
        counts = f"{int(point['rhs_calls'])} evaluations against {int(full)} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    within = status == "ok" and reproduced <= number.value
    return number_row(number, variant, start, reproduced, within)._replace(
        floor=float(point["floor_rms_error"]),
        replay=float(nominal["rms_error"].sel(label="replay")),
        measure=NOMINAL_ERROR,
        reason=f"{failed}{PARAMETERS}; {counts}",
    )


def claim_rows(claim: Claim, results: Results) -> list[Row]:
    """A row for each start and variant; one without a number for what can't be measured.

    A claim on all models is judged by the paper's start alone.
    """
    if claim.kind == "setup":
        return []
    if claim.id not in CRITERIA:
        reason = "an explanation or a judgement; the paper prints nothing that could be measured"
        return [not_comparable(claim, reason)]
    rows: list[Row] = []
    for start in _starts(claim, results):
        rows += _rows_of_start(claim, from_start(results, start), start)
    return rows


def _rows_of_start(claim: Claim, results: Results, start: str) -> list[Row]:
    criterion, replay = CRITERIA[claim.id], math.nan
    if claim.id not in WITHOUT_REPLAY:
        replay = criterion(results, "replay").measured
    return [
        claim_row(claim, variant, criterion(results, label), start)._replace(replay=replay)
        for label, variant in variants(claim.id).items()
    ]


def _starts(claim: Claim, results: Results) -> list[str]:
    """Starts that the studies of a claim's model have."""
    own = [d for d in results.values() if claim.model and d.attrs["model"] == claim.model]
    found = [str(s) for d in own for s in d["start"].values.ravel()]
    return list(dict.fromkeys(found)) or [PUBLISHED_START]


def from_start(results: Results, start: str) -> Results:
    """Studies of one start, where they have several."""
    return {
        name: dataset.sel(start=start) if start in dataset.indexes.get("start", ()) else dataset
        for name, dataset in results.items()
    }
