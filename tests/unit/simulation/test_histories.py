"""Histories of runs: labelled, made when they are read, the same however they are read."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR, FIDELITY, VEHICLES
from vehiclemor.exceptions import ConvergenceError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.system import Solver
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, trajectory_dataset


def test_dataset_is_labelled_with_names_and_units(model, full):
    further = {"error": ("output", np.arange(6.0), {"units": "see output_unit"})}
    dataset = trajectory_dataset(model, full, further)
    outputs = len(model.outputs)
    assert dataset.sizes == {"time": 1001, "coordinate": 8, "output": outputs, "input": 2}
    eta = dataset["coordinates"].sel(coordinate="eta")
    np.testing.assert_array_equal(eta, full.coordinates[:, model.coordinates.index("eta")])
    np.testing.assert_array_equal(dataset["outputs"].sel(output="second_euler_angle"), eta)
    np.testing.assert_array_equal(dataset["inputs"].sel(input="z"), full.inputs[:, 0])
    np.testing.assert_array_equal(dataset["error"], np.arange(6.0))
    assert {count: int(dataset[count]) for count in ALGEBRAIC_COUNTS} == full.counts
    assert all(v.attrs.get("long_name") for k, v in dataset.variables.items() if k != "error")
    assert all(dataset[name].attrs["units"] for name in ("seconds", "time", *ALGEBRAIC_COUNTS))
    # There is a unit where all have it; outputs are in m and rad: each has its own beside it.
    assert dataset["inputs"].attrs["units"] == "m"
    for name in ("outputs", "error", "coordinates"):
        assert "units" not in dataset[name].attrs
        label = "coordinate" if name == "coordinates" else "output"
        assert set(dataset[name][f"{label}_unit"].values) == {"m", "rad"}
    own = dataset["outputs"].sel(output="second_euler_angle")["output_unit"]
    assert str(own.item()) == "rad"


# One model: its runs share what they are recorded in.
model_of = cache(vm.model)


def run(name: str, solver: str = "etdrk4", amplitude: float = 1.0):
    model = model_of(name)
    maneuver = component("maneuver", model.definition.maneuver).perturbed(1.0, amplitude)
    return model.simulate(maneuver, solver=solver, tolerance=1e-4)


@pytest.mark.parametrize("solver", ["dopri5", "etdrk4"])
@pytest.mark.parametrize("name", VEHICLES)
def test_one_output_is_that_of_all(name, solver):
    one, all_of_them = run(name, solver), run(name, solver)
    whole = all_of_them.outputs
    some = [*one.names[::3], one.model.coordinates[-1], one.model.speeds[0]]
    chosen = all_of_them.chosen(some, times=one.times[5::100])
    assert chosen.names == tuple(some)
    for column, quantity in enumerate(some):
        known = quantity in one.names
        history = whole[:, one.names.index(quantity)] if known else all_of_them[quantity]
        # Forces of tires and violations of constraints are small differences.
        rounding = max(1e-11 * abs(history).max(), 1e-15)
        np.testing.assert_allclose(one[quantity], history, rtol=0, atol=rounding)
        np.testing.assert_allclose(chosen[quantity], history[5::100], rtol=0, atol=rounding)
        np.testing.assert_array_equal(chosen.outputs[:, column], chosen[quantity])
    np.testing.assert_array_equal(one.outputs, whole)
    np.testing.assert_array_equal(one["yaw"], one.outputs[:, one.names.index("yaw")])


def test_copies_hold_the_same_histories():
    kept = run("independent_suspension_vehicle")
    for copy in (pickle.loads(pickle.dumps(kept)), replace(kept, remark="seen")):  # noqa: S301
        np.testing.assert_array_equal(copy.states, kept.states)
        np.testing.assert_allclose(copy["pitch"], kept["pitch"], rtol=1e-11)


RUNS = [(CAR, "lane_change"), (CAR, "step_steer")]
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


@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
@pytest.mark.parametrize(("name", "maneuver"), RUNS)
def test_a_run_read_at_few_points_is_the_run_at_its_samples(name, maneuver, start):
    model, given = build(name), component("maneuver", maneuver).perturbed(0.9, 1.3)
    arguments = {"solver": "etdrk4", "tolerance": 1e-3}
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
    own = Solver("etdrk4", 1e-3)
    space = whole_space(2 * len(model.coordinates))
    run = model.system.run(given, model.start(start), space, own, 0.0)
    assert len(run.output.point_of_sample)
    assert len(run.path) < len(few.times)


@pytest.mark.parametrize("solver", ["etdrk4", "dopri5"])
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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_limit_that_is_passed_between_the_points_of_a_step_ends_the_run(sign):
    model, given = build(CAR), component("maneuver", "lane_change")
    how = {"solver": "etdrk4", "tolerance": 0.1}
    turning = sign * model.simulate(given, **how)["yaw_rate"]
    # Passed in a few samples about the largest value.
    most = 0.999 * turning.max()
    limits = {"yaw_rate": (-9.0, most) if sign > 0.0 else (-most, 9.0)}
    narrow = replace(model, definition=replace(model.definition, validity=limits))
    with pytest.raises(ConvergenceError) as error:
        narrow.simulate(given, **how)
    known = np.isfinite(error.value.trajectory.outputs).all(axis=1)
    assert known.sum() == np.argmax(turning > most)
