"""The paper's claims as numeric criteria."""

from vehiclemor.report.criteria import double_wishbone, vehicles
from vehiclemor.report.criteria.finding import Criterion

CRITERIA: dict[str, Criterion] = {**double_wishbone.CRITERIA, **vehicles.CRITERIA}
