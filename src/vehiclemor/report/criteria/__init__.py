"""The paper's claims as numeric criteria: claim -> (results, label of a method) -> finding."""

from collections.abc import Callable

from vehiclemor.report.criteria import double_wishbone, general, vehicles
from vehiclemor.report.criteria.double_wishbone import OF_SUBSPACES
from vehiclemor.report.criteria.finding import Finding, Results

CRITERIA: dict[str, Callable[[Results, str], Finding]] = {
    **double_wishbone.CRITERIA,
    **vehicles.CRITERIA,
    **general.CRITERIA,
}
# Claims about subspaces or the cost of integrating: replay has neither.
WITHOUT_REPLAY = OF_SUBSPACES | vehicles.WITHOUT_REPLAY | general.WITHOUT_REPLAY
# Label of a method in the paper's studies -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}
# Rank 6 of snapshots of rank 4: the default settings would cut it.
UNCUT = {"pod_uncut": "default, no rank cut", "pod_literal": "literal"}


def variants(claim: str) -> dict[str, str]:
    """Label of a method in the studies that a claim is judged by -> what its row is called."""
    if claim in OF_SUBSPACES:
        return {"pod": "default, literal"}
    return UNCUT if claim == "dw_fig14_six_states_follow" else VARIANTS
