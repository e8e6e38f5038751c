"""Linear models: close to the nonlinear one nearby, named, and fit for control design."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import vehiclemor as vm
from tests.models import CAR

WHEELS = ("FL", "FR", "RL", "RR")
HELD = {"X", "u", *(f"{name}_{wheel}" for name in ("gamma", "omega") for wheel in WHEELS)}


@pytest.fixture(scope="module", params=[vm.model, vm.rom], ids=["full", "reduced"])
def model(request):
    return request.param(CAR)


def regulated(linear):
    """Eigenvalues with the linear quadratic regulator of unit costs."""
    costs = np.eye(len(linear.states)), np.eye(len(linear.inputs))
    gain = linear.B.T @ solve_continuous_are(linear.A, linear.B, *costs)
    return np.linalg.eigvals(linear.A - linear.B @ gain)


def test_it_is_the_model_to_first_order(model):
    turning = model.linearise(inputs=[0.01])
    x = turning.state + 1e-8 * np.random.default_rng(1).normal(size=len(turning.state))
    u = np.array([0.01 + 2e-8])
    rates = turning.rates + turning.A @ (x - turning.state) + turning.B @ (u - 0.01)
    outputs = turning.output_values + turning.C @ (x - turning.state) + turning.D @ (u - 0.01)
    np.testing.assert_allclose(model.rhs(x, u), rates, rtol=1e-9, atol=1e-7)
    known = model.outputs_at(x[None], u[None])[0] if hasattr(model, "kind") else model.outputs(x, u)
    np.testing.assert_allclose(known, outputs, rtol=1e-9, atol=1e-5)


def test_a_regulator_follows_from_the_states_that_steering_reaches():
    linear = vm.rom(CAR).linearise()
    with pytest.raises(np.linalg.LinAlgError):
        regulated(linear)
    reached = linear.reachable()
    assert {"psi", "Y"} < set(reached.states) < set(linear.states) - {"X"}
    assert regulated(reached).real.max() < 0.0
    still = np.array([name not in reached.states for name in linear.states])
    assert np.abs(linear.B[still]).max() < 1e-9 * np.abs(linear.B).max()
    assert np.abs(linear.A[np.ix_(still, ~still)]).max() < 1e-9 * np.abs(linear.A).max()


def test_states_are_selected_by_name():
    linear = vm.model(CAR).linearise()
    chosen = linear.select([name for name in reversed(linear.states) if name not in HELD])
    assert regulated(chosen).real.max() < 0.0
    row, column = chosen.states.index("v"), chosen.states.index("r")
    assert chosen.A[row, column] == linear.A[linear.states.index("v"), linear.states.index("r")]
    for wrong in ("omega", ["nothing"], 3, ["v", "v"], []):
        with pytest.raises(vm.VehiclemorError, match="state"):
            vm.model(CAR).linearise().select(wrong)
