"""Published beside reproduced: every number, every claim with a criterion, verdict and reason."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.registry import names, unknown
from vehiclemor.report.costs import cost_table
from vehiclemor.report.criteria import CRITERIA, Results
from vehiclemor.report.published import Claim, Number, load_published
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "model",
    "item",
    "published",
    "reproduced",
    "unit",
    "floor",
    "replay",
    "verdict",
    "reason",
)
VARIANTS = {"pod": "default", "pod_literal": "literal"}
# Claims about subspaces: replay has none.
WITHOUT_REPLAY = ("dw_fig12_basis_insensitive_to_amplitude",)
PARAMETERS = (
    "the paper's parameters were never published; ours are public data (Project Chrono sedan)"
)


def comparison(what: str, folder: Path, jobs: int = 1) -> pd.DataFrame:
    """The comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`.
    folder
        Results folder.
    jobs
        Number of processes for missing studies.

    Returns
    -------
    pandas.DataFrame
        One row for each published number or claim and variant of the method (`default`, `literal`),
        with the columns `COLUMNS`.  For a claim `published` is the bound of its criterion.
    """
    import pandas as pd

    if what != "paper":
        raise unknown("comparison", what, ["paper"])
    results = run_studies("paper", folder, jobs)
    published = load_published()
    costs = cost_table("double_wishbone", folder).set_index("contestant")
    rows: list[dict[str, object]] = []
    for number in published.numbers.values():
        if number.kind == "rms_error" and number.model in names("model"):
            rows += [_error_row(number, results, label) for label in VARIANTS]
        elif number.kind == "time_reduction" and number.model in names("model"):
            rows += _time_rows(number, costs)
        elif number.kind in ("rms_error", "time_reduction"):
            rows.append(_absent_row(number))
    for name, claim in published.claims.items():
        if name in CRITERIA:
            rows += [_claim_row(name, claim, results, label) for label in VARIANTS]
        elif name == "dw_fig14_six_slower_than_three":
            rows.append(_six_slower_row(claim, costs))
        elif claim.model in names("model") and claim.kind != "setup":
            rows.append(_untested_row(claim))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _error_row(number: Number, results: Results, label: str) -> dict[str, object]:
    nominal = results["figures-6-7"].sel(rank=number.states, output=number.quantity).squeeze()
    point = nominal.sel({"method": label})
    reproduced, floor = float(point["rms_error"]), float(point["floor_rms_error"])
    replay = float(nominal["rms_error"].sel({"method": "replay"}))
    met = reproduced <= number.value
    counts = f"{int(point['iterations'])} iterations"
    return {
        "model": number.model,
        "item": f"{number.item}, {VARIANTS[label]}",
        "published": number.value,
        "reproduced": reproduced,
        "unit": number.unit,
        "floor": floor,
        "replay": replay,
        "verdict": "met" if met else "missed",
        "reason": (
            f"nominal-only error: trained on the run that it is tested on, where replay is exact; "
            f"{counts}; {PARAMETERS}"
        ),
    }


def _time_rows(number: Number, costs: pd.DataFrame) -> list[dict[str, object]]:
    contestants = {
        3: {"default": "pod r=3", "literal": "pod literal r=3"},
        6: {"literal": "pod literal r=6"},
    }
    baseline, strongest = costs.loc["full order, Newton"], costs.loc["full order, strongest"]
    dense = costs.loc["full order, dense"]
    rows: list[dict[str, object]] = []
    for variant, contestant in contestants[number.states or 3].items():
        row = costs.loc[contestant]
        reduction = 1.0 - 1.0 / float(row["speed_up"])
        against = {
            "the strongest solver": float(row["us_per_run"]) / float(strongest["us_per_run"]),
            "Newton with dense elimination": float(row["us_per_run"]) / float(dense["us_per_run"]),
        }
        times = ", ".join(
            f"{ratio:.2f} times the time of {name}" for name, ratio in against.items()
        )
        rows.append(
            {
                "model": number.model,
                "item": f"{number.item}, {variant}",
                "published": number.value,
                "reproduced": reduction,
                "unit": number.unit,
                "floor": float("nan"),
                "replay": 1.0,
                "verdict": "met" if reduction >= number.value else "missed",
                "reason": (
                    f"share of the time of Newton with fresh Jacobians and generated elimination "
                    f"that is saved; {row['iterations']:.0f} iterations against "
                    f"{baseline['iterations']:.0f}; {times}; "
                    f"the paper names neither its solver nor its machine"
                ),
            }
        )
    return rows


def _absent_row(number: Number) -> dict[str, object]:
    missing = float("nan")
    return {
        "model": number.model,
        "item": number.item,
        "published": number.value,
        "reproduced": missing,
        "unit": number.unit,
        "floor": missing,
        "replay": missing,
        "verdict": "not_comparable",
        "reason": "this model is not in the suite yet",
    }


def _six_slower_row(claim: Claim, costs: pd.DataFrame) -> dict[str, object]:
    three, six = costs.loc["pod literal r=3"], costs.loc["pod literal r=6"]
    full = costs.loc["full order, Newton"]
    slower = float(six["us_per_run"]) / float(three["us_per_run"])
    faster_than_full = float(six["speed_up"]) > 1.0
    return {
        "model": claim.model,
        "item": f"figure {claim.figure}: {claim.statement}, literal",
        "published": 1.0,
        "reproduced": slower,
        "unit": "1",
        "floor": float("nan"),
        "replay": float("nan"),
        "verdict": "met" if slower > 1.0 and faster_than_full else "missed",
        "reason": (
            f"time with six states as a multiple of that with three; six states take "
            f"{1.0 / float(six['speed_up']):.2f} times the time of Newton with fresh Jacobians "
            f"({six['iterations']:.0f} iterations against {full['iterations']:.0f})"
        ),
    }


def _untested_row(claim: Claim) -> dict[str, object]:
    missing = float("nan")
    return {
        "model": claim.model,
        "item": f"figure {claim.figure}: {claim.statement}" if claim.figure else claim.statement,
        "published": missing,
        "reproduced": missing,
        "unit": "-",
        "floor": missing,
        "replay": missing,
        "verdict": "not_comparable",
        "reason": "an explanation or a judgement; the paper prints nothing that could be measured",
    }


def _replayed(name: str, results: Results) -> float:
    return CRITERIA[name](results, "replay").measured


def _claim_row(name: str, claim: Claim, results: Results, label: str) -> dict[str, object]:
    finding = CRITERIA[name](results, label)
    return {
        "model": claim.model,
        "item": f"figure {claim.figure}: {claim.statement}, {VARIANTS[label]}"
        if claim.figure
        else f"{claim.statement}, {VARIANTS[label]}",
        "published": finding.bound,
        "reproduced": finding.measured,
        "unit": "1",
        "floor": float("nan"),
        "replay": float("nan") if name in WITHOUT_REPLAY else _replayed(name, results),
        "verdict": "met" if finding.met else "missed",
        "reason": finding.explanation,
    }


def printed(rows: pd.DataFrame) -> str:
    """The comparison as text, reasons below the numbers."""
    lines = [
        "Published beside reproduced (for a claim, published is the bound of our criterion).",
        "Floor: RMS error of the best approximation of the coordinates; an output can undercut it.",
        PARAMETERS[0].upper() + PARAMETERS[1:] + ".",
    ]
    for model, part in rows.groupby("model", sort=False):
        lines += ["", str(model)]
        lines.append(
            f"  {'item':<62}{'published':>11}{'reproduced':>12}"
            f"{'floor':>10}{'replay':>10}  {'unit':<5}verdict"
        )
        for row in part.to_dict("records"):
            item = textwrap.wrap(str(row["item"]), 60)
            numbers = (
                f"{_number(row['published']):>11}{_number(row['reproduced']):>12}"
                f"{_number(row['floor']):>10}{_number(row['replay']):>10}"
            )
            lines.append(f"  {item[0]:<62}{numbers}  {row['unit']:<5}{row['verdict']}")
            lines += [f"    {text}" for text in item[1:]]
            reason = str(row["reason"]).removesuffix(f"; {PARAMETERS}")
            lines += [f"      {text}" for text in textwrap.wrap(reason, 104)]
    verdicts = rows["verdict"].value_counts()
    counted = ", ".join(f"{verdicts.get(v, 0)} {v}" for v in ("met", "missed", "not_comparable"))
    lines += ["", counted]
    return "\n".join(lines)


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"
