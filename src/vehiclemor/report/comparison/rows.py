"""Rows of the comparison with the paper: its numbers and claims beside what is reproduced."""

import json
import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from vehiclemor.report.criteria import CRITERIA
from vehiclemor.report.criteria.finding import PRINTED, VARIANTS, Finding
from vehiclemor.report.published import Claim, Number
from vehiclemor.report.verdicts import MET, NOT_COMPARABLE, PUBLISHED_START, judged
from vehiclemor.resources import data_folder

PARAMETERS = "the paper's parameters were never published; ours are public data"
ALL_MODELS = "all three models"
# Claims about design: dated findings of studies that the package no longer has.
OF_DESIGN = ("all_intended_for_full_vehicle_models", "all_essential_for_design")
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
    signal_rms
        Of an error: the RMS of the signal itself.  A bound above it is empty: zero would meet it.
    strongest
        Of a time: the time over that of the strongest full-order solver.
    """

    id: str
    model: str
    item: str
    variant: str = ""
    start: str = PUBLISHED_START
    published: float = math.nan
    bound: float = math.nan
    reproduced: float = math.nan
    unit: str = "-"
    floor: float = math.nan
    replay: float = math.nan
    within: bool | None = None
    verdict: str = NOT_COMPARABLE
    measure: str = ""
    reason: str = ""
    threshold_source: str = ""
    signal_rms: float = math.nan
    strongest: float = math.nan


COLUMNS = Row._fields


def number_row(number: Number, variant: str, start: str, reproduced: float, within: bool) -> Row:
    """Row of a printed number, judged by it."""
    return Row(
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


def claim_row(
    claim: Claim, variant: str = "", finding: Finding | None = None, start: str = PUBLISHED_START
) -> Row:
    """Row of a claim by its criterion; not comparable without a finding."""
    statement = f"figure {claim.figure}: {claim.statement}" if claim.figure else claim.statement
    row = Row(claim.id, claim.model or ALL_MODELS, statement)
    if finding is None:
        return row
    return row._replace(
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


def undecided(row: Row, reason: str) -> Row:
    """A row that can't be compared after all; one that is not judged stays so."""
    verdict = NOT_COMPARABLE if row.start == PUBLISHED_START else row.verdict
    return row._replace(within=None, verdict=verdict, reason=reason)


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
    signal = nominal["reference_outputs"].sel(label="replay").values
    return number_row(number, variant, start, reproduced, within)._replace(
        floor=float(point["floor_rms_error"]),
        replay=float(nominal["rms_error"].sel(label="replay")),
        measure=NOMINAL_ERROR,
        reason=f"{failed}{PARAMETERS}; {counts}",
        signal_rms=float(np.sqrt(np.mean(signal**2))),
    )


def claim_rows(claim: Claim, results: Results) -> list[Row]:
    """A row for each start and variant; one without a number for what can't be measured.

    A claim on all models is judged by the paper's start alone.
    """
    if claim.kind == "setup":
        return []
    if claim.id not in CRITERIA:
        reason = "an explanation or a judgement; the paper prints nothing that could be measured"
        return [claim_row(claim)._replace(reason=reason)]
    criterion, rows = CRITERIA[claim.id], []
    own = [results[study] for study in criterion.studies if claim.model]
    starts = dict.fromkeys(str(start) for data in own for start in data["start"].values.ravel())
    for start in starts or [PUBLISHED_START]:
        part = from_start(results, start)
        replay = criterion(part, "replay").measured if criterion.of_replay else math.nan
        rows += [
            claim_row(claim, variant, criterion(part, label), start)._replace(replay=replay)
            for label, variant in criterion.variants.items()
        ]
    return rows


def from_start(results: Results, start: str) -> Results:
    """Studies of one start, where they have several."""
    return {
        name: dataset.sel(start=start) if start in dataset.indexes.get("start", ()) else dataset
        for name, dataset in results.items()
    }


@cache
def design_findings() -> dict[str, Any]:
    """What was measured, as `data/design.json` keeps it: `made` and `findings`."""
    return json.loads((data_folder() / "design.json").read_text(encoding="utf-8"))


def design_rows(claim: Claim) -> list[Row]:
    """A row of one of the claims for each reduced model of each study."""
    kept, rows = design_findings(), []
    when = f"of {kept['made']['measured']}, last contained in {kept['made']['last contained in']}"
    for study in kept["findings"]:
        if study["claim"] == claim.id:
            for own in study["rows"]:
                finding = Finding(
                    own["measured"],
                    study["bound"],
                    own["verdict"] == MET,
                    study["measure"],
                    f"{own['seen']}; {when}",
                    study["threshold"],
                )
                rows.append(claim_row(claim, f"{study['study']}: {own['label']}", finding))
    return rows
