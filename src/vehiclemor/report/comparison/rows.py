"""Rows of the comparison with the paper: its numbers and claims beside what is reproduced."""

import math
from typing import NamedTuple

import xarray as xr

from vehiclemor.registry import names
from vehiclemor.report.criteria import CRITERIA, WITHOUT_REPLAY, Results
from vehiclemor.report.criteria.finding import Finding
from vehiclemor.report.published import Claim, Number

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


def not_comparable(
    model: str | None, item: str, reason: str, published: float = math.nan, unit: str = "-"
) -> Row:
    """Row of something that can't be reproduced."""
    missing = math.nan
    return Row(model, item, published, missing, unit, missing, missing, "not_comparable", reason)


def number_row(
    number: Number,
    words: str,
    reproduced: float,
    met: bool,
    reason: str,
    floor: float = math.nan,
    replay: float = math.nan,
) -> Row:
    """Row of a printed number; `words` tell the variant of the method."""
    known = number.model, f"{number.item}, {words}", number.value, reproduced, number.unit
    return Row(*known, floor, replay, "met" if met else "missed", reason)


def claim_row(claim: Claim, words: str, finding: Finding, replay: float = math.nan) -> Row:
    """Row of a claim by its criterion; `words` tell the variant of the method."""
    known = claim.model, f"{item_of(claim)}, {words}", finding.bound, finding.measured, "1"
    verdict = "met" if finding.met else "missed"
    return Row(*known, math.nan, replay, verdict, finding.explanation)


def item_of(claim: Claim) -> str:
    """What a claim says, and the figure that it is about."""
    return f"figure {claim.figure}: {claim.statement}" if claim.figure else claim.statement


def error_rows(number: Number, nominal: xr.Dataset) -> list[Row]:
    """One row for each variant of the method and start of the model."""
    study = nominal.sel(rank=number.states, output=number.quantity)
    starts = [str(start) for start in study["start"].values]
    rows: list[Row] = []
    for label, variant in VARIANTS.items():
        for start in starts:
            origin = f", {start}" if len(starts) > 1 else ""
            place = study.sel(start=start).squeeze(drop=True)
            rows.append(_error_row(number, place, label, variant + origin))
    return rows


def _error_row(number: Number, nominal: xr.Dataset, label: str, words: str) -> Row:
    point = nominal.sel({"method": label})
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in nominal:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = nominal["rhs_calls"].sel({"method": "full_order"})
        counts = f"{int(point['rhs_calls'])} evaluations against {int(full)} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    reason = (
        f"{failed}nominal-only error: trained on the run that it is tested on, where replay is "
        f"exact; {counts}; {PARAMETERS}"
    )
    met = status == "ok" and reproduced <= number.value
    replay = float(nominal["rms_error"].sel({"method": "replay"}))
    return number_row(
        number, words, reproduced, met, reason, float(point["floor_rms_error"]), replay
    )


def claim_rows(name: str, claim: Claim, results: Results) -> list[Row]:
    """A row for each variant of the method; one without a number for what can't be measured."""
    if name not in CRITERIA:
        if claim.model not in names("model") or claim.kind == "setup":
            return []
        reason = "an explanation or a judgement; the paper prints nothing that could be measured"
        return [not_comparable(claim.model, item_of(claim), reason)]
    criterion, replay = CRITERIA[name], math.nan
    if name not in WITHOUT_REPLAY:
        replay = criterion(results, "replay").measured
    return [
        claim_row(claim, variant, criterion(results, label), replay)
        for label, variant in VARIANTS.items()
    ]
