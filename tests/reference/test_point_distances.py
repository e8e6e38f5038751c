"""The double wishbone in joint coordinates moves as the same links do in point coordinates."""

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation

from tests.oracles.kinematics import residual
from tests.oracles.point_distances import PointMechanism


@pytest.fixture(scope="module")
def mechanism(points):
    return PointMechanism(points)


@pytest.mark.parametrize("rack", [-0.05, 0.0, 0.04])
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_wheel_follows_the_same_path(model, mechanism, rack, direction):
    heights = direction * np.linspace(0.005, 0.2, 40)
    joints = mechanism.path(heights, rack)
    inputs = np.column_stack([heights, np.full(40, rack)])
    run = model.solve_path(np.arange(40.0), inputs)
    for x, q, y in zip(joints, run.coordinates, run.outputs, strict=True):
        moved = mechanism.wheel_centre(x) - mechanism.points["wheel_centre"]
        assert y[:2] == pytest.approx(moved[:2], abs=1e-11)
        angles = Rotation.from_matrix(mechanism.rotation(x)).as_euler("ZYX")
        assert q[:3] == pytest.approx(angles, abs=1e-11)
        drawn = model.joints_at(q)
        for name, place in (("upper_ball_joint", x[:3]), ("lower_ball_joint", x[3:6])):
            assert drawn[name] == pytest.approx(place, abs=1e-11)


@pytest.mark.parametrize("side", [0, 1])
def test_no_position_is_near_beyond_the_limits(model, points, side):
    limit = model.reach()[side]
    near = model.solve([limit, 0.0])
    for beyond, closes in ((-1e-4, True), (1e-3, False)):
        u = (limit + np.sign(limit) * beyond, 0.0)
        best = optimize.least_squares(
            lambda q, u=u: residual(points, q, u), near, xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        # Far away there may be another branch: the wheel gets there only if taken apart.
        is_near = np.abs(best.x - near).max() < 0.1
        assert (np.abs(best.fun).max() < 1e-10 and is_near) == closes
