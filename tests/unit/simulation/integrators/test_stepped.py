"""Whole steps as one kernel are the steps of the general loops."""

from dataclasses import replace

import numpy as np
import pytest

from vehiclemor.inputs.steering import lane_change
from vehiclemor.reduction.vehicle.features import FeatureListing, feature_system
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.system import Solver, System

SOLVERS = [name for name, own in catalogue.INTEGRATORS.items() if own.stepped]
# With pairs that turn with the heading and without; in the mirror image's two blocks.
VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


def reduced_vehicle() -> System:
    """A damped oscillator and a decay, pushed by the inputs and by cubic terms; heading, place."""
    listing = FeatureListing(3, 1)
    z, alone = listing.z, [(value,) for value in (*listing.z, *listing.u)]
    products = ((z[0] * z[0] - z[2], z[1]), tuple(z), (listing.number(1.0),))
    features = listing.features([*alone, *products])
    c = np.zeros((7, 6))
    c[:2, :2] = [[-1.0, -4.0], [4.0, -1.0]]
    c[2, 2] = -9.0
    c[4:6, 3:] = [[1.0, 0.5, -0.4], [1.0, 0.3, 0.7]]
    c[3, 0], c[4, 0], c[5, 1], c[5, 2] = 0.6, 0.9, -0.8, 0.7
    return feature_system(features, np.zeros(0), c, np.ones(6), np.zeros(3))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", [*VEHICLES, "reduced"])
def test_a_step_as_one_kernel_is_the_step_of_the_loops(name, solver, monkeypatch):
    if name == "reduced":
        one, blocks, maneuver = reduced_vehicle(), 1, lane_change
        start, tolerances = np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.0]), (1e-2, 1e-4)
    else:
        model, blocks, tolerances = build(name), 2, (2e-3,)
        one, start = model.system, model.start()
        maneuver = component("maneuver", model.definition.maneuver)

    def run(of: System, tolerance: float):
        found = of.run(maneuver, start, whole_space(len(start)), Solver(solver, tolerance))
        assert not found.failure
        return found

    found = [run(one, tolerance) for tolerance in tolerances]
    assert one.whole_steps(solver)
    assert len(one.frame.blocks) == blocks
    monkeypatch.setattr(catalogue, "MOST_STATES", 0)
    general = replace(one)
    for stepped, tolerance in zip(found, tolerances, strict=True):
        other = run(general, tolerance)
        np.testing.assert_array_equal(stepped.counts, other.counts)
        assert stepped.counts[1] > 15
        # Where a step is as long as one of the grid, rounding chooses between two stored inverses:
        # the general loop too moves by the local error when its start moves by 1e-14.
        np.testing.assert_allclose(stepped.path[:40], other.path[:40], rtol=1e-9, atol=1e-8)
        close = {"rtol": 1e-7, "atol": 1e-9} if name == "reduced" else {"rtol": 1e-3, "atol": 1e-3}
        np.testing.assert_allclose(stepped.path, other.path, **close)
    assert not general.whole_steps(solver)
