"""Reduced models tell of inputs that they have not been trained on, between output times too."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from vehiclemor.exceptions import InputError


@cache
def shipped(name):
    return vm.rom(name)


def test_the_whole_signal_is_looked_at():
    times = np.array([0.0, 1.0, 1.3, 1.7, 2.0, 3.0])
    values = np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [-1.0, -3.0], [0.0, 0.0], [0.0, 0.0]])
    for hold in ("zero", "linear", "cubic"):
        signal = vm.Signal.from_samples(times, values, hold)
        fine = np.linspace(0.0, 3.0, 300_001)[:-1]
        u = signal.at(fine)
        low, high, _ = signal.extent(np.array([[-np.inf] * 2, [np.inf] * 2]))
        np.testing.assert_allclose(low, u.min(axis=0), rtol=0.01, atol=1e-12)
        np.testing.assert_allclose(high, u.max(axis=0), rtol=0.01, atol=1e-12)


def test_bounds_of_inputs_hold_between_output_times_in_full_order_too():
    car = shipped(CAR).model
    times, values = [0.0, 3.0, 3.0005, 3.001, 10.0], [0.0, 0.0, 3.0, 0.0, 0.0]
    signal = vm.Signal.from_samples(times, values)
    refusal = r"input delta is \S+ rad at t = 3.0\d* s; \S+ holds from -1.066 to 1.066 rad"
    for simulate in (car.simulate, shipped(CAR).simulate):
        with pytest.raises(InputError, match=refusal):
            simulate(signal)
    signals = vm.many_signals(times, [values, np.multiply(values, 0.01)])
    many = vm.simulate_many(car, signals, outputs=["yaw"])
    assert many["status"].values.tolist() == ["rejected", "ok"]
    assert "holds from -1.066 to 1.066 rad" in many["message"].values[0]


def test_a_vehicle_without_error_bounds_knows_its_training():
    car = vm.model(CAR)
    car = replace(car, definition=replace(car.definition, error_bounds={}))
    pod, wider = vm.reduce(car, "pod", rank=3), vm.maneuver("lane_change", amplitude=1.3)
    assert pod.simulate("lane_change").status == "ok"
    run = pod.simulate(wider)
    assert run.status == "untrusted"
    assert "leaves its known range" in run.message
    assert pod.simulate(wider, bounds={"yaw": 10.0}).status == "ok"


def test_a_lower_rank_than_asked_for_is_told():
    told = "effective rank 4, where 8 is asked for: training has no more"
    pod = vm.reduce("double_wishbone", "pod", rank=8, training="nominal")
    assert told in str(pod)
    assert pod.simulate().remark == told
    assert vm.simulate("double_wishbone", "pod", rank=8)["remark"].item() == told
    assert vm.simulate("double_wishbone", "pod", rank=4)["remark"].item() == ""
