"""Geometry of double-wishbone corners: rigid bodies, mirror images, a solve that never fails."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.programs import function_of, pivot_shares
from vehiclemor.multibody.double_wishbone import linkage as double_wishbone_linkage
from vehiclemor.multibody.double_wishbone.points import POINTS, tie_rod_angles
from vehiclemor.multibody.high_fidelity import linkage_motions
from vehiclemor.multibody.high_fidelity.equations import CORNER, LOWER_ARMS, PIVOTS
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.symbolic.geometry import vector
from vehiclemor.symbolic.joints import free_rate
from vehiclemor.symbolic.tape import Tape

MIRROR = np.array([1.0, -1.0, 1.0])
# What the mirror does to zeta, eta, xi, theta_u, theta_l, alpha and beta.
TURNED = np.array([-1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
CARRIED = ("upper_ball_joint", "lower_ball_joint", "tie_rod_outer", "wheel_centre")
SIDES = (1, -1)

coordinates = st.tuples(*[st.floats(-1.0, 1.0)] * 7).map(np.array)
racks = st.floats(-0.05, 0.05)


def compiled(side: int) -> Callable:
    """(hard points by name, q, rack, rates, rack's velocity and acceleration) -> places by name."""
    tape, q = Tape(), sp.symbols("q:7", real=True)
    rates, rack = sp.symbols("rate:7", real=True), sp.symbols("rack rack_dot rack_ddot", real=True)
    points = {name: vector(sp.symbols(f"{name}_x {name}_y {name}_z", real=True)) for name in POINTS}
    linkage = double_wishbone_linkage.assembled(tape, q, rack[0], points, side)
    on_carrier = {name: linkage.on_carrier(tape, points[name]) for name in CARRIED}
    free = [free_rate(k, rate) for k, rate in enumerate(rates)]
    motions = linkage_motions.linkage_motions(tape, linkage, q, free, rack[1:])
    gaps, closing = linkage_motions.closures(tape, linkage, motions, points)
    zero = vector((0, 0, 0))
    results = {
        **on_carrier,
        "upper_arm_ball": linkage.upper_ball_joint,
        "lower_arm_ball": linkage.on_lower_arm(tape, points["lower_ball_joint"]),
        "lower_arm_rear": linkage.on_lower_arm(tape, points["lower_arm_rear_pivot"]),
        "lower_arm_front": linkage.on_lower_arm(tape, points["lower_arm_front_pivot"]),
        "rack_end": linkage.rack_end,
        "rod_end": linkage.rod_end,
        "rod_direction": linkage.rod_direction,
        "gaps": gaps,
        "gap_rates": [e for motion in closing for e in motion.value],
        "gap_biases": [e for motion in closing for e in motion.bias],
        "gap_columns": [
            [motion.columns.get(k, zero)[i] for k in range(7)]
            for motion in closing
            for i in range(3)
        ],
    }
    function = function_of(
        tape,
        [[list(point) for point in points.values()], q, rack, rates],
        [sp.Matrix(list(r)).tolist() for r in results.values()],
    )

    def places(p, q, rack=(0.0, 0.0, 0.0), rates=(0.0,) * 7) -> dict[str, np.ndarray]:
        found = function([p[name] for name in POINTS], q, rack, rates)
        return {k: np.squeeze(np.array(v)) for k, v in zip(results, found, strict=True)}

    return places


SIDE = {side: compiled(side) for side in SIDES}


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build("high_fidelity_vehicle")


def of_side(points: dict, side: int) -> dict[str, np.ndarray]:
    return {name: points[name] * (MIRROR if side < 0 else 1.0) for name in POINTS}


def design(points: dict, side: int) -> np.ndarray:
    p = of_side(points, side)
    return np.array([*np.zeros(5), *tie_rod_angles(p["tie_rod_inner"], p["tie_rod_outer"], side)])


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b))


@pytest.mark.parametrize("side", SIDES)
def test_the_design_position_is_that_of_the_hard_points(points, side):
    p = of_side(points, side)
    found = SIDE[side](p, design(points, side))
    for name in CARRIED:
        np.testing.assert_allclose(found[name], p[name], rtol=0, atol=1e-15)
    # The rest follows: closed corners of rigid bodies, whose tie rod ends where it did.
    for name, expected in (("rack_end", "tie_rod_inner"), ("rod_end", "tie_rod_outer")):
        np.testing.assert_allclose(found[name], p[expected], rtol=0, atol=1.2e-15)
    np.testing.assert_allclose(found["gaps"], 0.0, atol=1e-15)


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=20)
@given(q=coordinates, rack=racks)
def test_bodies_are_rigid(points, side, q, rack):
    p = of_side(points, side)
    found = SIDE[side](p, q, (rack, 0.0, 0.0))

    def assert_kept(a, b, design_a, design_b):
        assert distance(a, b) == pytest.approx(distance(p[design_a], p[design_b]), abs=1e-15)

    for arm in ("upper", "lower"):
        for end in ("front", "rear"):
            pivot = f"{arm}_arm_{end}_pivot"
            assert_kept(found[f"{arm}_arm_ball"], p[pivot], f"{arm}_ball_joint", pivot)
    for a, b in combinations(CARRIED, 2):
        assert_kept(found[a], found[b], a, b)
    # The carrier is no mirror image of itself.
    now, before = ([places[name] for name in CARRIED] for places in (found, p))
    volumes = [np.linalg.det(np.array(four[1:]) - four[0]) for four in (now, before)]
    assert volumes[0] == pytest.approx(volumes[1], abs=1e-15)
    assert_kept(found["rack_end"], found["rod_end"], "tie_rod_inner", "tie_rod_outer")
    assert np.linalg.norm(found["rod_direction"]) == pytest.approx(1.0, abs=1e-15)
    # Pivots stay, the rack moves along y, the upper arm carries the carrier.
    for end in ("rear", "front"):
        pivot = p[f"lower_arm_{end}_pivot"]
        np.testing.assert_allclose(found[f"lower_arm_{end}"], pivot, rtol=0, atol=2e-16)
    moved = found["rack_end"] - p["tie_rod_inner"]
    np.testing.assert_allclose(moved, [0.0, rack, 0.0], rtol=0, atol=1e-16)
    np.testing.assert_array_equal(found["upper_arm_ball"], found["upper_ball_joint"])


@settings(max_examples=20)
@given(q=coordinates, rack=racks)
def test_the_right_corner_mirrors_the_left_one(points, q, rack):
    left = SIDE[1](of_side(points, 1), q, (rack, 0.0, 0.0))
    right = SIDE[-1](of_side(points, -1), TURNED * q, (-rack, 0.0, 0.0))
    for name in (*CARRIED, "upper_arm_ball", "lower_arm_ball", "rack_end", "rod_end"):
        np.testing.assert_allclose(
            right[name], MIRROR * left[name], rtol=0, atol=5e-16, err_msg=name
        )
    gaps = np.tile(MIRROR, 2) * left["gaps"]
    np.testing.assert_allclose(right["gaps"], gaps, rtol=0, atol=1e-15)


def test_design_angles_of_the_tie_rods_mirror_each_other(points, vehicle):
    np.testing.assert_array_equal(design(points, -1), TURNED * design(points, 1))
    # Of the vehicle, from its specification.
    left = design(vehicle.parameters.values(), 1)[5:]
    np.testing.assert_allclose(left, [-0.178016256461, -0.0840901368329], rtol=1e-11)


@pytest.mark.parametrize("side", SIDES)
def test_a_positive_arm_angle_raises_the_left_and_lowers_the_right_ball_joint(points, side):
    p, q = of_side(points, side), design(points, side)
    for name, place in (("upper", 3), ("lower", 4)):
        moved = q.copy()
        moved[place] += 0.01
        rise = SIDE[side](p, moved)[f"{name}_arm_ball"] - p[f"{name}_ball_joint"]
        assert side * rise[2] > 0.001


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=15)
@given(q=coordinates, rack=racks, data=st.data())
def test_motions_of_the_closures_are_their_derivatives(points, side, q, rack, data):
    speeds = data.draw(coordinates)
    moved, accelerated = data.draw(st.tuples(st.floats(-1, 1), st.floats(-1, 1)))
    p = of_side(points, side)
    now = (rack, moved, accelerated)
    found = SIDE[side](p, q, now, speeds)
    # Complex steps: along the motion, and on from it where no coordinate accelerates.
    step = 1e-30
    later = SIDE[side](
        p, q + 1j * step * speeds, (rack + 1j * step * moved, moved + 1j * step * accelerated, 0.0),
        speeds,
    )  # fmt: skip
    np.testing.assert_allclose(later["gaps"].imag / step, found["gap_rates"], atol=1e-14)
    np.testing.assert_allclose(later["gap_rates"].imag / step, found["gap_biases"], atol=1e-13)
    rack_alone = np.array([0.0, 0.0, 0.0, 0.0, -moved, 0.0])
    by_speeds = found["gap_columns"] @ speeds + rack_alone
    np.testing.assert_allclose(by_speeds, found["gap_rates"], atol=1e-14)


# Pivots of the vehicle's front corners


ARM_ANGLES = np.linspace(0.0, 0.35, 15)
RACKS = (-0.03, -0.015, 0.0, 0.015, 0.03)


# Place of the lower arm among a corner's seven coordinates.
LOWER_ARM = CORNER[0].index(LOWER_ARMS[0])


def corner_blocks(model: DynamicModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Jacobians of both corners' closures by their seven coordinates (2, 6, 7)."""
    _, _, by_q, _ = model.descriptor(x, u)
    return np.array([by_q[6 * k : 6 * k + 6, list(own)] for k, own in enumerate(CORNER)])


@pytest.fixture(scope="module")
def reached(vehicle) -> list[tuple[np.ndarray, np.ndarray]]:
    """Closed corners on a grid of arm angles to both sides and racks, on from the design."""
    dependent = [j for j in range(7) if j != LOWER_ARM]
    found = []
    for rack in RACKS:
        u = np.array([rack, 0.0, 0.0])
        for direction in (1.0, -1.0):
            x = vehicle.start()
            for angle in ARM_ANGLES:
                # The same travel at both corners: the right arm's angle is opposite.
                for k, own in enumerate(CORNER):
                    x[own.start + LOWER_ARM] = SIDES[k] * direction * angle
                for _ in range(6):
                    gaps, _ = vehicle.violations(x, u)
                    blocks = corner_blocks(vehicle, x, u)
                    for k, own in enumerate(CORNER):
                        step = np.linalg.solve(blocks[k][:, dependent], gaps[6 * k : 6 * k + 6])
                        x[np.arange(own.start, own.stop)[dependent]] -= step
                assert np.abs(vehicle.violations(x, u)[0]).max() < 1e-14
                found.append((x.copy(), u))
    return found


def dependent_blocks(model: DynamicModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.delete(corner_blocks(model, x, u), LOWER_ARM, axis=2)


def test_the_reachable_range_is_that_of_a_road_car(vehicle, reached):
    heights = [
        SIDE[1](of_side(vehicle.parameters.values(), 1), x[CORNER[0]])["wheel_centre"][2]
        for x, _ in reached
    ]
    design = vehicle.parameters["wheel_centre"][2]
    assert min(heights) - design < -0.1
    assert max(heights) - design > 0.1


def test_pivots_of_the_vehicle_stay_away_from_zero(vehicle, reached):
    rng = np.random.default_rng(5)
    shares, smallest = [], []
    for x, u in reached:
        # A stabilised corner is closed up to a millirad.
        for state in (x, x + np.concatenate([rng.uniform(-1e-3, 1e-3, 26), np.zeros(26)])):
            for block in dependent_blocks(vehicle, state, u):
                shares.append(min(pivot_shares(block, PIVOTS)))
                smallest.append(np.linalg.svd(block, compute_uv=False)[-1])
    # Every pivot is all but the largest of its column: no digit is lost.
    assert min(shares) > 0.9
    assert min(smallest) > 0.07


def test_the_fixed_elimination_solves_as_accurately_as_a_dense_one(vehicle, reached):
    """Accelerations of closed corners fulfil the closures' second derivatives."""
    rng = np.random.default_rng(6)
    for x, u in reached[::7]:
        state = x.copy()
        state[26:] += rng.uniform(-1.0, 1.0, 26)
        _, _, by_q, gamma = vehicle.descriptor(state, u)
        accelerations = vehicle.derivative(state, u)[26:]
        error = by_q @ accelerations - gamma
        assert np.abs(error).max() < 1e-12 * np.abs(accelerations).max()
