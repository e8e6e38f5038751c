"""The paper's printed errors and savings of time as criteria, and the claims that rest on them."""

from functools import partial
from typing import get_args

import numpy as np
import xarray as xr

from vehiclemor.registry import component
from vehiclemor.report.default_studies import of_paper
from vehiclemor.report.findings import (
    IN_WORDS,
    PRINTED,
    VARIANTS,
    Criterion,
    Finding,
    Results,
    at_point,
    criterion,
    scatter,
)
from vehiclemor.report.labels import timing_cases
from vehiclemor.report.published import Model, Number, load_published, rms_numbers

NOMINAL_ERROR = "nominal-only: trained on the run that it is tested on, where replay is exact"
SAVED = "share of the time of {} that is saved; the paper names neither its {} nor its machine"
OF_INTEGRATION = SAVED.format("the same integrator's full run at equal tolerance", "integrator")
OF_ITERATION = SAVED.format("Newton with fresh Jacobians and generated elimination", "solver")
PRESETS = {"pod": "recommended", "pod_literal": "literal"}
# Of the timing of a model, beside those of studies.
TIMING = {model: f"timing-{model}" for model in get_args(Model)}


def printed_errors_and_savings() -> list[Number]:
    """Printed errors, then savings of time."""
    numbers = load_published().numbers.values()
    judged = [n for n in numbers if n.kind in ("rms_error", "time_reduction")]
    return sorted(judged, key=lambda number: number.kind)


def number_criterion(number: Number) -> Criterion:
    """The criterion that a printed number is."""
    if number.kind == "rms_error":
        return Criterion(partial(judge_rms_error, number), VARIANTS)
    timed = {label: variant for label, variant in VARIANTS.items() if case_of(number, label)}
    return Criterion(partial(time_saved, number), timed, applies_to_replay=False)


def judge_rms_error(number: Number, results: Results, label: str) -> Finding:
    """RMS error of the nominal run, with the paper's number of states."""
    study = results[of_paper(number.model)].sel(rank=number.states, output=number.quantity)
    point = at_point(study, label)
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in study:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = int(at_point(study, "full_order")["rhs_calls"])
        counts = f"{int(point['rhs_calls'])} evaluations against {full} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    signal = point["reference_outputs"].values
    return Finding(
        reproduced,
        number.value,
        status == "ok" and reproduced <= number.value,
        NOMINAL_ERROR,
        failed + counts,
        PRINTED,
        number.unit,
        floor=float(point["floor_rms_error"]),
        signal_rms=float(np.sqrt(np.mean(signal**2))),
    )


def time_saved(number: Number, results: Results, label: str) -> Finding:
    """Share of the baseline's time that is saved.

    It counts where the errors of the same run are within the published ones (of six states: those
    of three, since the paper prints none), and where the times don't scatter.
    """
    timing = results[TIMING[number.model]]
    case = case_of(number, label)
    run, full = timing.sel(case=case), timing.sel(case="baseline")
    saved = 1.0 - 1.0 / float(run["speed_up"])
    strongest = 1.0 / float(run["speed_up_strongest"])
    algebraic = "iterations" in timing
    count, name = ("iterations",) * 2 if algebraic else ("rhs_calls", "evaluations")
    beside = (
        f"{1.0 - saved:.2f} times the time of {'Newton' if algebraic else 'the same integrator'}, "
        f"{int(run[count])} {name} against {int(full[count])}; "
        f"{strongest:.2f} times that of the best full-order solver"
    )
    wrong = _missed_errors(number.model, run)
    scattered = "" if wrong else _scatter(timing, case, "baseline")
    beside = beside if run["status"].item() == "ok" else ""
    return Finding(
        saved,
        number.value,
        None if scattered else not wrong and saved >= number.value,
        OF_ITERATION if algebraic else OF_INTEGRATION,
        "; ".join(filter(None, (wrong, scattered, beside))),
        PRINTED,
        number.unit,
        strongest=strongest,
    )


def case_of(number: Number, label: str) -> str:
    """Timing case of control-period POD with the number's states and nothing else set; or none."""
    wanted = "pod", PRESETS[label], {"rank": number.states or 3}
    for case in timing_cases(component("model", number.model)):
        if (case.method, case.preset, case.settings) == wanted:
            return case.id
    return ""


def _missed_errors(model: str, run: xr.Dataset) -> str:
    """Which published errors a timed run misses, empty if none."""
    status = run["status"].item()
    if status != "ok":
        return f"no time is saved by a run that has {status}"
    missed: list[str] = []
    for output, number in rms_numbers(model).items():
        error = float(run["rms_error"].sel(output=output))
        if not error <= number.value:
            missed.append(f"{output} {error:.2g} of {number.value:.3g} {number.unit}")
    return f"counts only with errors that are met: {', '.join(missed)}" if missed else ""


def _scatter(timing: xr.Dataset, *cases: str) -> str:
    spread = (timing["seconds_upper"] - timing["seconds_lower"]) / timing["seconds"]
    return scatter({case: float(spread.sel(case=case)) for case in cases})


@criterion("dw_fig14_six_slower_than_three", {"pod_literal": "literal"}, applies_to_replay=False)
def six_slower(results: Results, label: str) -> Finding:
    """Figure 14: six states take more time than three, but less than the full model."""
    timing = results[TIMING["double_wishbone"]]
    numbers = load_published().numbers
    few, many = (case_of(numbers[f"dw_time_reduction_{n}"], label) for n in (3, 6))
    row = timing.sel(case=many)
    slower = float(row["seconds"] / timing["seconds"].sel(case=few))
    seen = (
        f"six states take {1.0 / float(row['speed_up']):.2f} times the time of Newton with fresh "
        f"Jacobians ({int(row['iterations'])} iterations against "
        f"{int(timing['iterations'].sel(case='baseline'))})"
    )
    scattered = _scatter(timing, few, many, "baseline")
    met = None if scattered else slower > 1.0 and float(row["speed_up"]) > 1.0
    text = "time with six states as a multiple of that with three; and less than the full model's"
    reason = "; ".join(filter(None, (scattered, seen)))
    return Finding(slower, 1.0, met, text, reason, IN_WORDS)


@criterion("all_close_agreement_less_time", applies_to_replay=False)
def agree_and_save(results: Results, label: str) -> Finding:
    """Conclusion: reduced models agree closely and take substantially less time."""
    numbers = printed_errors_and_savings()
    agree = all(judge_rms_error(n, results, label).within for n in numbers if n.kind == "rms_error")
    timed = [n for n in numbers if n.kind == "time_reduction" and case_of(n, label)]
    saved = [time_saved(n, results, label) for n in timed]
    number, least = min(zip(timed, saved, strict=True), key=lambda pair: pair[1].reproduced)
    bound = min(finding.bound for finding in saved)
    text = "least share of time that is saved, if all published errors are met"
    seen = f"{number.model}; errors {'met' if agree else 'missed'}"
    scattered = [f.reason for f in saved if f.within is None and agree]
    met = None if scattered else agree and least.reproduced >= bound
    return Finding(least.reproduced, bound, met, text, next(iter(scattered), seen), PRINTED)
