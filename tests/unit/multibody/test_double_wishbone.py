"""The double wishbone's coordinates, outputs and symmetries are those of its specification."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.oracles import double_wishbone
from vehiclemor.exceptions import GeometryError
from vehiclemor.simulation.build import build


def test_design_position_is_zero_but_for_the_tie_rod(model):
    assert model.design == pytest.approx([0, 0, 0, 0, 0, -0.141897, 0, 0], abs=5e-7)
    assert model.solve([0.0, 0.0]) == pytest.approx(model.design, abs=1e-15)
    np.testing.assert_array_equal(model.start(model.starts[0]), model.design)


@settings(max_examples=60)
@given(height=st.floats(-0.12, 0.12), rack=st.sampled_from([-0.05, -0.03, 0.0, 0.02, 0.05]))
def test_closures_hold_wherever_the_wheel_goes(model, points, height, rack):
    u = np.array([height, rack])
    q = model.solve(u)
    assert np.abs(double_wishbone.residual(points, q, u)).max() < 1e-12
    # No turn of an arm or of the carrier by more than 40 degrees: still the design's branch.
    assert np.abs(q - model.design).max() < 0.7
    jacobian = model.jacobian(q, u)[:7, :7]
    assert rack or np.linalg.svd(jacobian, compute_uv=False)[-1] > 0.096


def test_outputs_and_joints_are_those_of_the_specification(model, points, rng):
    paths = rng.uniform(-0.5, 0.5, (20, 8))
    for q, found in zip(paths, model.outputs_at(paths, np.zeros((20, 2))), strict=True):
        expected = double_wishbone.outputs(points, q)
        assert list(found) == pytest.approx([expected[n] for n in model.outputs], abs=1e-14)
        joints = model.joints_at(q)
        for name in ("upper_ball_joint", "lower_ball_joint", "tie_rod_outer", "wheel_centre"):
            place = double_wishbone.carrier_point(points, q, name)
            assert joints[name] == pytest.approx(place, abs=1e-14)
        rack_end = points["tie_rod_inner"] + [0.0, q[7], 0.0]
        assert joints["tie_rod_inner"] == pytest.approx(rack_end, abs=1e-15)
        assert np.linalg.norm(joints["axle_direction"]) == pytest.approx(1.0, abs=1e-15)


SHIFT, MIRROR = np.array([1.3, -0.4, 0.7]), np.array([1.0, -1.0, 1.0])
LENGTHS = ("spindle_x", "spindle_y", "rack")


@pytest.mark.parametrize(
    ("changed", "inputs", "coordinates", "outputs"),
    [
        (lambda point: point + SHIFT, 1.0, 1.0, lambda _: 1.0),
        (lambda p: 1.5 * p, 1.5, [1] * 7 + [1.5], lambda name: 1.5 if name in LENGTHS else 1.0),
        # A mirrored turn keeps its sense about y and reverses it about x, z and the arms' axes;
        # toe and camber are angles of e_y in fixed axes.
        (
            lambda point: point * MIRROR,
            [1, -1],
            [-1, 1, -1, -1, -1, -1, 1, -1],
            lambda name: 1 if name in ("spindle_x", "second_euler_angle") else -1,
        ),
    ],
    ids=["moved", "enlarged", "mirrored"],
)
def test_a_mechanism_at_another_place_or_of_another_size_or_side(
    model, points, changed, inputs, coordinates, outputs
):
    given = np.array([[0.1, 0.0], [-0.1, 0.0], [-0.05, 0.03], [0.08, -0.04]])
    other = build("double_wishbone", overrides={name: changed(p) for name, p in points.items()})
    run = other.solve_path(np.arange(4.0), given * inputs)
    expected = model.solve_path(np.arange(4.0), given)
    q, wanted = run.coordinates, expected.coordinates * coordinates
    # The tie rod of the mirrored one points to the other side: alpha becomes pi - alpha.
    if np.ndim(inputs):
        wanted[:, 5] += np.pi
    turns = np.round((q - wanted) / (2 * np.pi)) * (2 * np.pi)
    np.testing.assert_allclose(q - turns, wanted, rtol=0, atol=1e-12)
    signs = [outputs(name) for name in model.outputs]
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
def test_degenerate_geometry_is_refused(points, moved, message):
    with pytest.raises(GeometryError, match=message):
        build("double_wishbone", overrides={name: points[to] for name, to in moved.items()})


def test_a_singular_design_position_is_refused(points):
    def lift(y: float) -> float:
        """Vertical speed of a wheel centre at this y when the other joints move by one unit."""
        model = build("double_wishbone", overrides={"wheel_centre": centre(y)})
        jacobian = model.jacobian(model.design, np.zeros(2))[:7, :7]
        motion = np.linalg.svd(jacobian[:6])[2][-1]
        return jacobian[6] @ motion * np.sign(motion[3])

    def centre(y: float) -> np.ndarray:
        return points["wheel_centre"] * [1, 0, 1] + [0, y, 0]

    near, far = lift(0.8), lift(0.7)
    # A wheel centre that no motion lifts, and a vertical tie rod.
    locked = {"wheel_centre": centre(0.7 + 0.1 * far / (far - near))}
    vertical = {"tie_rod_outer": points["tie_rod_inner"] + [0.0, 0.0, 0.3]}
    for overrides in (locked, vertical):
        with pytest.raises(GeometryError, match=r"locked at design|singular"):
            build("double_wishbone", overrides=overrides)
