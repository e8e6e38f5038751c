"""Rollouts, many runs at once by fixed steps: the numbers of runs that are stepped one by one."""

import pickle

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from tests.refusing import refused
from tests.unit.exporting.programs import in_use, relative, runge_kutta, steering

STEP = 2e-3


@pytest.mark.parametrize("runs", [3, 11])
@pytest.mark.parametrize(("name", "kind"), [(CAR, "full"), ("high_fidelity_vehicle", "reduced")])
def test_each_run_is_that_of_its_state_and_inputs(name, kind, runs):
    model, period = in_use(name, kind), 3 * STEP
    sizes = np.linspace(-1.0, 1.0, runs)
    inputs = sizes[:, None, None] * steering(model, 9, period)
    states = np.array([model.state(inputs=u) for u in inputs[:, 0]])
    states[:, 0] += 1e-3 * sizes
    found = vm.export(model, "rollouts", step=STEP)(states, inputs, period)
    for run, state in enumerate(states):
        # Three steps between samples, where inputs are linear.
        fine = [np.interp(np.arange(25) / 3.0, np.arange(9), u) for u in inputs[run].T]
        path = runge_kutta(model.rhs, state, np.column_stack(fine), STEP)[::3]
        wanted = model.outputs(path, inputs[run])
        # Slips are differences of speeds that are nearly equal.
        assert relative(found[run, :, : wanted.shape[1]], wanted) < 1e-7
        if kind == "reduced":
            trust = model.trust(path, inputs[run]).indicator
            assert found[run, :, -1].max() == pytest.approx(trust)


def test_implicit_steps_are_of_order_2_and_stable_where_explicit_ones_are_not():
    model, steering = in_use(CAR, "full"), np.full((1, 2), 0.03)
    signal = vm.Signal.from_samples([0.0, 0.4], steering[0])
    run = model.model.simulate(signal, tolerance=1e-12, outputs=["yaw_rate"])
    exact = run.outputs[-1, 0]

    def error(step, integrator):
        options = {"step": step, "integrator": integrator, "outputs": "yaw_rate"}
        rollouts = vm.export(model, "rollouts", **options)
        return abs(rollouts(model.state(), steering, 0.4)[0, -1, 0] - exact)

    errors = [error(step, "ros2") for step in (4e-2, 5e-3, 2.5e-3)]
    assert errors[0] < 0.02
    assert 3.5 < errors[1] / errors[2] < 4.5
    assert error(4e-2, "rk4") > 10.0 * errors[0]


def test_rollouts_refuse_what_does_not_fit():
    model = in_use(CAR, "reduced")
    rollouts = vm.export(model, "rollouts", outputs=["yaw_rate"])
    state, inputs = model.state(), np.zeros((4, 5))
    assert rollouts(state, inputs, 0.01).shape == (4, 5, 1)
    refused(lambda: rollouts(state, inputs[0], 0.01), "(5,)", "(runs, samples, 1)")
    refused(lambda: rollouts(state, np.zeros((4, 5, 2)), 0.01), "(4, 5, 2)")
    refused(lambda: rollouts(state[1:], inputs, 0.01), "states")
    refused(lambda: rollouts(state, np.full((4, 5), np.nan), 0.01), "not finite")
    refused(lambda: rollouts(state, inputs, 0.0), "period")
    refused(lambda: vm.export("double_wishbone", "rollouts"), "no states")
    refused(lambda: vm.export(model, "rollouts", outputs=[]), "outputs")
    refused(lambda: vm.export(model, "rollouts", precision="single"), "precision")
    refused(lambda: pickle.dumps(rollouts), "copied")
