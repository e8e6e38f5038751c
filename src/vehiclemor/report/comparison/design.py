"""The paper's claims about design, judged by two design studies that were measured beforehand."""

from vehiclemor.report.comparison.rows import Row, claim_row
from vehiclemor.report.criteria.finding import IN_WORDS, OWN, Finding
from vehiclemor.report.design_studies import design_studies
from vehiclemor.report.published import Claim

FINDS, SAVES = "all_intended_for_full_vehicle_models", "all_essential_for_design"
# Part by which an objective may be worse than at the full order's optimum: designs are the same.
SAME = 0.01
# Study -> its name in rows, its full-order contestant, its reduced ones.
STUDIES = {
    "springs": (
        "springs and dampers",
        "full order",
        ("POD, r = 3", "POD, r = 6", "slow manifold", "softened slip"),
    ),
    "points": ("hard points", "full order, differences", ("path map, differences",)),
}


def design_rows(claim: Claim) -> list[Row]:
    """A row of one of the two claims for each reduced model of each study."""
    values, rows = design_studies()["values"], []
    for study, (label, full, contestants) in STUDIES.items():
        for name in contestants:
            finding = (_found if claim.id == FINDS else _saved)(values, study, name, full)
            row = claim_row(claim, f"{label}: {name.removesuffix(', differences')}", finding)
            rows.append(row._replace(reason=f"{row.reason}; stored by paper/design_studies.py"))
    return rows


def _found(values: dict[str, float], study: str, name: str, full: str) -> Finding:
    """How much worse its designs are, by the full model, than those of the full order."""
    text = "largest excess of an objective over the full order's optimum, by the full model"
    worst = values[f"{study} {name} worse, 1"]
    seen = f"told with an error of {values[f'{study} {name} told off, 1']:.2g} of the objective"
    del full
    return Finding(worst, SAME, worst <= SAME, text, seen, OWN)


def _saved(values: dict[str, float], study: str, name: str, full: str) -> Finding:
    """Time of the search, with what was spent before, over that of the full order."""
    text = "CPU time of the search, training included, over that of the strongest full order"
    spent, offline = (values[f"{study} {name} {part}, s"] for part in ("search", "offline"))
    ratio = (spent + offline) / values[f"{study} {full} search, s"]
    seen = f"{offline:.2g} s of training, {spent:.2g} s of search"
    return Finding(ratio, 1.0, ratio < 1.0, text, seen, IN_WORDS)
