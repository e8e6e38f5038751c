"""The double wishbone's coordinates, outputs and symmetries are those of its specification."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.oracles import kinematics
from vehiclemor.errors import GeometryError
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory

# Specification of the model, "What to expect", to 5 digits; the last number is the spindle's y.
SPECIFIED = {
    0.1: (0.03264, -0.01587, 0.04619, 0.41738, 0.30398, -0.14331, 0.27596, 0.0, -0.00847),
    -0.1: (-0.10169, 0.00776, -0.02107, -0.43263, -0.32213, -0.13999, -0.28160, 0.0, -0.02907),
}


@pytest.mark.parametrize("height", [0.1, -0.1])
def test_coordinates_at_full_travel(model: AlgebraicModel, height: float) -> None:
    run = model.solve_path(np.zeros(1), np.array([[height, 0.0]]))
    found = [*run.coordinates[0], run.outputs[0, model.outputs.index("spindle_y")]]
    assert np.round(found, 5) == pytest.approx(SPECIFIED[height], abs=1e-12)
    # Bump steer is large.
    toe = np.degrees(run.outputs[0, model.outputs.index("toe")])
    assert toe == pytest.approx(1.9 if height > 0.0 else -5.8, abs=0.05)


def test_design_position_is_zero_but_for_the_tie_rod(model: AlgebraicModel) -> None:
    assert model.design == pytest.approx([0, 0, 0, 0, 0, -0.141897, 0, 0], abs=5e-7)
    assert model.solve([0.0, 0.0]) == pytest.approx(model.design, abs=1e-15)
    np.testing.assert_array_equal(model.start(model.starts[0]), model.design)


@settings(max_examples=60)
@given(height=st.floats(-0.12, 0.12), rack=st.sampled_from([-0.05, -0.03, 0.0, 0.02, 0.05]))
def test_closures_hold_wherever_the_wheel_goes(
    model: AlgebraicModel, points: dict, height: float, rack: float
) -> None:
    u = np.array([height, rack])
    q = model.solve(u)
    assert np.abs(kinematics.residual(points, q, u)).max() < 1e-12
    # No turn of an arm or of the carrier by more than 40 degrees: still the design's branch.
    assert np.abs(q - model.design).max() < 0.7


def test_jacobian_is_far_from_singular_within_the_travel_of_a_road_car(
    model: AlgebraicModel,
) -> None:
    inputs = np.column_stack([np.linspace(-0.12, 0.12, 121), np.zeros(121)])
    path = model.solve_path(np.arange(121.0), inputs).coordinates
    jacobians = [model.jacobian(q, u)[:7, :7] for q, u in zip(path, inputs, strict=True)]
    assert min(np.linalg.svd(j, compute_uv=False)[-1] for j in jacobians) > 0.096


def test_outputs_are_those_of_the_specification(
    model: AlgebraicModel, points: dict, rng: np.random.Generator
) -> None:
    paths, inputs = rng.uniform(-0.5, 0.5, (20, 8)), np.zeros((20, 2))
    for q, found in zip(paths, model.outputs_at(paths, inputs), strict=True):
        expected = kinematics.outputs(points, q)
        assert list(found) == pytest.approx([expected[n] for n in model.outputs], abs=1e-14)


def test_joints_are_those_of_the_specification(
    model: AlgebraicModel, points: dict, rng: np.random.Generator
) -> None:
    q = rng.uniform(-0.5, 0.5, 8)
    found = model.joints_at(q)
    for name in ("upper_ball_joint", "lower_ball_joint", "tie_rod_outer", "wheel_centre"):
        assert found[name] == pytest.approx(kinematics.carrier_point(points, q, name), abs=1e-14)
    rack_end = points["tie_rod_inner"] + [0.0, q[7], 0.0]
    assert found["tie_rod_inner"] == pytest.approx(rack_end, abs=1e-15)
    assert np.linalg.norm(found["axle_direction"]) == pytest.approx(1.0, abs=1e-15)


INPUTS = np.array([[0.1, 0.0], [-0.1, 0.0], [-0.05, 0.03], [0.08, -0.04]])


def solved(points: dict, inputs: np.ndarray) -> Trajectory:
    model = build("double_wishbone", overrides=points)
    return model.solve_path(np.arange(float(len(inputs))), inputs)


def test_translation_of_all_points_changes_nothing(model: AlgebraicModel, points: dict) -> None:
    shift = np.array([1.3, -0.4, 0.7])
    run = solved({name: point + shift for name, point in points.items()}, INPUTS)
    expected = model.solve_path(np.arange(4.0), INPUTS)
    np.testing.assert_allclose(run.coordinates, expected.coordinates, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.outputs, expected.outputs, rtol=0, atol=1e-12)


def test_enlarged_mechanism_has_the_same_angles(model: AlgebraicModel, points: dict) -> None:
    run = solved({name: 1.5 * point for name, point in points.items()}, 1.5 * INPUTS)
    expected = model.solve_path(np.arange(4.0), INPUTS)
    lengths = {"spindle_x", "spindle_y", "rack"}
    scale = [1.5 if name in lengths else 1.0 for name in model.outputs]
    np.testing.assert_allclose(
        run.coordinates[:, :7], expected.coordinates[:, :7], rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(run.outputs, expected.outputs * scale, rtol=0, atol=1e-12)


def test_right_corner_is_the_mirror_image_of_the_left_one(
    model: AlgebraicModel, points: dict
) -> None:
    run = solved({name: point * [1, -1, 1] for name, point in points.items()}, INPUTS * [1, -1])
    expected = model.solve_path(np.arange(4.0), INPUTS)
    q, left = run.coordinates, expected.coordinates
    # A mirrored turn keeps its sense about y and reverses it about x, z and the arms' axes.
    np.testing.assert_allclose(q[:, :5], left[:, :5] * [-1, 1, -1, -1, -1], rtol=0, atol=1e-12)
    # The tie rod points to the other side: alpha becomes pi - alpha, up to whole turns.
    reversed_rod = -np.exp(-1j * left[:, 5])
    np.testing.assert_allclose(np.exp(1j * q[:, 5]), reversed_rod, rtol=0, atol=1e-12)
    np.testing.assert_allclose(q[:, 6:], left[:, 6:] * [1, -1], rtol=0, atol=1e-12)
    # Toe and camber are angles of e_y in fixed axes: both change their sign with zeta and xi.
    signs = [1 if name in ("spindle_x", "second_euler_angle") else -1 for name in model.outputs]
    np.testing.assert_allclose(run.outputs, expected.outputs * signs, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("moved", "message"),
    [
        ({"upper_arm_front_pivot": "upper_arm_rear_pivot"}, "upper arm"),
        ({"lower_arm_rear_pivot": "lower_arm_front_pivot"}, "lower arm"),
        ({"tie_rod_outer": "tie_rod_inner"}, "tie rod"),
        ({"lower_ball_joint": "upper_ball_joint"}, "wheel carrier"),
        ({"upper_ball_joint": "upper_arm_front_pivot"}, "upper_ball_joint"),
    ],
)
def test_degenerate_geometry_is_refused(points: dict, moved: dict, message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        build("double_wishbone", overrides={name: points[to] for name, to in moved.items()})


def test_wheel_centre_that_motion_cannot_lift_is_refused(points: dict) -> None:
    def lift(y: float) -> float:
        """Vertical speed of a wheel centre at this y when the other joints move by one unit."""
        centre = points["wheel_centre"] * [1, 0, 1] + [0, y, 0]
        model = build("double_wishbone", overrides={"wheel_centre": centre})
        jacobian = model.jacobian(model.design, np.zeros(2))[:7, :7]
        motion = np.linalg.svd(jacobian[:6])[2][-1]
        return jacobian[6] @ motion * np.sign(motion[3])

    near, far = lift(0.8), lift(0.7)
    level = 0.7 + 0.1 * far / (far - near)
    centre = points["wheel_centre"] * [1, 0, 1] + [0, level, 0]
    with pytest.raises(GeometryError, match="locked at design"):
        build("double_wishbone", overrides={"wheel_centre": centre})


def test_vertical_tie_rod_is_refused(points: dict) -> None:
    above = points["tie_rod_inner"] + [0.0, 0.0, 0.3]
    with pytest.raises(GeometryError, match="singular"):
        build("double_wishbone", overrides={"tie_rod_outer": above})
