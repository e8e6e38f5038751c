"""Runs share plans and spaces: no result is another's, in one thread or in several."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory

CASES = {
    "independent_suspension_vehicle": ("etdrk4", ("equilibrium", "dropped")),
    "double_wishbone": ("newton_lanes", ("equilibrium",)),
}


def runs(name: str) -> list:
    """Calls that give one run each, of different maneuvers and starts."""
    model, (solver, starts) = build(name), CASES[name]
    nominal = component("maneuver", model.definition.maneuver)
    return [
        partial(
            model.simulate, nominal.perturbed(1.0, amplitude), start, solver=solver, tolerance=1e-3
        )
        for amplitude in (1.0, 0.7)
        for start in starts
    ]


def numbers(run: Trajectory) -> np.ndarray:
    return np.hstack([run.states, run.outputs])


@pytest.mark.parametrize("name", CASES)
def test_threads_do_not_share_what_they_write(name):
    calls = runs(name)
    known = [numbers(call()) for call in calls]
    with ThreadPoolExecutor(4) as pool:
        tasks = [pool.submit(calls[k % len(calls)]) for k in range(80)]
        for k, task in enumerate(tasks):
            np.testing.assert_array_equal(numbers(task.result()), known[k % len(calls)])
