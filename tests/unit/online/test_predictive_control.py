"""The example of model-predictive control: its derivatives, and what the car does."""

import runpy
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from tests.texts.markdown import ROOT


@pytest.fixture(scope="module")
def control() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(ROOT / "examples" / "predictive_control.py")))


@pytest.fixture(scope="module")
def reduced(control):
    return vm.rom(control.MODEL)


def test_costs_fall_as_their_derivatives_say(control, reduced):
    controller, rng = control.Controller(reduced), np.random.default_rng(5)
    # Half a second before the obstacle, so that the way leads into it.
    state = reduced.state()
    state[reduced.states.index("X")] = control.OBSTACLE[0] - 15.0
    steering, along = 0.02 * rng.normal(size=(2, control.HORIZON))
    values, slopes = controller.costs(state, 0.01, steering)
    assert (values[2 * control.HORIZON : 3 * control.HORIZON] > 0.0).any()
    sides = [controller.costs(state, 0.01, steering + h * along)[0] for h in (1e-4, -1e-4)]
    difference = (sides[0] - sides[1]) / 2e-4
    np.testing.assert_allclose(slopes @ along, difference, rtol=1e-6, atol=1e-6)


def test_the_car_goes_around_the_obstacle_and_comes_back(control, reduced):
    full = vm.reduce(reduced.model, "full_order")
    runs = [control.drive(control.Controller(reduced), car, 3.6) for car in (full, reduced)]
    for run in runs:
        assert control.clearance(run["place"]) > 0.98
        assert np.abs(run["steering"]).max() < control.LIMIT
        # Begun with the plan before, a few predictions do.
        assert run["evaluations"].mean() < 6.0
        x, y, yaw = run["place"].T
        assert x[-1] > control.OBSTACLE[0] + 2.0 * control.CLEARANCE[0]
        assert abs(y[-1]) < 1.0
        assert abs(yaw[-1]) < 0.1
    # Straight on, the car would hit it.
    assert control.clearance(runs[0]["place"] * [1.0, 0.0, 0.0]) < 0.2
    # The loop is closed over the full car, whose state the reduced one begins with.
    apart = np.abs(runs[0]["place"] - runs[1]["place"]).max(axis=0)
    assert (apart < [0.02, 0.02, 2e-3]).all()
