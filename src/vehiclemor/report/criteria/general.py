"""The paper's claims on all three models, as criteria that can fail."""

from collections.abc import Callable
from functools import partial

from vehiclemor.registry import component
from vehiclemor.report.criteria.double_wishbone import ANGLE, BOTH
from vehiclemor.report.criteria.finding import (
    IN_WORDS,
    SMALLEST_CHANGE,
    VISIBLE,
    Finding,
    Results,
    at_point,
    largest_deviation,
    not_visible,
    worst_of,
)
from vehiclemor.report.criteria.vehicles import (
    HIGH_FIDELITY_OUTPUTS,
    OUTPUTS,
    longer_periods_save_time,
)

# Study of a nominal run -> the paper's rank, outputs that its figures show.
NOMINAL = {
    "figures-2-4": (3, OUTPUTS),
    "figures-6-7": (3, BOTH),
    "figures-9-10": (1, HIGH_FIDELITY_OUTPUTS),
}


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


CRITERIA: dict[str, Callable[[Results, str], Finding]] = {
    "all_may_deviate": may_deviate,
    "all_three_equation_kinds": all_kinds_reduced,
    "all_follow_precisely": precisely_followed,
    "all_accuracy_buys_time": partial(longer_periods_save_time, bound=1.0 - SMALLEST_CHANGE),
}
WITHOUT_REPLAY = frozenset({"all_three_equation_kinds", "all_accuracy_buys_time"})
