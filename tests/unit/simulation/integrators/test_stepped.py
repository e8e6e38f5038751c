"""Whole steps as one kernel are the steps of the general loops."""

from dataclasses import replace

import numpy as np
import pytest

from vehiclemor.reduction.vehicle.features import Features, feature_system
from vehiclemor.registry import component
from vehiclemor.simulation import build
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.system import Solver, System
from vehiclemor.steering_maneuvers import lane_change

SOLVERS = [name for name, own in catalogue.INTEGRATORS.items() if own.stepped]
# With pairs that turn with the heading and without; states in the mirror image and as they are.
VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")
NO_PARTNERS = np.zeros(0, dtype=np.int64)


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("mirror", [True, False])
def test_a_step_as_one_kernel_is_the_step_of_the_loops(name, solver, mirror, monkeypatch):
    model = build.build(name)
    system = model.system if mirror else replace(model.system, partners=NO_PARTNERS)
    maneuver = component("maneuver", component("model", name).maneuver)
    start = model.start()

    def run(of: System, tolerance: float):
        found = of.run(maneuver, start, whole_space(len(start)), Solver(solver, tolerance))
        assert not found.failure
        return found

    one = run(system, 2e-3)
    assert system.whole_steps(solver)
    assert len(system.frame.blocks) == (2 if mirror else 1)
    monkeypatch.setattr(catalogue, "MOST_STATES", 0)
    general = replace(system)
    other = run(general, 2e-3)
    assert not general.whole_steps(solver)
    np.testing.assert_array_equal(one.counts, other.counts)
    # Where a step is as long as one of the grid, rounding chooses between two stored inverses: the
    # general loop too moves by the local error when its start moves by 1e-14.
    np.testing.assert_allclose(one.path[:40], other.path[:40], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(one.path, other.path, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_the_same_of_a_reduced_vehicle(solver, tolerance, monkeypatch):
    # A damped oscillator and a decay, pushed by the inputs and by cubic terms; heading and place.
    terms = ("z0", "z1", "z2", "u0", "bend * z1", "z0 * z1 * z2", "1.0")
    features = Features(3, 1, (("bend", "z0 * z0 - z2"),), terms)
    c = np.zeros((7, 6))
    c[:2, :2] = [[-1.0, -4.0], [4.0, -1.0]]
    c[2, 2] = -9.0
    c[4:6, 3:] = [[1.0, 0.5, -0.4], [1.0, 0.3, 0.7]]
    c[3, 0], c[4, 0], c[5, 1], c[5, 2] = 0.6, 0.9, -0.8, 0.7
    one = feature_system(features, np.zeros(0), c, np.ones(6), np.zeros(3))

    def run(of: System):
        start = np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.0])
        found = of.run(lane_change, start, whole_space(6), Solver(solver, tolerance))
        assert not found.failure
        return found

    assert one.whole_steps(solver)
    found = run(one)
    monkeypatch.setattr(catalogue, "MOST_STATES", 0)
    other = run(replace(one))
    np.testing.assert_array_equal(found.counts, other.counts)
    assert found.counts[1] > 15
    np.testing.assert_allclose(found.path, other.path, rtol=1e-7, atol=1e-9)
