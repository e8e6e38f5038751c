"""Whole steps of the exponential method as one kernel."""

from dataclasses import replace

import numpy as np

from vehiclemor.reduction.vehicle.feature_kernels import diagonal_blocks
from vehiclemor.reduction.vehicle.feature_system import feature_system
from vehiclemor.reduction.vehicle.features import Features
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.system import Solver
from vehiclemor.steering_maneuvers import lane_change

# A damped oscillator and a decay, pushed by the inputs and by cubic terms, and a place.
FEATURES = Features(
    3,
    1,
    (("bend", "z0 * z0 - z2"),),
    ("z0", "z1", "z2", "u0", "bend * z1", "z0 * z1 * z2", "1.0"),
    diagonal=(2, 1),
)


def system(diagonal: tuple[int, ...]):
    c = np.zeros((7, 6))
    c[:2, :2] = [[-1.0, -4.0], [4.0, -1.0]]
    c[2, 2] = -9.0
    # Heading and place have nonlinear rates alone: at rest all of the Jacobian is in the blocks.
    c[4:6, 3:] = [[1.0, 0.5, -0.4], [1.0, 0.3, 0.7]]
    c[3, 0], c[4, 0], c[5, 1], c[5, 2] = 0.6, 0.9, -0.8, 0.7
    features = replace(FEATURES, diagonal=diagonal)
    return feature_system(features, np.zeros(0), c, np.ones(6), np.zeros(3))


def path(built, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    run = built.run(
        lane_change,
        np.array([0.1, -0.2, 0.05, 0, 0, 0]),
        whole_space(6),
        Solver("etdrk4", tolerance),
    )
    assert not run.failure
    return run.path, run.counts


def test_a_step_as_one_kernel_is_the_step_of_the_loops():
    blocks = system((2, 1))
    dense = replace(blocks, fused={})
    frozen = dense.frozen_jacobian
    assert np.abs(frozen[3:]).max() < 1e-9
    for tolerance in (1e-2, 1e-4):
        (found, counts), (loops, others) = path(blocks, tolerance), path(dense, tolerance)
        np.testing.assert_array_equal(counts, others)
        assert counts[1] > 20
        np.testing.assert_allclose(found, loops, rtol=1e-7, atol=1e-9)
        assert np.abs(found[-1] - path(dense, 1e-9)[0][-1]).max() < 10.0 * tolerance


def test_blocks_are_numbered_from_the_first_coordinate():
    assert diagonal_blocks((2, 1, 1)) == ((0, 1), (2,), (3,))
