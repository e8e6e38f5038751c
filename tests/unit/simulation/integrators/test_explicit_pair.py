"""An explicit pair that is declared by its table alone.

P. Bogacki, L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Appl. Math. Lett. 2 (1989) 321-325.
"""

import numpy as np
import pytest

from tests.unit.standard_problems import driven, maneuver
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS, Integrator
from vehiclemor.simulation.integrators.dopri5 import TABLE
from vehiclemor.simulation.integrators.explicit_pair import pair_table, scratch_rows
from vehiclemor.simulation.loop_arguments import Control

WEIGHTS = ((1 / 2,), (0.0, 3 / 4), (2 / 9, 1 / 3, 4 / 9))
ERROR = (2 / 9 - 7 / 24, 1 / 3 - 1 / 4, 4 / 9 - 1 / 3, -1 / 8)
PAIRS = {
    "bogacki_shampine": (3, Control(1 / 3, 1 / 3), pair_table(WEIGHTS, ERROR)),
    "table": (5, INTEGRATORS["dopri5"].control, TABLE),
}
DRIVEN = maneuver(driven, 8.0)


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    for name, (order, control, table) in PAIRS.items():
        rows = scratch_rows(table)
        pair = Integrator("", ("explicit_pair",), order, control, rows, tableau=table)
        monkeypatch.setitem(INTEGRATORS, name, pair)


def error(model, **how) -> float:
    """Largest error of the pendulum's angle at 999 times; it is cos t."""
    run = model.simulate(DRIVEN, times=np.linspace(0.0, 8.0, 999), **how)
    return float(np.abs(run["angle"] - np.cos(run.times)).max())


def test_its_error_falls_with_its_order_and_follows_the_tolerance(standard):
    model, how = standard(), {"solver": "bogacki_shampine"}
    errors = [error(model, **how, tolerance=0.1, longest_step=0.16 / 2**k) for k in range(4)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.median(orders) == pytest.approx(3.0, abs=0.2)
    loose, tight = (error(model, **how, tolerance=tolerance) for tolerance in (1e-4, 1e-7))
    assert tight < 1e-5 < loose < 1e-2


def test_a_pair_that_is_written_out_gives_what_its_table_gives(standard):
    # Its own dense output is of higher order.
    model, times = standard(), np.array([8.0])
    runs = [model.simulate(DRIVEN, None, times, name, 1e-8) for name in ("dopri5", "table")]
    assert runs[0].counts == runs[1].counts
    np.testing.assert_allclose(runs[0].states, runs[1].states, rtol=0, atol=1e-12)
