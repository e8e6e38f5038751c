"""Settings of how a reduced vehicle is integrated, the same for all methods that have one."""

from collections.abc import Sequence

from vehiclemor.reduction.settings import Setting
from vehiclemor.simulation.system import SOLVERS


def online_settings(
    solver: str = "ros34pw2",
    tolerance: float = 1e-3,
    text: str = "as of full_order; ros34pw2 and etdrk4 freeze the Jacobian",
    choices: Sequence[str] = SOLVERS,
) -> dict[str, Setting]:
    """Settings `solver` and `tolerance` with these defaults."""
    return {
        "solver": Setting("text", solver, text, choices=tuple(choices)),
        "tolerance": Setting(
            "number",
            tolerance,
            "largest local error of a state relative to its typical size",
            minimum=1e-13,
        ),
    }


ONLINE_SETTINGS = online_settings()
# Projected systems have no Jacobian to freeze.
PROJECTED_TEXT = "explicit: Dormand-Prince 5(4); rodas4: Rosenbrock of order 4"
PROJECTED_SOLVERS = ("explicit", "rodas4")
