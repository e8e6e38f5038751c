"""The paper's claims on the vehicles (figures 2 to 4, 9 and 10), and on all three models."""

from functools import partial

from vehiclemor.registry import component
from vehiclemor.report.criteria.double_wishbone import ANGLE, BOTH
from vehiclemor.report.criteria.finding import (
    IN_WORDS,
    SMALLEST_CHANGE,
    VISIBLE,
    Criterion,
    Finding,
    Results,
    agree,
    at_point,
    largest_deviation,
    not_visible,
    worst_of,
)

OUTPUTS = ("lateral_position", "pitch", "yaw")
HIGH_FIDELITY_OUTPUTS = (
    *("longitudinal_position", "lateral_position"),
    *("lateral_speed", "vertical_speed"),
)
# Control periods (s): the paper's, and one that is clearly longer.
PERIOD, LONGER_PERIOD = 0.5, 2.5
SUBSTANTIAL = 0.1
# Study of a nominal run -> the paper's rank, outputs that its figures show.
NOMINAL = {
    "figures-2-4": (3, OUTPUTS),
    "figures-6-7": (3, BOTH),
    "figures-9-10": (1, HIGH_FIDELITY_OUTPUTS),
}


def three_states_suffice(results: Results, label: str) -> Finding:
    """Text: three states hold most of the information, by the best approximation in them."""
    chosen = at_point(results["figures-2-4"], label, rank=3)
    shares = chosen["floor_rms_error"] / chosen["signal_range"]
    worst, where = worst_of({output: float(shares.sel(output=output)) for output in OUTPUTS})
    text = "RMS error of the best approximation of an output, as a share of its range"
    return Finding(worst, VISIBLE, worst < VISIBLE, text, f"of {where}")


def shorter_periods_sharpen_basis(results: Results, label: str) -> Finding:
    """Text: a subspace for each control period is more accurate than one for a longer time."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    floors = study["floor_rms_error"].sel(output=["pitch", "yaw"])
    ratios = floors.sel(control_period=PERIOD) / floors.sel(control_period=5.0)
    worst = float(ratios.max())
    bound = 1.0 - SMALLEST_CHANGE
    text = (
        f"RMS error of the best approximation with {PERIOD:g} s as a multiple of that with 5 s, "
        "worse of pitch and yaw"
    )
    return Finding(worst, bound, worst < bound, text, f"the better: {float(ratios.min()):.2g}")


def longer_periods_save_time(
    results: Results, label: str, bound: float = 1.0 - SUBSTANTIAL
) -> Finding:
    """Text: longer control periods save time substantially, at the price of some deviation."""
    study = at_point(results["vehicle-control-period"], label, rank=3)
    calls, errors = study["rhs_calls"], study["rms_error"].sel(output="yaw")
    saved = float(calls.sel(control_period=LONGER_PERIOD) / calls.sel(control_period=PERIOD))
    price = float(errors.sel(control_period=LONGER_PERIOD) / errors.sel(control_period=PERIOD))
    finished = bool((study["status"].sel(control_period=[PERIOD, LONGER_PERIOD]) == "ok").all())
    text = f"evaluations with {LONGER_PERIOD:g} s as a multiple of those with {PERIOD:g} s"
    seen = f"the yaw error grows {price:.2g} times" if finished else "a run diverges"
    return Finding(saved, bound, finished and saved < bound, text, seen)


def may_deviate(results: Results, label: str) -> Finding:
    """Section 4: in some situations the reduced model leaves the full one."""
    largest = largest_deviation(at_point(results["figure-14"], label, rank=3), ANGLE)
    text = "largest deviation of the suspension's angle at twice the frequency, as of figure 14"
    return Finding(largest, VISIBLE, largest > VISIBLE, text)


def all_kinds_reduced(results: Results, label: str) -> Finding:
    """Conclusion: ordinary differential, algebraic and differential-algebraic equations."""
    reduced: set[str] = set()
    for study, (rank, _) in NOMINAL.items():
        point = at_point(results[study], label, rank=rank)
        if str(point["status"].item()) == "ok":
            reduced.add(component("model", results[study].attrs["model"]).kind)
    text = "kinds of equations whose nominal run ends with the paper's number of states"
    names = ", ".join(sorted(reduced)) or "none"
    return Finding(float(len(reduced)), 3.0, len(reduced) == 3, text, names, IN_WORDS)


def precisely_followed(results: Results, label: str) -> Finding:
    """Conclusion: the error plots show that trajectories are followed precisely."""
    found = {
        study: not_visible(at_point(results[study], label, rank=rank), outputs)
        for study, (rank, outputs) in NOMINAL.items()
    }
    worst, where = worst_of({study: finding.measured for study, finding in found.items()})
    text = "largest deviation of an output in any nominal run, as a share of its range"
    seen = f"{where}: {found[where].seen}"
    return Finding(worst, VISIBLE, all(f.met for f in found.values()), text, seen)


PERIODS, FIRST = ("vehicle-control-period",), ("figures-2-4",)
CRITERIA = {
    "gv_fig3_closely_matches": agree("figures-2-4", OUTPUTS),
    "gv_three_states_suffice": Criterion(three_states_suffice, FIRST, of_replay=False),
    "gv_control_periods_sharpen_basis": Criterion(
        shorter_periods_sharpen_basis, PERIODS, of_replay=False
    ),
    "gv_longer_period_saves_time": Criterion(longer_periods_save_time, PERIODS, of_replay=False),
    "hfv_fig10_one_state_excellent": agree("figures-9-10", HIGH_FIDELITY_OUTPUTS, rank=1),
    "all_may_deviate": Criterion(may_deviate, ("figure-14",)),
    "all_three_equation_kinds": Criterion(all_kinds_reduced, tuple(NOMINAL), of_replay=False),
    "all_follow_precisely": Criterion(precisely_followed, tuple(NOMINAL)),
    "all_accuracy_buys_time": Criterion(
        partial(longer_periods_save_time, bound=1.0 - SMALLEST_CHANGE), PERIODS, of_replay=False
    ),
}
