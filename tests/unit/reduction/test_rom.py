"""A model in use: what it is made of, what it gives, and what it refuses with one clear line."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR, WISHBONE
from vehiclemor.exceptions import ConvergenceError, InputError


@pytest.fixture(scope="module")
def full():
    return vm.reduce(CAR, "full_order")


@pytest.fixture(scope="module")
def linear(full):
    return vm.reduce(full.model, "linear_single_track", training="nominal")


@pytest.fixture(scope="module")
def wishbone():
    return vm.reduce(WISHBONE, "path_map", cells=8, degree=2)


def test_it_tells_what_it_is(full, linear, wishbone):
    assert full.states == full.model.coordinates + full.model.speeds
    assert (full.inputs, full.output_names) == (full.model.inputs, full.model.outputs)
    assert full.parameters["sprung_mass"] == full.model.parameters["sprung_mass"]
    assert linear.states == ("z0", "z1", "z2", "psi", "X", "Y")
    assert len(linear.state()) == len(linear.states)
    assert wishbone.states == wishbone.model.coordinates
    assert linear.settings["solver"] == "etdrk4"
    assert len(repr(linear)) < 500


def test_the_full_model_answers_as_the_model_itself(full):
    x, u = full.state("dropped"), [0.02]
    np.testing.assert_array_equal(x, full.model.start("dropped"))
    np.testing.assert_array_equal(full.rhs(x, u), full.model.rhs(x, u))
    np.testing.assert_array_equal(full.full_state(x, u), x)
    expected = full.model.outputs_at(x[None], np.array([u]))[0]
    np.testing.assert_array_equal(full.outputs(x, u), expected)
    path, inputs = np.stack([x, 1.01 * x]), np.array([u, [0.01]])
    rows = [full.outputs(*pair) for pair in zip(path, inputs, strict=True)]
    np.testing.assert_array_equal(full.outputs(path, inputs), rows)


def test_a_run_is_a_dataset_when_asked(linear):
    run = linear.simulate("step_steer", start="dropped")
    dataset = linear.dataset(run)
    assert dataset["outputs"].shape == run.outputs.shape
    assert dataset["time"].attrs["units"] == "s"
    np.testing.assert_array_equal(linear.simulate().inputs, linear.simulate("lane_change").inputs)


def test_a_step_is_a_function_of_its_arguments_alone(linear):
    states = [linear.state(start) for start in linear.model.starts]
    inputs = [[0.0], [0.01], [-0.02]]
    ways = [(u, dt, ends) for u in inputs for dt in (0.001, 0.02, 1.0) for ends in (None, [0.01])]
    cases = 20 * [(x, u, dt, 0.0, ends) for x in states for u, dt, ends in ways]
    known = [linear.step(*case) for case in cases]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda case: linear.step(*case), reversed(cases)))
    np.testing.assert_array_equal(found[::-1], known)


def test_a_state_is_that_of_its_inputs():
    # What a prescribed rack moves at once is no part of the slow modes.
    rom = vm.reduce("high_fidelity_vehicle", "modal_truncation", training="nominal")
    first, other, again = (rom.state("equilibrium", [s, 0.0, 0.0]) for s in (0.0, 0.01, 0.0))
    np.testing.assert_array_equal(again, first)
    assert np.abs(other - first).max() > 1e-3


@pytest.mark.parametrize("delta", [1e10, -1.1])
def test_inputs_that_a_run_refuses_are_not_trusted(full, delta):
    assert full.trust(full.state(), [1.0]).reason == ""
    assert "delta is" in full.trust(full.state(), [delta]).reason
    with pytest.raises(InputError, match="holds from"):
        full.simulate(vm.Signal.from_samples([0.0, 1.0], [0.0, delta]))


def answers(rom):
    """What it gives to all kinds of questions, which fills all that it keeps."""
    x, u = rom.state(), np.zeros(len(rom.inputs))
    signal = vm.Signal.from_samples([0.0, 0.5, 1.0], np.outer([0.0, 0.01, 0.0], u + 1.0))
    return [rom.simulate(run).outputs for run in (signal, None)] + [
        rom.step(x, u, 0.01),
        rom.outputs(x, u),
        np.array(rom.trust(x, u).indicator),
    ]


@pytest.mark.parametrize("name", ["full", "linear", "wishbone"])
def test_a_copy_of_a_used_model_is_the_same(request, name):
    rom = request.getfixturevalue(name)
    known = answers(rom)
    for copied in (copy.deepcopy(rom), pickle.loads(pickle.dumps(rom))):  # noqa: S301
        for found, expected in zip(answers(copied), known, strict=True):
            np.testing.assert_array_equal(found, expected)
        assert copied.input_range.longest == rom.input_range.longest


BAD_STEPS = [
    *(("state", np.zeros(shape)) for shape in (7, 28, (2, 6))),
    *(("state", "dropped"), ("state", [0, 0, np.nan, 0, 0, 0]), ("next_inputs", [])),
    *(("inputs", inputs) for inputs in ([0.0, 0.0], [np.inf])),
    *(("dt", dt) for dt in (0.0, -0.1, np.nan, "0.1", 1e-12)),
    *(("time", time) for time in (np.inf, None)),
]


@pytest.mark.parametrize(("name", "value"), BAD_STEPS)
def test_wrong_steps_are_refused(linear, name, value):
    given = {"state": linear.state(), "inputs": [0.0], "dt": 0.01} | {name: value}
    with pytest.raises(InputError, match=rf"^(.*: )?{name}\b"):
        linear.step(**given)


def test_a_wrong_sample_is_refused(linear):
    states = np.zeros((3, 6))
    with pytest.raises(InputError, match=r"inputs have shape \(2, 1\), not \(3, 1\)"):
        linear.outputs(states, np.zeros((2, 1)))
    for function in (linear.outputs, linear.full_state, linear.trust):
        with pytest.raises(InputError, match="states are none"):
            function(states[:0], np.zeros((0, 1)))
    with pytest.raises(InputError, match=r"states have shape \(3, 5\)"):
        linear.outputs(states[:, :5], np.zeros((3, 1)))


def test_methods_without_a_state_say_so(wishbone):
    replay = vm.reduce(wishbone.model, "replay")
    assert replay.states == ()
    assert replay.simulate().status == "ok"
    with pytest.raises(InputError, match="replay has no state: it gives whole runs alone"):
        replay.state()
    with pytest.raises(InputError, match="kinematic: its equations have no rates"):
        wishbone.rhs(wishbone.state(), [0.0, 0.0])


def test_derivatives_that_a_reduced_model_does_not_know_are_refused(full, linear):
    assert full.jacobian(full.state(), [0.0], "sprung_mass").shape == (len(full.states), 1)
    with pytest.raises(InputError, match="sprung_mass"):
        linear.jacobian(linear.state(), [0.0], "sprung_mass")


def test_a_step_that_fails_says_when(full):
    # Upside down on a tire that is pressed by more than it can bear.
    x = full.state()
    x[full.states.index("Z")] = -40.0
    with pytest.raises(ConvergenceError, match="at t = 3"):
        full.step(x, [0.0], 0.5, time=3.0)
    # Nothing of it is left in the next step.
    good = full.state()
    np.testing.assert_allclose(full.step(good, [0.0], 1e-3)[:2], [20e-3, 0.0], atol=1e-6)
