"""The paper's claims: their criteria evaluated, or why they can't be."""

import math

from vehiclemor.registry import names
from vehiclemor.report.comparison.row import VARIANTS, Row, not_comparable, verdict
from vehiclemor.report.criteria import CRITERIA, WITHOUT_REPLAY, Results
from vehiclemor.report.published import Claim


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
