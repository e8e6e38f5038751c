"""Published savings of time beside those of the timing cases."""

from typing import Any

import pandas as pd

from vehiclemor.registry import component
from vehiclemor.report.comparison.rows import Row, claim_row, number_row, undecided
from vehiclemor.report.criteria.finding import IN_WORDS, PRINTED, Finding
from vehiclemor.report.published import Claim, Number, rms_numbers
from vehiclemor.report.shown import Case, timing_cases
from vehiclemor.report.verdicts import MET, NOT_COMPARABLE, PUBLISHED_START, scatter

# Preset -> what its rows are called.
PRESETS = {"recommended": "default", "literal": "literal"}
# Claims about times.
SIX_SLOWER, AGREE_AND_SAVE = "dw_fig14_six_slower_than_three", "all_close_agreement_less_time"
SAVED = "share of the time of {} that is saved; the paper names neither its {} nor its machine"
OF_INTEGRATION = SAVED.format("the same integrator's full run at equal tolerance", "integrator")
OF_ITERATION = SAVED.format("Newton with fresh Jacobians and generated elimination", "solver")


def time_rows(number: Number, costs: pd.DataFrame) -> list[Row]:
    """Share of the baseline's time that is saved, by start and variant of the method.

    It counts where the errors of the same run are within the published ones (of six states: those
    of three, since the paper prints none), and where the times don't scatter.
    """
    rows: list[Row] = []
    for start in dict.fromkeys(costs["start"]):
        table = costs[costs["start"] == start].set_index("case")
        for case in _cases(number.model, number.states or 3):
            saved = 1.0 - 1.0 / float(table.loc[case.id, "speed_up"])
            wrong = _missed_errors(number.model, table.loc[case.id].to_dict())
            within = not wrong and saved >= number.value
            row = number_row(number, PRESETS[case.preset], str(start), saved, within)
            scattered = "" if wrong else _scatter(table, case.id, "baseline")
            if scattered:
                row = undecided(row, "")
            algebraic = component("model", number.model).kind == "ae"
            words = _beside_full(table, case.id, algebraic)
            reason = "; ".join(text for text in (wrong, scattered, words) if text)
            measure = OF_ITERATION if algebraic else OF_INTEGRATION
            strongest = 1.0 / float(table.loc[case.id, "speed_up_strongest"])
            row = row._replace(replay=1.0, measure=measure, reason=reason, strongest=strongest)
            rows.append(row)
    return rows


def _cases(model: str, states: int) -> list[Case]:
    """Timing cases of control-period POD with so many states and nothing else set."""
    cases = timing_cases(component("model", model))
    return [c for c in cases if c.method == "pod" and dict(c.settings) == {"rank": states}]


def _scatter(table: pd.DataFrame, *cases: str) -> str:
    return scatter({c: float(table.loc[c, "quartile_spread"]) for c in cases})


def _missed_errors(model: str, row: dict[str, Any]) -> str:
    """Which published errors a timed run misses, empty if none."""
    status = row["status"]
    if status != "ok":
        return f"no time is saved by a run that has {status}"
    missed = [
        f"{number.quantity} {row[f'rms_{output}']:.2g} of {number.value:.3g} {number.unit}"
        for output, number in rms_numbers(model).items()
        if not row[f"rms_{output}"] <= number.value
    ]
    return f"counts only with errors that are met: {', '.join(missed)}" if missed else ""


def _beside_full(table: pd.DataFrame, case: str, algebraic: bool) -> str:
    """A timed run beside the same solver and beside the best one."""
    row, baseline = table.loc[case], table.loc["baseline"]
    if row["status"] != "ok":
        return ""
    name, count = ("Newton", "iterations") if algebraic else ("the same integrator", "rhs_calls")
    return (
        f"{1.0 / float(row['speed_up']):.2f} times the time of {name}, {row[count]:.0f} "
        f"{'iterations' if algebraic else 'evaluations'} against {baseline[count]:.0f}; "
        f"{1.0 / float(row['speed_up_strongest']):.2f} times that of the best full-order solver"
    )


def slower_row(claim: Claim, costs: pd.DataFrame, few: int, many: int) -> Row:
    """Claim that more states take more time than few, but less than the full model."""
    table = costs[costs["start"] == costs["start"].iloc[0]].set_index("case")
    few_case, many_case = (
        next(c.id for c in _cases(str(claim.model), states) if c.preset == "literal")
        for states in (few, many)
    )
    row, full = table.loc[many_case], table.loc["baseline"]
    slower = float(row["us_per_run"]) / float(table.loc[few_case, "us_per_run"])
    seen = (
        f"six states take {1.0 / float(row['speed_up']):.2f} times the time of Newton with fresh "
        f"Jacobians ({row['iterations']:.0f} iterations against {full['iterations']:.0f})"
    )
    met = slower > 1.0 and float(row["speed_up"]) > 1.0
    text = "time with six states as a multiple of that with three; and less than the full model's"
    found = claim_row(claim, "literal", Finding(slower, 1.0, met, text, seen, IN_WORDS))
    scattered = _scatter(table, few_case, many_case, "baseline")
    return undecided(found, f"{scattered}; {seen}") if scattered else found


def agreement_rows(claim: Claim, errors: list[Row], times: list[Row]) -> list[Row]:
    """Claim that reduced models agree closely and take substantially less time, by variant.

    Parameters
    ----------
    errors, times
        Rows of all published errors and of all published savings of time.
    """
    rows: list[Row] = []
    for variant in PRESETS.values():
        saved = [r for r in times if (r.variant, r.start) == (variant, PUBLISHED_START)]
        own = [r for r in errors if (r.variant, r.start) == (variant, PUBLISHED_START)]
        least, bound = min(saved, key=lambda r: r.reproduced), min(r.published for r in saved)
        agree = all(r.verdict == MET for r in own)
        text = "least share of time that is saved, if all published errors are met"
        seen = f"{least.model}; errors {'met' if agree else 'missed'}"
        met = agree and least.reproduced >= bound
        row = claim_row(claim, variant, Finding(least.reproduced, bound, met, text, seen, PRINTED))
        scattered = [r.reason for r in saved if r.verdict == NOT_COMPARABLE]
        rows.append(undecided(row, scattered[0]) if agree and scattered else row)
    return rows
