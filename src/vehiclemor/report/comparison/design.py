"""The paper's claims about design: dated findings of studies that the package no longer has.

Springs and dampers, hard points, and many cars of which one reduced model was made.
"""

import json
from functools import cache
from typing import Any

from vehiclemor.report.comparison.rows import Row, claim_row
from vehiclemor.report.criteria.finding import Finding
from vehiclemor.report.published import Claim
from vehiclemor.report.verdicts import MET
from vehiclemor.resources import data_folder

CLAIMS = ("all_intended_for_full_vehicle_models", "all_essential_for_design")


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
