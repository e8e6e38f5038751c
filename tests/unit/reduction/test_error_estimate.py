"""Errors of reduced vehicles are estimated by the full equations, and judge their runs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from reduced_models import in_bounds

import vehiclemor as vm
from tests.models import CAR, FIDELITY
from vehiclemor.exceptions import InputError
from vehiclemor.files import data_names
from vehiclemor.inputs.maneuver import registered
from vehiclemor.registry import component
from vehiclemor.study.plans.loading import read_study, study_path
from vehiclemor.study.plans.protocol import PREFIX, load_protocol

# Random steering that no model is trained on.
STEERING = {CAR: "random_steer:101", FIDELITY: "rack_random_steer:101"}


@cache
def shipped(name):
    return vm.rom(name)


def run_and_full(name, **how):
    rom = shipped(name)
    maneuver = replace(registered(STEERING[name]), **how)
    return rom.simulate(maneuver), rom.model.simulate(maneuver)


@pytest.mark.parametrize("name", STEERING)
def test_it_is_the_error_of_a_run_that_was_not_trained_on(name):
    run, full = run_and_full(name)
    estimate, output = run.error_estimate, "lateral_position"
    apart = (run[output] - full[output])[np.searchsorted(run.times, estimate.times - 1e-9)]
    # A small error is looked at roughly: to some tenths of its bound, 0.05 m.
    np.testing.assert_allclose(estimate[output], apart, atol=7.5e-3)
    protocol = load_protocol(f"predictive-{name}")
    assert estimate.in_bounds == pytest.approx(in_bounds(protocol, run, full), abs=0.15)


@pytest.mark.parametrize("method", ["pod", "linear_single_track"])
def test_a_large_error_is_known_to_a_hundredth(method):
    rom = vm.reduce(CAR, method)
    maneuver = vm.maneuver("lane_change", amplitude=1.3)
    run, full = rom.simulate(maneuver), rom.model.simulate(maneuver)
    true = in_bounds(load_protocol(f"predictive-{CAR}"), run, full)
    assert true > 10.0
    assert run.status == "untrusted"
    estimate = run.error_estimate
    assert estimate.in_bounds == pytest.approx(true, rel=0.01)
    assert estimate.in_bounds == pytest.approx(max(part[-1] for part in estimate.used.values()))


@pytest.mark.parametrize("name", STEERING)
def test_full_order_has_no_error(name):
    rom = vm.reduce(name, "full_order")
    run = rom.simulate(STEERING[name])
    assert run.error_estimate is None
    judged = replace(rom, method="pod", reduced=replace(rom.reduced, tolerance=1e-6))
    assert judged.simulate(STEERING[name]).error_estimate.in_bounds < 0.2


def test_a_run_with_few_output_times_has_the_same_estimate():
    run, _ = run_and_full(CAR)
    sparse, _ = run_and_full(CAR, samples=11)
    assert len(sparse.times) == 11
    assert sparse.error_estimate.in_bounds == pytest.approx(run.error_estimate.in_bounds, rel=0.3)


def test_a_run_is_judged_by_the_bounds_that_are_given():
    rom = shipped(CAR)
    run = rom.simulate()
    assert run.status == "ok"
    assert run.trust.indicator == pytest.approx(1.25 * run.error_estimate.in_bounds)
    largest = np.abs(run.error_estimate["yaw_rate"]).max()
    # The yaw rate passes its bound first, the place by more.
    strict = rom.simulate(bounds={"yaw_rate": 0.9 * largest, "lateral_position": 0.0008})
    assert strict.status == "untrusted"
    assert strict.message.startswith("the estimated error of lateral_position is 0.001")
    assert "bound 0.0008 m; errors pass the limit, 0.8 of a bound, from t = 2." in strict.message
    single = np.float32(0.9 * largest)
    assert rom.simulate(bounds={"yaw_rate": ("rms", single)}).status == "ok"
    for wrong in ({"yow": 1.0}, {"yaw": 0.0}, {"yaw": ("mean", 1.0)}, {"yaw": 1e-300}, 3.0, {}):
        with pytest.raises(InputError):
            rom.simulate(bounds=wrong)
    with pytest.raises(InputError, match="trust"):
        rom.simulate(bounds={"yaw": 1.0}, trust="off")
    for name, method in ((CAR, "full_order"), (CAR, "replay"), ("flexible_truck", "craig_bampton")):
        model = vm.reduce(name, method)
        with pytest.raises(InputError, match="not estimated"):
            model.simulate(bounds={model.model.outputs[0]: 1.0})


def test_an_error_that_passes_its_bound_by_rounding_has_a_message():
    estimate = shipped(CAR).simulate().error_estimate
    trust = replace(estimate, in_bounds=np.nextafter(0.8, 1.0)).trust()
    assert trust.until == estimate.times[-1]
    assert "the estimated error of" in trust.reason


def test_errors_in_bounds_follow_the_parameters_of_the_model():
    # The second one uses the arrays of the first one again.
    for mass in (1437.37, 1602.37):  # kg
        heavy = vm.model(CAR, parameters={"sprung_mass": mass})
        run = vm.reduce(heavy, "linear_single_track").simulate(bounds={"Fx_FL": 1.0})
        estimate, full = run.error_estimate, heavy.simulate(registered("lane_change"))
        largest = np.abs(run["Fx_FL"] - full["Fx_FL"]).max()
        assert estimate.in_bounds == pytest.approx(largest, rel=0.01)
        assert estimate.in_bounds == pytest.approx(estimate.used["Fx_FL"][-1], rel=1e-9)


def test_many_runs_are_judged_as_single_ones_by_the_bounds_that_are_given():
    rom, times = shipped(CAR), np.linspace(0.0, 2.0, 101)
    signals = vm.many_signals(times, [0.01 * times, 0.02 * times])
    bounds = {"yaw": ("rms", 1e-5), "yaw_rate": 1e-4}
    many = vm.simulate_many(rom, signals, bounds=bounds)
    indicators = [rom.simulate(signal, bounds=bounds).trust.indicator for signal in signals]
    assert many["indicator"].values.tolist() == indicators
    assert indicators != vm.simulate_many(rom, signals)["indicator"].values.tolist()
    for model, how in ((rom, {"trust": "off"}), (rom.model, {}), (vm.reduce(CAR, "replay"), {})):
        with pytest.raises(InputError, match="trust" if how else "not estimated"):
            vm.simulate_many(model, signals, bounds=bounds, **how)
    with pytest.raises(InputError, match="yow"):
        vm.simulate_many(rom, signals, bounds={"yow": 1.0})


def test_it_can_be_left_out():
    rom = shipped(CAR)
    run = rom.simulate(trust="off")
    assert (run.status, run.trust, run.error_estimate) == ("ok", None, None)
    assert run.remark == "its error was not estimated"
    np.testing.assert_array_equal(run.outputs, rom.simulate().outputs)
    many = vm.simulate_many(rom, ["lane_change"], trust="off")
    assert many["remark"].item() == "its error was not estimated"
    with pytest.raises(InputError, match="trust"):
        rom.simulate(trust="none")


def test_what_can_not_be_followed_is_not_trusted():
    rom = shipped(CAR)
    thrown = rom.model.start()
    thrown[rom.model.definition.states.index("phi")] = 0.9
    run = rom.simulate(start=thrown)
    assert run.status == "untrusted"
    assert run.trust.indicator > 10.0


def test_violations_of_a_start_decay_as_those_of_the_full_model():
    rom = shipped(FIDELITY)
    bent = rom.model.start()
    bent[rom.model.definition.states.index("beta_FR")] += 0.2  # rad, a tie rod
    maneuver = registered("rack_lane_change")
    run, full = rom.simulate(maneuver, start=bent), rom.model.simulate(maneuver, bent)
    true = in_bounds(load_protocol(f"predictive-{FIDELITY}"), run, full)
    assert true > 2.0
    assert run.error_estimate.in_bounds == pytest.approx(true, rel=0.1)


@pytest.mark.parametrize("length", [0.05, 0.2])
def test_a_short_run_is_judged(length):
    rom = shipped(FIDELITY)
    high = rom.model.start()
    high[rom.model.definition.states.index("z")] += 0.1
    straight = {"inputs": ["s"], "hold": "cubic", "output_step": 0.005}
    signal = vm.Signal.from_samples([0.0, length], np.zeros((2, 1)), **straight)
    run, full = rom.simulate(signal, high), rom.model.simulate(signal, high)
    true = in_bounds(load_protocol(f"predictive-{FIDELITY}"), run, full)
    assert true > 2.0
    assert run.status == "untrusted"
    assert run.error_estimate.in_bounds == pytest.approx(true, rel=0.1)


@pytest.mark.parametrize("apart", [0.1, 0.037], ids=["at nodes", "between nodes"])
def test_inputs_that_jump_are_no_error(apart):
    t = np.arange(0.0, 10.0, apart)
    steering = 0.02 * np.sin(1.5 * t) * (t > 0.5)
    run = shipped(CAR).simulate(vm.Signal.from_samples(t, steering, hold="zero"))
    # Whole steps, taken where they are recorded, would be 3.3 and 1.2 bounds; the error is 0.05.
    assert run.error_estimate.in_bounds < 0.5


@pytest.mark.parametrize("rise", [1e-6, 3e-3, 0.03])
def test_a_steep_change_between_two_samples_is_like_a_jump(rise):
    t = [*np.linspace(0.0, 0.5, 26), 0.5 + rise, 1.0, 1.0 + rise, 2.0]
    steering = np.repeat([0.0, 0.02, -0.02], [26, 2, 2])
    run = shipped(CAR).simulate(vm.Signal.from_samples(t, steering))
    # Taken as they are at the nodes they would be 3.7 and 1.6 bounds; the error is 0.2 to 0.3.
    assert run.error_estimate.in_bounds < 0.5


@pytest.mark.parametrize(("speed", "rate", "height"), [(27.0, 100, 0.002), (20.0, 50, 0.004)])
def test_a_spike_of_one_sample_is_looked_at_closely(speed, rate, height):
    start = vm.model(FIDELITY, parameters={"initial_speed": speed}).start()
    t = np.arange(0.0, 10.0, 1.0 / rate)
    signal = vm.Signal.from_samples(t, height * (t == 5.0), "cubic", inputs=["s"])
    # At nodes 40 ms apart the estimate would be 0.2 and 0.4 bounds.
    run, full = (m.simulate(signal, start) for m in (shipped(FIDELITY), shipped(FIDELITY).model))
    true = in_bounds(load_protocol(f"predictive-{FIDELITY}"), run, full)
    assert (run.status, run.error_estimate.in_bounds) == ("untrusted", pytest.approx(true, rel=0.1))


def test_inputs_that_jump_may_stand_in_any_order():
    t = np.linspace(0.0, 2.0, 21)
    sine, cosine = 1e-3 * np.sin(3.0 * t), 1e-3 * np.cos(3.0 * t)
    named = {"s": sine, "s_dot": 3.0 * cosine, "s_ddot": -9.0 * sine}

    def estimate(*names):
        values = np.stack([named[name] for name in names], axis=1)
        signal = vm.Signal.from_samples(t, values, hold="zero", inputs=names)
        return shipped(FIDELITY).simulate(signal).error_estimate.in_bounds

    assert estimate("s_ddot", "s", "s_dot") == estimate("s", "s_dot", "s_ddot")


def test_a_run_that_is_too_short_says_so():
    signal = vm.Signal.from_samples([0.0, 0.02], [0.0, 0.01], output_step=0.005)
    run = shipped(CAR).simulate(signal)
    assert (run.error_estimate, run.remark) == (None, "its error was not estimated")
    assert vm.reduce(CAR, "full_order").simulate(signal).remark == ""


def test_bounds_are_those_of_the_studies():
    for name in [name for name in data_names("studies") if name.startswith(PREFIX)]:
        study = read_study(study_path(name))
        known = component("model", study.model).error_bounds
        if known:
            bounds = study.bounds.items()
            assert {o: (b.measure, b.bound) for o, b in bounds} == {
                o: (b.measure, b.bound) for o, b in known.items()
            }
