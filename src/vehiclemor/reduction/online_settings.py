"""Settings of how a reduced vehicle is integrated, the same for all methods that have one."""

from vehiclemor.reduction.settings import Setting
from vehiclemor.simulation.system import SOLVERS

ONLINE_SETTINGS = {
    "solver": Setting(
        "text",
        "ros34pw2",
        "as of full_order; ros34pw2 and etdrk4 freeze the Jacobian",
        choices=SOLVERS,
    ),
    "tolerance": Setting(
        "number", 1e-3, "largest local error of a state relative to its typical size", minimum=1e-13
    ),
}
