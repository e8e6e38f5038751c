"""Torques, friction and roads: driven by a run, constant in it, or their defaults."""

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.exceptions import InputError
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory

CAR = "independent_suspension_vehicle"
BRAKES = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)
FRICTIONS = tuple(f"friction_{wheel}" for wheel in WHEELS)


def braking(torque: float, duration: float = 3.0, **columns: float) -> vm.Signal:
    """All brakes from 0.5 s on, and further columns that are constant."""
    t = np.array([0.0, 0.5, 0.7, duration])
    brake = np.outer([0.0, 0.0, torque, torque], [1.0, 1.0, 0.5, 0.5])
    constant = [np.full(len(t), value) for value in columns.values()]
    values = np.column_stack([brake, *constant])
    return vm.Signal.from_samples(t, values, inputs=[*BRAKES, *columns])


def car(speed: float = 20.0, **inputs: float) -> Model:
    return vm.model(CAR, {"initial_speed": speed}, inputs=inputs)


@pytest.fixture(scope="module")
def braked() -> Trajectory:
    return car().simulate(braking(600.0))


def test_a_run_drives_what_its_signal_names(braked):
    assert car().inputs == ("delta",)
    assert braked.model.inputs == ("delta", *BRAKES)
    assert braked.inputs[-1].tolist() == [0.0, 600.0, 600.0, 300.0, 300.0]
    slowed = braked.chosen("longitudinal_speed").outputs[:, 0]
    assert slowed[-1] < 16.0
    assert braked.model.driven_by(vm.maneuver("lane_change")) is braked.model


def test_what_is_not_driven_is_at_its_default(braked):
    """A friction of 1 in a column is the friction that the equations have without it."""
    same = car().simulate(braking(600.0, **dict.fromkeys(FRICTIONS, 1.0)))
    assert same.model.inputs == ("delta", *BRAKES, *FRICTIONS)
    np.testing.assert_allclose(same.states, braked.states, rtol=1e-6, atol=1e-6)
    # A run of steering on the model that has brakes and friction: neither acts.
    step = vm.maneuver("step_steer")
    on_all, alone = same.model.simulate(step), car().simulate(step)
    np.testing.assert_allclose(on_all.states, alone.states, rtol=1e-6, atol=1e-6)


def test_a_constant_input_is_a_parameter():
    slippery = dict.fromkeys(FRICTIONS, 0.4)
    constant, driven = car(**slippery), car()
    assert constant.parameters["friction_FL"] == 0.4
    assert constant.kernel_hash != driven.kernel_hash
    a, b = constant.simulate(braking(600.0)), driven.simulate(braking(600.0, **slippery))
    np.testing.assert_allclose(a.states, b.states, rtol=1e-6, atol=1e-6)
    as_parameter = vm.model(CAR, {"initial_speed": 20.0, **slippery})
    assert as_parameter.kernel_hash == constant.kernel_hash


def test_with_the_height_of_a_road_its_rate_is_driven():
    t = np.linspace(0.0, 2.0, 201)
    heights = 0.01 * np.sin(np.pi * np.clip(t - 0.5, 0.0, 1.0)) ** 4
    bump = vm.Signal.from_samples(t, heights, "cubic", inputs="road_RL")
    run = car().simulate(bump)
    assert run.model.inputs == ("delta", "road_RL", "road_RL_dot")
    np.testing.assert_allclose(
        run.inputs[:, 2], np.gradient(run.inputs[:, 1], run.times), atol=1e-3
    )
    with pytest.raises(InputError, match="derivatives of road_RL follow from a cubic hold alone"):
        car().simulate(vm.Signal.from_samples(t, heights, inputs="road_RL"))


def test_a_vehicle_that_comes_to_rest_has_stopped():
    run = car(5.0).simulate(braking(600.0))
    assert run.status == "stopped"
    assert run.message == f"the vehicle stops at t = {run.times[run.samples_to_stop]:.4g} s"
    assert np.isnan(run.outputs[run.samples_to_stop :]).all()
    assert np.isfinite(run.outputs[: run.samples_to_stop]).all()
    rough = car(5.0).simulate(braking(600.0), solver="rodas4", tolerance=1e-3)
    errors = vm.errors(rough, run)["max_error"].sel(output="longitudinal_position")
    assert 0.0 < errors < 1e-2


def test_a_remark_names_the_wheels_that_lock():
    slippery = car(**dict.fromkeys(FRICTIONS, 0.3))
    run = slippery.simulate(braking(1200.0))
    assert "slip beyond 0.2, locked or spinning: FL (first at" in run.remark
    assert "etdrk4 errs there" not in run.remark
    frozen = slippery.simulate(braking(1200.0), solver="etdrk4", tolerance=1e-3)
    assert "etdrk4 errs there" in frozen.remark
    position = vm.errors(frozen, run)["max_error"].sel(output="longitudinal_position")
    anew = slippery.simulate(braking(1200.0), solver="rodas4", tolerance=1e-3)
    assert vm.errors(anew, run)["max_error"].sel(output="longitudinal_position") < 0.2 * position
    assert "slip" not in car().simulate(vm.maneuver("step_steer", 1.0, 3.0)).remark


def test_a_model_reduced_from_braked_runs_is_saved_with_its_inputs(tmp_path):
    rom = vm.reduce(car(), "pod", training=braking(600.0), rank=10)
    assert rom.inputs == ("delta", *BRAKES)
    run = rom.simulate(braking(600.0))
    loaded = vm.load(rom.save(tmp_path / "braked.nc"))
    assert loaded.inputs == rom.inputs
    np.testing.assert_allclose(loaded.simulate(braking(600.0)).outputs, run.outputs, rtol=1e-6)
    with pytest.raises(InputError, match="friction_FL"):
        rom.simulate(braking(600.0, friction_FL=0.5))


def test_an_export_has_the_inputs_that_it_is_asked_for(tmp_path):
    folder = vm.export(CAR, "c", tmp_path / "c", inputs=BRAKES)
    header = (folder / "vehiclemor_model.h").read_text()
    assert all(name in header for name in ("delta", *BRAKES))
    assert "friction_FL" not in header
    with pytest.raises(InputError, match="brake_torque_XX"):
        vm.export(CAR, "casadi", inputs=["brake_torque_XX"])


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({"friction_FL": 0.0}, "0 is below the smallest allowed 0.05"),
        (
            {"friction_fl": 1.0},
            "is not an optional input of independent_suspension_vehicle; did you mean",
        ),
        (3, "must be a mapping"),
    ],
)
def test_wrong_constant_inputs_are_refused(inputs, words):
    with pytest.raises(InputError, match=words):
        vm.model(CAR, inputs=inputs)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (braking(-10.0), "brake_torque_FL is -?[0-9.e-]+ N m at t = .*holds from 0 to 20000 N m"),
        (braking(10.0, brake=0.0), "gives input 'brake'"),
    ],
)
def test_inputs_beyond_their_range_are_refused(signal, words):
    with pytest.raises(InputError, match=words):
        car().simulate(signal)


def test_a_run_that_stops_where_the_full_order_drives_on_has_failed():
    """Errors until its stop would be those of the first seconds."""
    full = car(5.0).simulate(braking(100.0))
    early = car(5.0).simulate(braking(600.0))
    assert (full.status, early.status) == ("ok", "stopped")
    assert early.stops_early(full)
    assert not early.stops_early(car(5.0).simulate(braking(600.0), solver="rodas4", tolerance=1e-3))
    with pytest.raises(InputError, match="other inputs"):
        vm.errors(early, full)


@pytest.mark.parametrize(
    ("reduced", "words"),
    [
        (lambda: vm.reduce(CAR, "linear_single_track", training="braking_in_turn"), "steer alone"),
        (lambda: vm.reduce(CAR, "slow_manifold", training="bump"), "on an even road"),
        (lambda: vm.reduce(car(5.0), "pod", training=braking(600.0)), "runs that go on until"),
        (lambda: vm.simulate_many(vm.rom(CAR), [braking(10.0)]), "delta alone: it is reduced"),
        (lambda: car().driving("brake_torque_XX"), "unknown input 'brake_torque_XX'"),
    ],
)
def test_methods_say_what_they_cannot_learn_from(reduced, words):
    with pytest.raises(InputError, match=words):
        reduced()


def test_amplitudes_leave_friction_as_it_is(tmp_path):
    doubled = braking(100.0, friction_FL=0.7).perturbed(amplitude=2.0)
    assert doubled.at(np.array([2.0]))[0].tolist() == [200.0, 200.0, 100.0, 100.0, 0.7]
    (tmp_path / "log.csv").write_text("time,wheel,brake\n0,10,300\n1,20,300\n")
    inputs = {"delta": "wheel", "brake_torque_FL": "brake"}
    with pytest.raises(InputError, match="convert all columns, brake_torque_FL too"):
        vm.Signal.from_csv(tmp_path / "log.csv", inputs=inputs, unit="deg")
