"""Published savings of time beside those of the timing cases."""

from typing import Any

import pandas as pd

from vehiclemor.registry import component
from vehiclemor.report.comparison.rows import Row, claim_row, number_row
from vehiclemor.report.criteria.finding import IN_WORDS, PRINTED, Finding
from vehiclemor.report.published import Claim, Number, rms_numbers
from vehiclemor.report.shown import timing_cases
from vehiclemor.report.verdicts import MET, NOT_COMPARABLE, PUBLISHED_START, scatter
from vehiclemor.study.timing import TimingCase

# Preset -> what its rows are called.
PRESETS = {"recommended": "default", "literal": "literal"}
# Claims about times.
SIX_SLOWER, AGREE_AND_SAVE = "dw_fig14_six_slower_than_three", "all_close_agreement_less_time"
OF_INTEGRATION = (
    "share of the time of the same integrator's full run at equal tolerance that is saved; the "
    "paper names neither its integrator nor its machine"
)
OF_ITERATION = (
    "share of the time of Newton with fresh Jacobians and generated elimination that is saved; the "
    "paper names neither its solver nor its machine"
)


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
                row = row._replace(within=None)
            if scattered and start == PUBLISHED_START:
                row = row._replace(verdict=NOT_COMPARABLE)
            algebraic = component("model", number.model).kind == "ae"
            words = (_beside_solvers if algebraic else _beside_integrators)(table, case.id)
            reason = "; ".join(text for text in (wrong, scattered, words) if text)
            measure = OF_ITERATION if algebraic else OF_INTEGRATION
            strongest = 1.0 / float(table.loc[case.id, "speed_up_strongest"])
            row = row._replace(replay=1.0, measure=measure, reason=reason, strongest=strongest)
            rows.append(row)
    return rows


def _cases(model: str, states: int) -> list[TimingCase]:
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


def _beside_integrators(table: pd.DataFrame, case: str) -> str:
    row, baseline, strongest = table.loc[case], table.loc["baseline"], table.loc["strongest"]
    if row["status"] != "ok":
        return ""
    return (
        f"{1.0 / float(row['speed_up']):.2f} times the time of the same integrator, "
        f"{row['rhs_calls']} evaluations against {baseline['rhs_calls']}; "
        f"{1.0 / float(row['speed_up_strongest']):.1f} times that of the best full-order "
        f"integrator ({strongest['rhs_calls']} evaluations, RMS yaw {strongest['rms_yaw']:.1e} "
        f"rad); offline {row['offline_us'] / 1e3:.0f} ms, paid back {_runs(row['break_even'])}, "
        f"against the best integrator {_runs(row['break_even_strongest'])}"
    )


def _runs(count: float) -> str:
    return "never" if count != count else f"after {count:.1f} runs"


def _beside_solvers(table: pd.DataFrame, case: str) -> str:
    row, baseline = table.loc[case], table.loc["baseline"]
    return (
        f"{1.0 / float(row['speed_up']):.2f} times the time of Newton, {row['iterations']:.0f} "
        f"iterations against {baseline['iterations']:.0f}; "
        f"{1.0 / float(row['speed_up_strongest']):.2f} times that of the strongest solver"
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
    if scattered:
        reason = f"{scattered}; {seen}"
        return found._replace(within=None, verdict=NOT_COMPARABLE, reason=reason)
    return found


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
        if agree and scattered:
            row = row._replace(within=None, verdict=NOT_COMPARABLE, reason=scattered[0])
        rows.append(row)
    return rows
