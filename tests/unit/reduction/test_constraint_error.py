"""Runs of reduced mechanisms are judged by where the constraint equations put the mechanism."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.reduction.error_estimate import constraint_errors

WISHBONE = "double_wishbone"
TIMES = np.linspace(0.0, 10.0, 1001)


@cache
def path_map():
    return vm.rom(WISHBONE)


def travel(values):
    """Wheel travel in m while the rack rests."""
    return vm.Signal.from_samples(TIMES, np.column_stack([values, 0.0 * TIMES]))


@pytest.mark.parametrize("method", ["pod", "fixed_basis"])
@pytest.mark.parametrize("amplitude", [0.6, 1.3])
def test_it_is_the_error_of_every_output(method, amplitude):
    rom = vm.reduce(WISHBONE, method, rank=3, training="travel_and_rack")
    maneuver = vm.maneuver("travel_and_rack_sweep", amplitude=amplitude)
    run, full = rom.simulate(maneuver), rom.model.simulate(maneuver)
    error, estimate = run.outputs - full.outputs, run.error_estimate
    np.testing.assert_allclose(estimate.errors, error, atol=1e-11)
    bounds = rom.model.definition.error_bounds
    used = [np.sqrt(np.mean((run[n] - full[n]) ** 2)) / b.bound for n, b in bounds.items()]
    assert estimate.in_bounds == pytest.approx(max(used), rel=1e-6)
    assert max(used) > 1.0
    assert run.status == "untrusted"
    assert run.trust.indicator == pytest.approx(1.25 * max(used), rel=1e-6)
    assert rom.simulate(maneuver, trust="off").status == "ok"


def test_what_is_right_beyond_the_training_is_trusted_and_what_is_wrong_is_not():
    rom = path_map()
    beyond = vm.maneuver("travel_and_rack", amplitude=1.25)
    state = rom.state(None, [0.125, 0.0])
    assert rom.trust(state, [0.125, 0.0]).indicator > 1.0
    assert rom.simulate(beyond).status == "ok"
    assert rom.simulate(beyond, bounds={"toe": 1e-9}).status == "untrusted"
    far = vm.maneuver("travel_and_rack", amplitude=1.7)
    assert rom.simulate(far).status == "untrusted"
    assert rom.simulate(far, bounds={"toe": 1.0}).status == "ok"


def test_beyond_reach_nothing_is_known():
    lowest, _ = path_map().model.reach()
    run = path_map().simulate(travel(0.05 * lowest * TIMES * (TIMES < 6.0) * 5.0))
    leaves = TIMES[np.flatnonzero(0.25 * lowest * TIMES < lowest)[0]]
    assert run.status == "untrusted"
    estimate = run.error_estimate
    assert not estimate.settled
    assert estimate.times[np.isinf(estimate["toe"])].min() == pytest.approx(leaves, abs=0.011)
    assert run.trust.until <= leaves + 0.011


def test_another_branch_is_an_error_though_it_closes_all_joints():
    model, rng = path_map().model, np.random.default_rng(1)
    u, other = np.zeros(2), None
    while other is None:
        q = model.design + rng.uniform(-1.5, 1.5, len(model.design))
        for _ in range(50):
            q = q - np.linalg.solve(model.jacobian(q, u), model.residual(q, u))
        closed = np.isfinite(q).all() and np.abs(model.residual(q, u)).max() < 1e-10
        if closed and np.abs(np.sin(0.5 * (q - model.design))).max() > 0.1:
            other = q
    still = travel(0.0 * TIMES)
    run = path_map().simulate(still)
    states = np.tile(other, (len(run.times), 1))
    elsewhere = replace(run, coordinates=states, outputs=model.outputs_at(states, run.inputs))
    errors_of, reached = constraint_errors(elsewhere, still)
    assert reached
    assert np.abs(errors_of(model.outputs)).max() > 0.01
