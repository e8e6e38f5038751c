"""The paper's claim on the high-fidelity vehicle, figures 9 and 10, as a criterion."""

from collections.abc import Callable

from vehiclemor.report.criteria.finding import Finding, Results, at_point
from vehiclemor.report.criteria.starts import closely_followed

OUTPUTS = ("longitudinal_position", "lateral_position", "lateral_speed", "vertical_speed")


def one_state_suffices(results: Results, label: str) -> Finding:
    """Figures 9 and 10: with one state path, lateral and vertical speed agree excellently."""
    return closely_followed(at_point(results["figures-9-10"], label, rank=1), OUTPUTS)


CRITERIA: dict[str, Callable[[Results, str], Finding]] = {
    "hfv_fig10_one_state_excellent": one_state_suffices,
}
