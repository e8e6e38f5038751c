"""Control periods that start from the full model: its limits, and what that is good for."""

from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.projection.dynamic import DynamicProjection
from vehiclemor.registry import component
from vehiclemor.simulation.control_periods import ControlPeriods

CAR = "independent_suspension_vehicle"


@pytest.fixture(scope="module")
def car():
    return vm.model(CAR)


@pytest.fixture(scope="module")
def maneuver():
    # Of a few seconds, with more steering than the training has.
    return replace(component("maneuver", "lane_change"), duration=4.0, samples=201).perturbed(
        1.0, 1.2
    )


def errors(car, maneuver, restart, **settings):
    """Distances (samples,) of the place and heading from the full model's, in their scales."""
    rom = vm.reduce(car, "pod", restart=restart, **settings)
    run, full = rom.reduced.simulate(maneuver, "equilibrium"), car.simulate(maneuver)
    apart = (run.states - full.states)[:, car.planar] / car.error_scale[car.planar]
    return np.abs(apart).max(axis=1)


def test_with_all_directions_it_is_the_full_model(car, maneuver):
    windows, states = 4, len(car.definition.states)
    eye = np.tile(np.eye(states), (windows, 1, 1))
    means = np.random.default_rng(1).normal(size=(windows, states))
    ranks, edges = np.full(windows, states), np.linspace(0.0, 4.0, windows + 1)
    spaces = ControlPeriods("state", edges, means, eye, eye, ranks)
    full = car.simulate(maneuver)
    for restart in ("full_model", "projected"):
        reduced = DynamicProjection(car, spaces, OfflineCost(), "dopri5", 1e-9, restart=restart)
        run = reduced.simulate(maneuver, "equilibrium")
        np.testing.assert_allclose(run.states, full.states, rtol=1e-6, atol=1e-6)
        assert run.counts["rhs_calls"] > full.counts["rhs_calls"]


@pytest.mark.parametrize("formulation", ["coordinates", "state"])
def test_errors_grow_within_a_period_alone(car, maneuver, formulation):
    own, projected, restarted = (
        errors(car, maneuver, restart, formulation=formulation)
        for restart in ("own", "projected", "full_model")
    )
    assert own[-1] > 0.1
    # Projected onto the training's subspace, a state is one of the training run again.
    assert projected.max() > 0.3 * own.max()
    # Nothing is carried on from one period to the next.
    assert restarted[-1] < 0.01 * own[-1]
    # A period is 25 samples: what follows an edge is better than what comes before it.
    assert np.all(restarted[76::25] < 0.2 * restarted[75::25].max())


def test_steps_begin_at_the_state_that_they_are_given(car, maneuver):
    rom = vm.reduce(car, "pod", restart="full_model", formulation="state")
    run, full = rom.reduced.simulate(maneuver, "equilibrium"), car.simulate(maneuver)
    state = full.states[75]
    for sample in range(75, 100):
        u, ends = maneuver.at(run.times[[sample, sample + 1]])
        state = rom.step(state, u, 0.02, run.times[sample], ends)
        # Straight lines between the samples stand for the steering.
        np.testing.assert_allclose(state, run.states[sample + 1], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("formulation", ["coordinates", "state"])
def test_its_rates_are_those_of_its_steps_and_its_jacobian_theirs(car, maneuver, formulation):
    rom = vm.reduce(car, "pod", restart="full_model", formulation=formulation)
    x, u, t = car.simulate(maneuver).states[90], maneuver.at(np.array([1.8]))[0], 1.8
    # What comes after a step lies in the subspace.
    y, dt = rom.step(x, u, 1e-3, t), 1e-5
    slopes = (rom.step(y, u, dt, t) - y) / dt
    np.testing.assert_allclose(rom.rhs(y, u, t), slopes, rtol=1e-3, atol=1e-2)
    found, columns = rom.jacobian(x, u, time=t), []
    for step in 1e-6 * np.maximum(np.abs(x), 1.0) * np.eye(len(x)):
        sides = rom.rhs(x + step, u, t) - rom.rhs(x - step, u, t)
        columns.append(sides / (2.0 * step.sum()))
    scale = np.abs(found).max()
    np.testing.assert_allclose(np.transpose(columns) / scale, found / scale, atol=1e-7)
