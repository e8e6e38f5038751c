"""A vehicle is its own mirror image: signs and partners found in names and the Jacobian."""

import numpy as np

from vehiclemor.simulation.integrators.step_kernels import partners, signs


def test_partners_are_told_by_names():
    names = ["y", "z_FL", "z_FR", "z_RR_dot", "z_RL_dot", "lone_FL"]
    assert partners(names).tolist() == [0, 2, 1, 4, 3, 5]


def test_an_asymmetric_system_has_no_signs():
    jacobian = np.array([[-1.0, 2.0], [3.0, -4.0]])
    assert signs(jacobian, np.array([1, 0])) is None
