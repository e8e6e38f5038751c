"""The interface, line by line, as the pages show it; its names and what they show."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor import registry

VEHICLE = "independent_suspension_vehicle"


@pytest.fixture(scope="module")
def car():
    return vm.model(VEHICLE, parameters={"sprung_mass": 900.0})


@pytest.fixture(scope="module")
def pod(car):
    return vm.reduce(car, "pod", rank=3, training="lane_change")


def test_a_full_model_and_a_reduced_one_are_run_and_compared(car, pod):
    turn = vm.maneuver("lane_change", frequency=1.2, amplitude=-1.0)
    full = car.simulate(turn)
    np.testing.assert_array_equal(full.dataset()["outputs"].sel(output="yaw"), full["yaw"])
    run = pod.simulate(turn, outputs=["lateral_position", "yaw"])
    assert run.names == ("lateral_position", "yaw")
    errors = vm.errors(run, full)
    difference = run["yaw"] - full["yaw"]
    expected = np.sqrt(np.mean(difference**2)), abs(difference).max()
    of_yaw = errors.sel(output="yaw")
    np.testing.assert_allclose((of_yaw["rms_error"], of_yaw["max_error"]), expected, rtol=1e-6)
    assert of_yaw["signal_range"] == np.ptp(full["yaw"])
    assert errors["output_unit"].values.tolist() == ["m", "rad"]
    shares = vm.plot(run, full, kind="errors").axes[0].get_lines()[0]
    expected = 100.0 * errors["rms_error"] / errors["signal_range"]
    np.testing.assert_allclose(shares.get_xdata(), expected)
    figure = vm.plot(run, full)
    assert {line.get_label() for axis in figure.axes for line in axis.get_lines()} > {"full order"}
    some = pod.simulate(turn, times=full.times[::250])
    np.testing.assert_allclose(some["yaw"], run["yaw"][::250], rtol=1e-9)


def of_another_model(run):
    return replace(run, inputs=np.hstack([run.inputs, run.inputs]))


def with_inputs(run, factor, shift=0.0):
    """The run with other inputs, shifted by a part of the largest."""
    return replace(run, inputs=factor * run.inputs + shift * np.abs(run.inputs).max())


def test_inputs_that_differ_by_rounding_are_the_same(car):
    run = car.simulate(vm.maneuver("lane_change"), solver="etdrk4", tolerance=1e-3)
    for full in (with_inputs(run, 1.0 + 1e-7), with_inputs(run, 1.0, 1e-10)):
        assert vm.errors(run, full)["max_error"].max() == 0.0


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda run: run["nothing"], "nothing"),
        (lambda run: run.chosen(3), "outputs"),
        (lambda run: run.chosen(times=[0.0001]), "0.0001"),
        (lambda run: run.chosen(times=[1.0, 0.0]), "increase"),
        (lambda run: vm.errors(run, run.chosen("yaw")), "longitudinal_position"),
        (lambda run: run.chosen(["yaw", "yaw"]), "twice"),
        (lambda run: vm.errors(run, run.model.simulate(vm.maneuver("straight_ahead"))), "inputs"),
        (lambda run: vm.errors(run, of_another_model(run)), "models with other inputs"),
        (lambda run: vm.errors(run, with_inputs(run, 1.0 + 1e-5)), "other inputs"),
        (lambda run: run.model.bare(np.ones(3)), r"has no \[1. 1. 1.\]"),
    ],
)
def test_what_a_run_does_not_have_is_one_line(car, call, word):
    run = car.simulate(vm.maneuver("lane_change"), solver="etdrk4", tolerance=1e-3)
    with pytest.raises(vm.VehiclemorError, match=word):
        call(run)


@pytest.mark.parametrize("method", [None, "pod", "replay", "slow_manifold"])
def test_what_is_written_into_a_run_changes_no_other(car, method):
    turn = vm.maneuver("lane_change")
    maneuvers = [turn, vm.maneuver("lane_change", amplitude=-1.2), vm.maneuver("straight_ahead")]
    model = car if method is None else vm.reduce(car, method, training=maneuvers)
    before, times = model.simulate(turn), turn.times.copy()
    kept = before.outputs.copy(), before.states.copy()
    for run in (before, before.chosen(["yaw"]), model.simulate(turn)):
        for array in (run.times, run.inputs, run.coordinates, run.speeds, run.outputs):
            try:
                array[...] = 3.0
            except ValueError:
                # It can't be written.
                continue
    after = model.simulate(turn)
    np.testing.assert_array_equal(after.times, times)
    np.testing.assert_array_equal(after.outputs, kept[0])
    np.testing.assert_array_equal(after.states, kept[1])


LONGEST = 500
# Everything that a session may have imported and used before a name is asked for: Python puts a
# module in the place of a name as soon as anything imports it.
USED = """
import importlib, pkgutil
import vehiclemor as vm
vm.simulate("double_wishbone", "pod")
for found in pkgutil.walk_packages(vm.__path__, "vehiclemor."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)
from vehiclemor import api
for name in vm.__all__:
    value = getattr(vm, name)
    defined = getattr(value, "__module__", "").startswith("vehiclemor.")
    if not defined or value.__name__ != name or not value.__doc__:
        raise SystemExit(f"vehiclemor.{name} is {value!r}")
for name in ("models", "methods", "maneuvers", "studies"):
    assert getattr(vm, name)(), name
"""


def test_public_names_after_everything_was_used():
    done = subprocess.run([sys.executable, "-c", USED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["double_wishbone", "independent_suspension_vehicle"])
def test_objects_of_a_simulation_show_themselves_in_one_line(name):
    model, definition = vm.model(name), registry.component("model", name)
    maneuver = vm.maneuver(definition.maneuver)
    rom, full = vm.reduce(name, "pod", training=[maneuver]), model.simulate(maneuver)
    for shown in (model, definition, maneuver, rom, rom.reduced, full):
        text = repr(shown)
        assert len(text) < LONGEST
        assert "\n" not in text
    assert all(word in repr(model) for word in (name, model.coordinates[0]))
    assert name in repr(rom)
    assert str(vm.rom(VEHICLE)).count("random_steer") == 1
    assert f"times=ndarray({maneuver.samples},)" in repr(full)
    assert "status='ok'" in repr(full)
    for further in (model.parameters, model.equations):
        assert len(repr(further)) < 2 * LONGEST
