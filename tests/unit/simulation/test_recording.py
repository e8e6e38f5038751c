"""Histories are made when they are read, and are the same however they are read."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.registry import component

DYNAMIC = ("independent_suspension_vehicle", "high_fidelity_vehicle")


# One model: its runs share what they are recorded in.
model_of = cache(vm.model)


def run(name: str, solver: str = "ros34pw2", amplitude: float = 1.0):
    model = model_of(name)
    maneuver = component("maneuver", model.definition.maneuver).perturbed(1.0, amplitude)
    return model.simulate(maneuver, solver=solver, tolerance=1e-4)


@pytest.mark.parametrize("solver", ["dopri5", "ros34pw2"])
@pytest.mark.parametrize("name", DYNAMIC)
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


def test_what_is_read_late_is_of_its_own_run():
    name, sizes = "independent_suspension_vehicle", (1.0, 0.5)
    known = [run(name, amplitude=size).outputs for size in sizes]
    assert not np.array_equal(*known)
    late = [run(name, amplitude=size) for size in sizes]
    for found, expected in zip(late, known, strict=True):
        np.testing.assert_array_equal(found.outputs, expected)


def test_copies_hold_the_same_histories():
    kept = run("independent_suspension_vehicle")
    for copy in (pickle.loads(pickle.dumps(kept)), replace(kept, remark="seen")):  # noqa: S301
        np.testing.assert_array_equal(copy.states, kept.states)
        np.testing.assert_allclose(copy["pitch"], kept["pitch"], rtol=1e-11)


def test_an_unknown_output_is_refused():
    for name in (*DYNAMIC, "double_wishbone"):
        with pytest.raises(InputError, match="steer_angle"):
            run(name, "newton" if name == "double_wishbone" else "ros34pw2")["steer_angle"]


def test_a_run_is_no_sequence():
    with pytest.raises(TypeError):
        list(run("independent_suspension_vehicle"))


def test_from_where_a_run_has_left_the_model_on_there_are_no_numbers():
    model = vm.model("independent_suspension_vehicle")
    wild = component("maneuver", "lane_change").perturbed(1.0, 8.0)
    with pytest.raises(ConvergenceError) as caught:
        model.simulate(wild, solver="ros34pw2", tolerance=1e-4)
    found = caught.value.trajectory
    finite = np.isfinite(found.states).all(axis=1)
    left = int(finite.argmin())
    assert 0 < left < len(finite)
    assert f"{found.times[left]:.6g} s" in found.message
    assert not finite[left:].any()
    assert np.isnan(found["yaw"][left:]).all()
    assert np.isfinite(found["yaw"][:left]).all()
