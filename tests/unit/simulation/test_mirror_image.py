"""A vehicle is its own mirror image: signs and partners found in names and the Jacobian."""

import numpy as np
import pytest

from vehiclemor.registry import component
from vehiclemor.simulation import build
from vehiclemor.simulation.integrators.mirror_image import mirror_blocks, partners, signs

VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


def test_partners_are_told_by_names():
    names = ["y", "z_FL", "z_FR", "z_RR_dot", "z_RL_dot", "lone_FL"]
    assert partners(names).tolist() == [0, 2, 1, 4, 3, 5]


@pytest.mark.parametrize("name", VEHICLES)
def test_the_equations_are_their_own_mirror_image(name):
    model = build.build(name)
    system = model.system
    sign = signs(system.frozen_jacobian, system.partners)
    assert sign is not None
    # Steered, far from straight running: what the Jacobian does not tell must turn too.
    maneuver = component("maneuver", component("model", name).maneuver)
    run = model.simulate(maneuver, solver="ros34pw2", tolerance=1e-3)
    states, inputs = run.states[::50], run.inputs[::50]
    assert np.abs(inputs).max() > 0.0
    rates = model.rhs_at(states, inputs)
    image = model.rhs_at(np.ascontiguousarray(sign * states[:, system.partners]), -inputs)
    reflected = sign * image[:, system.partners]
    np.testing.assert_allclose(reflected, rates, atol=1e-8 * np.abs(rates).max())


def test_an_asymmetric_system_has_no_signs():
    jacobian = np.array([[-1.0, 2.0], [3.0, -4.0]])
    assert signs(jacobian, np.array([1, 0])) is None


def test_blocks_split_the_jacobian():
    rng = np.random.default_rng(3)
    partner, sign = np.array([0, 1, 3, 2, 5, 4]), np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    reflection = np.zeros((6, 6))
    reflection[np.arange(6), partner] = sign
    j = rng.normal(size=(6, 6))
    j += reflection @ j @ reflection
    found = signs(j, partner)
    assert found is not None
    blocks = mirror_blocks(partner, found)
    rows = [row for block in blocks for row in block]
    transform = np.zeros((6, 6))
    for i, row in enumerate(rows):
        for state, weight in row:
            transform[i, state] = weight
    whole = transform @ j @ np.linalg.inv(transform)
    size = len(blocks[0])
    assert 0 < size < 6
    assert np.abs(whole[:size, size:]).max() < 1e-12 > np.abs(whole[size:, :size]).max()
