"""The method of the plug-in: exact where the model is linear, and a good citizen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.contracts import check_method
from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.steering import lane_change
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.trajectory import Trajectory

pytestmark = pytest.mark.usefixtures("plug_in_package")
# Two masses of 1 kg in a chain from the wall: stiffness in N/m, damping in proportion to it.
STIFFNESS = 40.0 * np.array([[2.0, -1.0], [-1.0, 1.0]])
DAMPING = 0.004 * STIFFNESS
MATRIX = np.block([[np.zeros((2, 2)), np.eye(2)], [-STIFFNESS, -DAMPING]])
FORCE = 3.0


class Chain:
    """The chain with a force on its end, as a model."""

    name, kind = "chain", "ode"
    coordinates, speeds, inputs, outputs = ("q1", "q2"), ("v1", "v2"), ("force",), ()
    counts, evaluations = {"rhs_calls": "calls"}, "rhs_calls"
    system = SimpleNamespace(jacobian=lambda *_: MATRIX)

    def start(self, state=None):
        return np.zeros(4) if state is None else state

    def derivative(self, x, u):
        return MATRIX @ x + np.array([0.0, 0.0, 0.0, 1.0]) * u[0]

    def trajectory(self, times, inputs, states, counts, seconds):
        empty = np.zeros((len(times), 0))
        named = {"rhs_calls": int(counts[0])}
        return Trajectory(times, inputs, states[:, :2], states[:, 2:], empty, named, seconds)


def fitted(model, **settings):
    method = component("method", "quarter_car_modes")
    return method.fit(model, (), validated(method, model.kind, settings))


def step(samples=201):
    def signal(times, *_):
        return np.full((len(times), 1), FORCE)

    return Maneuver("step", "", signal, ("force",), 4.0, samples, lambda _: ())


def modal_solution(times, modes):
    """Displacements (samples, 2) after a step of the force, mode by mode in closed form."""
    squares, shapes = np.linalg.eigh(STIFFNESS)
    result = np.zeros((len(times), 2))
    for square, shape in list(zip(squares, shapes.T, strict=True))[:modes]:
        decay = 0.5 * 0.004 * square
        damped = np.sqrt(square - decay**2)
        swing = np.cos(damped * times) + decay / damped * np.sin(damped * times)
        amplitude = FORCE * shape[1] / square * (1.0 - np.exp(-decay * times) * swing)
        result += np.outer(amplitude, shape)
    return result


@pytest.mark.parametrize(("fastest", "modes"), [(5.0, 1), (100.0, 2)])
def test_a_linear_model_has_its_exact_modal_solution(fastest, modes):
    reduced = fitted(Chain(), fastest=fastest)
    assert reduced.effective_rank == 2 * modes
    run = reduced.simulate(step(), np.zeros(4))
    expected = modal_solution(run.time, modes)
    np.testing.assert_allclose(run.coordinates, expected, rtol=0, atol=1e-9)
    # The slow mode alone is not the whole motion.
    assert (np.abs(expected - modal_solution(run.time, 2)).max() > 1e-3) == (modes == 1)


def test_the_solution_does_not_depend_on_the_output_times():
    reduced = fitted(Chain())
    coarse, fine = (reduced.simulate(step(n), np.ones(4)) for n in (21, 401))
    np.testing.assert_allclose(coarse.states, fine.states[::20], rtol=0, atol=1e-10)


def test_modes_are_projected_without_loss():
    reduced = fitted(Chain(), fastest=5.0)
    states = np.random.default_rng(4).normal(size=(6, 4))
    best = reduced.best_approximation(states)
    np.testing.assert_allclose(reduced.best_approximation(best), best, rtol=0, atol=1e-12)
    np.testing.assert_allclose(reduced.left @ reduced.right, np.eye(2), rtol=0, atol=1e-12)
    # The subspace is invariant.
    image = MATRIX @ reduced.right
    np.testing.assert_allclose(reduced.right @ reduced.left @ image, image, rtol=0, atol=1e-10)


def test_the_method_keeps_the_contract_on_a_vehicle():
    check_method("quarter_car_modes", "independent_suspension_vehicle")


def test_a_vehicle_is_near_its_modes_at_small_amplitude():
    model = vm.model("independent_suspension_vehicle")
    small = replace(lane_change, amplitude_factor=1e-3, duration=10.0, samples=1001)
    full = model.simulate(small, tolerance=1e-9)
    run = fitted(model, fastest=1e4).simulate(small, model.starts[0])
    for name in ("yaw_rate", "roll", "lateral_position"):
        column = model.outputs.index(name)
        error = np.abs(run.outputs[:, column] - full.outputs[:, column]).max()
        assert error < 2e-3 * np.abs(full.outputs[:, column]).max()


def test_the_plug_in_simulates_as_a_built_in():
    data = vm.simulate("independent_suspension_vehicle", "quarter_car_modes", amplitude=0.01)
    assert data["status"].item() == "ok"
    with pytest.raises(InputError, match="double_wishbone is of kind ae"):
        vm.simulate("double_wishbone", "quarter_car_modes")
