"""Histories are made when they are read, and are the same however they are read."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.exceptions import InputError
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
