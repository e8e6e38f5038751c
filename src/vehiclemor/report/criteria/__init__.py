"""The paper's claims as numeric criteria: claim -> (results, label of a method) -> finding."""

from collections.abc import Callable

from vehiclemor.report.criteria import double_wishbone, vehicles
from vehiclemor.report.criteria.finding import Finding, Results

CRITERIA: dict[str, Callable[[Results, str], Finding]] = {
    **double_wishbone.CRITERIA,
    **vehicles.CRITERIA,
}
# Claims about subspaces or the cost of integrating: replay has neither.
WITHOUT_REPLAY = double_wishbone.WITHOUT_REPLAY | vehicles.WITHOUT_REPLAY
