"""Outputs come from several samples at once and from few points of a step; they stay the same."""

import numpy as np
import pytest

from vehiclemor.exceptions import ConvergenceError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.system import Solver

PLAIN, FIDELITY = VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")
RUNS = [(PLAIN, "lane_change"), (PLAIN, "step_steer")]
RUNS += [(FIDELITY, "rack_lane_change"), (FIDELITY, "rack_step_steer")]
# A tenth of the bounds of the predictive comparison, of the 14-DOF vehicle where they differ.
TENTH = {
    "longitudinal_position": 5e-3,
    "lateral_position": 5e-3,
    "yaw": 7.59e-6,
    "pitch": 5.18e-5,
    "lateral_speed": 1.98e-3,
    "vertical_speed": 1.43e-3,
}


@pytest.mark.parametrize("name", ["double_wishbone", *VEHICLES])
@pytest.mark.parametrize("samples", [1, 7, 8, 9, 20])
def test_samples_in_lanes_give_what_each_gives_alone(name, samples):
    model = build(name)
    run = model.simulate(component("maneuver", model.definition.maneuver))
    places = np.linspace(0, len(run.times) - 1, samples).astype(int)
    states, inputs = run.states[places], run.inputs[places]
    alone = [model.evaluated("outputs", x, u) for x, u in zip(states, inputs, strict=True)]
    scale = 1.0 + np.abs(run.outputs).max(axis=0)
    # Rounding of a slip, 2e-16, times a stiffness of 1e5 N.
    found = model.outputs_at(states, inputs)
    np.testing.assert_allclose(found / scale, alone / scale, rtol=0.0, atol=2e-11)


@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
@pytest.mark.parametrize("solver", ["ros34pw2", "etdrk4"])
@pytest.mark.parametrize(("name", "maneuver"), RUNS)
def test_a_run_read_at_few_points_is_the_run_at_its_samples(name, maneuver, solver, start):
    model, given = build(name), component("maneuver", maneuver).perturbed(0.9, 1.3)
    arguments = {"solver": solver, "tolerance": 1e-3}
    few = model.simulate(given, start, **arguments)
    # Times that are given are recorded one by one.
    each = model.simulate(given, start, given.times, **arguments)
    # Those of another amplitude are scaled.
    np.testing.assert_allclose(few.inputs, given.at(given.times), rtol=1e-15)
    assert few.counts == each.counts
    assert few.remark == each.remark
    scale = 1.0 + np.abs(each.states).max(axis=0)
    np.testing.assert_allclose(few.states / scale, each.states / scale, atol=1e-11)
    for output, tenth in TENTH.items():
        column = model.outputs.index(output)
        assert np.abs(few.outputs[:, column] - each.outputs[:, column]).max() < tenth, output
    own = Solver(solver, 1e-3)
    space = whole_space(2 * len(model.coordinates))
    run = model.system.run(given, model.start(start), space, own, 0.0)
    assert len(run.places)
    assert len(run.path) < len(few.times)


@pytest.mark.parametrize("solver", ["ros34pw2", "dopri5"])
def test_a_run_that_leaves_its_range_says_when_and_ends_there(solver):
    model = build("independent_suspension_vehicle")
    wild = component("maneuver", "lane_change").perturbed(1.0, 6.0)
    failed = []
    for times in (None, wild.times):
        with pytest.raises(ConvergenceError) as error:
            model.simulate(wild, "equilibrium", times, solver, 1e-4)
        failed.append(error.value.trajectory)
    few, each = failed
    assert few.status == "diverged"
    assert few.message.rpartition(";")[0] or few.message
    for run in failed:
        finite = np.isfinite(run.states).all(axis=1)
        assert 0 < finite.sum() < len(finite)
        assert not np.isfinite(run.outputs[~finite]).any()
        assert (np.diff(finite.astype(int)) <= 0).all()
    np.testing.assert_array_equal(np.isfinite(few.states), np.isfinite(each.states))
    assert few.message.split(" at ")[1] == each.message.split(" at ")[1]
