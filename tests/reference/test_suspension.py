"""The suspension against point coordinates and other implementations; its reach."""

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation

from tests.oracles.double_wishbone import PointMechanism, residual
from vehiclemor.exceptions import UnreachableError, VehiclemorError
from vehiclemor.simulation.algebraic import AlgebraicModel

# Change of the limits (m) for 1 m of rack: 3.8 at the most, where the stop of the wheel's angle is
# met at a rack of 0.1 m; and what the search for the limits leaves open.
SLOPE, LEFT_OPEN = 4.0, 1e-6


def grid_of(model: AlgebraicModel, racks: np.ndarray, count: int) -> np.ndarray:
    """Inputs (racks, count, 2): at each rack heights of the whole reach, closer at its ends."""
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
    limits = np.array([model.reach(rack) for rack in racks])
    heights = limits[:, :1] + shares * (limits[:, 1:] - limits[:, :1])
    # Rounding must not lead out of the reach.
    heights = np.clip(heights, limits[:, :1], limits[:, 1:])
    return np.stack([heights, np.repeat(racks[:, None], count, axis=1)], axis=2)


def is_on_branch(model: AlgebraicModel, q: np.ndarray, u: np.ndarray) -> bool:
    """Whether a position solves the equations this side of every fold and stop.

    Between the design position and the stops only the side of a fold tells branches apart: the
    sign of the Jacobian's determinant.
    """
    sides = [
        np.linalg.slogdet(model.jacobian(*where)).sign
        for where in ((model.design, np.zeros(2)), (q, u))
    ]
    stops = model.definition.stops
    within = all(abs(q[model.coordinates.index(name)]) <= stop for name, stop in stops.items())
    return sides[0] == sides[1] and within and np.abs(model.residual(q, u)).max() < 1e-11


def failures(model: AlgebraicModel, grid: np.ndarray) -> tuple[int, int, float]:
    """How many points have failed, how many lie on another branch, and the largest angle (rad)."""
    failed, wrong, largest = 0, 0, 0.0
    for u in grid.reshape(-1, 2):
        try:
            q = model.solve(u)
        except VehiclemorError:
            failed += 1
            continue
        wrong += not is_on_branch(model, q, u)
        largest = max(largest, np.abs(q).max())
    return failed, wrong, largest


@pytest.mark.parametrize("racks", [np.linspace(-0.1, 0.1, 101), np.linspace(-1e-3, 1e-3, 101)])
def test_reach_is_continuous_in_the_rack(model, racks):
    limits = np.array([model.reach(rack) for rack in racks])
    changes = np.abs(np.diff(limits, axis=0))
    assert changes.max() <= SLOPE * (racks[1] - racks[0]) + LEFT_OPEN


def test_all_of_the_reach_is_solved_on_the_branch(model):
    racks = np.concatenate([np.linspace(-0.1, 0.1, 17), [2e-4, 2.7e-4, 3e-4, 1e-3, 9e-3]])
    failed, wrong, largest = failures(model, grid_of(model, racks, 18))
    assert (failed, wrong) == (0, 0)
    assert largest < 2.1


@pytest.mark.parametrize("rack", [4e-4, 1e-3, 9e-3])
def test_below_the_reach_no_other_branch_is_taken(model, rack):
    low, _ = model.reach(rack)
    for height in (*np.linspace(low - 1e-6, -0.2538, 9), -0.2167):
        with pytest.raises(UnreachableError, match="reachable range"):
            model.solve([height, rack])


@pytest.mark.parametrize("solver", ["newton", "newton_lanes"])
def test_jumps_along_the_limits_stay_on_the_branch(model, solver):
    rng = np.random.default_rng(5)
    for spread in (3e-3, 3e-2):
        racks = np.clip(rng.normal(0.0, spread, 400), -0.1, 0.1)
        lowest = np.array([model.reach(rack)[0] for rack in racks])
        inputs = np.column_stack([lowest * (1.0 - 10.0 ** rng.uniform(-6, -0.5, 400)), racks])
        for ordered in (inputs, inputs[np.argsort(racks)]):
            run = model.solve_path(np.arange(400.0), ordered, solver)
            for q, u in zip(run.coordinates, ordered, strict=True):
                assert is_on_branch(model, q, u)


@pytest.mark.parametrize("samples", [9, 17, 101, 1001])
@pytest.mark.parametrize("rack", [0.0, 2e-4, 1e-3, 9e-3])
def test_lanes_beyond_the_reach_take_no_other_branch(model, rack, samples):
    times = np.linspace(0.0, 1.0, samples)
    for limit in model.reach(rack):
        for beyond in (1.0001, 1.002, 1.05, 1.3):
            heights = beyond * limit * np.sin(np.pi * times) ** 2
            with pytest.raises(UnreachableError, match="reachable range"):
                model.solve_path(
                    times, np.column_stack([heights, 0.0 * times + rack]), "newton_lanes"
                )
        heights = 0.9999 * limit * np.sin(np.pi * times) ** 2
        inputs = np.column_stack([heights, 0.0 * times + rack])
        run = model.solve_path(times, inputs, "newton_lanes")
        assert all(is_on_branch(model, q, u) for q, u in zip(run.coordinates, inputs, strict=True))


def test_a_stop_ends_the_reach(model):
    low, _ = model.reach(0.05)
    assert model.solve([low, 0.05])[0] == pytest.approx(-1.0, abs=1e-4)
    model.reach(0.1)
    with pytest.raises(UnreachableError, match=r"rack displacement 0\.11 m .* goes to 0\.1000 m"):
        model.reach(0.11)


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
