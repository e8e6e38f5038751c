"""Published savings of time beside those of the timing cases."""

import pandas as pd

from vehiclemor.models.report import TimingCase, timing_cases
from vehiclemor.registry import component
from vehiclemor.report.comparison.rows import PRESETS, Row, claim_row, number_row
from vehiclemor.report.criteria.finding import Finding
from vehiclemor.report.published import Claim, Number


def time_rows(number: Number, costs: pd.DataFrame) -> list[Row]:
    """Share of the baseline's time that is saved, by variant of the method and start."""
    algebraic = component("model", number.model).kind == "ae"
    starts = list(dict.fromkeys(costs["start"]))
    rows: list[Row] = []
    for case in _cases(number.model, number.states or 3):
        for start in starts:
            table = costs[costs["start"] == start].set_index("case")
            saved = 1.0 - 1.0 / float(table.loc[case.id, "speed_up"])
            met = table.loc[case.id, "status"] == "ok" and saved >= number.value
            origin = f", {start}" if len(starts) > 1 else ""
            words = f"{PRESETS[case.preset]}{origin}"
            reason = (_of_iteration if algebraic else _of_integration)(table, case.id)
            rows.append(number_row(number, words, saved, met, reason, replay=1.0))
    return rows


def _cases(model: str, states: int) -> list[TimingCase]:
    """Timing cases of control-period POD with so many states and nothing else set."""
    cases = timing_cases(component("model", model))
    return [c for c in cases if c.method == "pod" and dict(c.settings) == {"rank": states}]


def _of_integration(table: pd.DataFrame, case: str) -> str:
    """Reason of a row on integrated equations."""
    row, baseline, strongest = table.loc[case], table.loc["baseline"], table.loc["strongest"]
    failed = "" if row["status"] == "ok" else f"the run has {row['status']}; "
    return (
        f"{failed}share of the time of the same integrator's full run at equal tolerance that is "
        f"saved: {1.0 / float(row['speed_up']):.2f} times its time, {row['rhs_calls']} evaluations "
        f"against {baseline['rhs_calls']}; but {1.0 / float(row['speed_up_strongest']):.1f} times "
        f"the time of the best full-order integrator ({strongest['rhs_calls']} evaluations, RMS "
        f"yaw {strongest['rms_yaw']:.1e} rad); offline {row['offline_us'] / 1e3:.0f} ms, paid back "
        f"{_runs(row['break_even'])}, against the best integrator "
        f"{_runs(row['break_even_strongest'])}; "
        f"the paper names neither its integrator nor its machine"
    )


def _runs(count: float) -> str:
    return "never" if count != count else f"after {count:.1f} runs"


def _of_iteration(table: pd.DataFrame, case: str) -> str:
    """Reason of a row on equations that are solved by iteration."""
    row, baseline = table.loc[case], table.loc["baseline"]
    others = {"the strongest solver": "strongest", "Newton with dense elimination": "dense"}
    times = ", ".join(
        f"{float(row['us_per_run']) / float(table.loc[other, 'us_per_run']):.2f} times the time of "
        f"{name}"
        for name, other in others.items()
    )
    return (
        f"share of the time of Newton with fresh Jacobians and generated elimination that is "
        f"saved; {row['iterations']:.0f} iterations against {baseline['iterations']:.0f}; {times}; "
        f"the paper names neither its solver nor its machine"
    )


def slower_row(claim: Claim, costs: pd.DataFrame, few: int, many: int) -> Row:
    """Claim that more states take more time than few, but less than the full model."""
    table = costs[costs["start"] == costs["start"].iloc[0]].set_index("case")
    literal = {
        states: next(c.id for c in _cases(str(claim.model), states) if c.preset == "literal")
        for states in (few, many)
    }
    row, full = table.loc[literal[many]], table.loc["baseline"]
    slower = float(row["us_per_run"]) / float(table.loc[literal[few], "us_per_run"])
    text = (
        f"time with six states as a multiple of that with three; six states take "
        f"{1.0 / float(row['speed_up']):.2f} times the time of Newton with fresh Jacobians "
        f"({row['iterations']:.0f} iterations against {full['iterations']:.0f})"
    )
    met = slower > 1.0 and float(row["speed_up"]) > 1.0
    return claim_row(claim, "literal", Finding(slower, 1.0, met, text))
