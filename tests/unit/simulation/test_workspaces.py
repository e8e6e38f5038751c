"""Runs share plans and spaces: no result is another's, in one thread or in several."""

import ctypes
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.evaluation import path_loops
from vehiclemor.simulation.loop_arguments import NODE_1, NODE_2, Outputs
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.simulation.workspaces import Solver

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


def test_a_run_keeps_its_path_until_it_gives_it_back():
    model = build("independent_suspension_vehicle")
    maneuver, space = component("maneuver", "lane_change"), whole_space(28)
    own = Solver("etdrk4", 1e-3)

    def run(start: str):
        return model.system.run(maneuver, model.start(start), space, own, 0.0)

    first = run("equilibrium")
    known = first.path.copy()
    second = run("dropped")
    np.testing.assert_array_equal(first.path, known)
    assert not np.shares_memory(first.recorded_states, second.recorded_states)
    second.give_back()
    second.give_back()
    third, fourth = run("dropped"), run("dropped")
    assert np.shares_memory(third.recorded_states, second.recorded_states)
    assert not np.shares_memory(third.recorded_states, fourth.recorded_states)


def test_limits_are_watched_between_the_points_of_a_step(rng):
    pointers = [ctypes.POINTER(ctypes.c_double)] * 4

    def outputs(x, _u, _constants, result):
        result[0], result[1] = x[0], -x[0]

    kernel = ctypes.CFUNCTYPE(None, *pointers)(outputs)
    address = np.array([ctypes.cast(kernel, ctypes.c_void_p).value], dtype=np.int64)
    nodes, parts = np.array([NODE_1, NODE_2, 1 - NODE_2, 1 - NODE_1]), np.linspace(0.0, 1.0, 41)
    places = np.column_stack([np.repeat([0.0, 1.0, 5.0], [1, 41, 1]), [-1.0, *parts, -1.0]])
    found = set()
    for draw in range(200):
        states = rng.normal(size=(6, 1))
        if draw % 4 == 0:
            states[rng.integers(1, 5)] = (np.nan, np.inf)[draw % 8 == 0]
        cubic = np.linalg.solve(np.vander(nodes), states[1:5, 0])
        expected = np.concatenate([states[0], np.polyval(cubic, parts), states[5]])
        low, high = np.sort(rng.normal(scale=4.0, size=2))
        ranges = np.array([[low, high], [-np.inf, 2.5]])
        # The state itself, and what the kernel makes of it.
        outputs_of = Outputs(address, np.zeros(1), np.array([0, -2]), ranges)
        run = states, np.zeros((6, 1)), places, outputs_of, np.empty((6, 2))
        first, chosen = np.empty(2, dtype=np.int64), np.empty((2, 43))
        result = np.empty((43, 2))
        path_loops()["watched"](*run, first)
        path_loops()["chosen"](*run, chosen)
        path_loops()["sampled"](states * [1.0, -1.0], places, result)
        np.testing.assert_array_equal(np.isfinite(chosen.T), np.isfinite(result))
        if np.isfinite(states).all():
            np.testing.assert_allclose(chosen, [expected, -expected], atol=1e-12)
            np.testing.assert_allclose(result.T, chosen, atol=1e-12)
        for k, (a, b) in enumerate(ranges):
            values = chosen[k]
            outside = np.flatnonzero(~((a <= values) & (values <= b)))
            assert first[k] == (outside[0] if len(outside) else 43)
            found.add((k, bool(len(outside)), bool(first[k] in (0, 43))))
    assert {(1, False, True), (1, True, False), (0, True, False)} <= found
