"""The exponential method: matrix functions, and systems with defective Jacobians.

N. Higham, Functions of Matrices (SIAM 2008), chapter 10; S. Krogstad, J. Comput. Phys. 203 (2005).
"""

import math

import numpy as np
import pytest

from tests.unit.python_system import python_system
from tests.unit.standard_problems import maneuver
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.integrators.step_kernels import partners, signs
from vehiclemor.simulation.system import Solver

QUIET = maneuver(lambda t, *_: np.zeros((len(t), 3)), 4.0)


def test_partners_are_told_by_names_and_an_asymmetric_system_has_no_signs():
    names = ["y", "z_FL", "z_FR", "z_RR_dot", "z_RL_dot", "lone_FL"]
    assert partners(names).tolist() == [0, 2, 1, 4, 3, 5]
    assert signs(np.array([[-1.0, 2.0], [3.0, -4.0]]), np.array([1, 0])) is None


@pytest.mark.parametrize("rate", [1.0, 50.0, 1000.0])
def test_stabilised_constraint_with_a_defective_jacobian(rate):
    # e'' + 2 a e' + a^2 e = 0 beside a pendulum, whose Jacobian at rest is not that in motion.
    def slopes(x, u):
        del u
        decay = -2.0 * rate * x[1] - rate**2 * x[0]
        return [x[1], decay, x[3], -math.sin(x[2]) + x[0]]

    system = python_system(slopes, [0.0, 0.0, 0.0, 0.0], 3)
    times = np.linspace(0.0, 4.0, 41)
    start, how = np.array([0.1, 0.0, 1.0, 0.0]), Solver("etdrk4", 1e-9, times)
    found = system.run(QUIET, start, whole_space(4), how)
    assert not found.failure
    exact = 0.1 * (1.0 + rate * times) * np.exp(-rate * times)
    np.testing.assert_allclose(found.path[:, 0], exact, atol=2e-8)
