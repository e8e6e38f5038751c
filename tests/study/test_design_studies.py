"""The design studies: what they find is an optimum, in full order and reduced."""

import runpy

import numpy as np
import pytest

import vehiclemor as vm
from tests.texts.markdown import ROOT
from vehiclemor.report.comparison.design import FINDS, SAVES, design_rows
from vehiclemor.report.design_studies import design_studies
from vehiclemor.report.published import load_published


@pytest.fixture(scope="module")
def springs():
    return runpy.run_path(str(ROOT / "examples" / "spring_damper_front.py"))


@pytest.fixture(scope="module")
def stiff(springs):
    """The optimum in full order, and the objectives of another integrator and tolerance."""
    full = vm.reduce(springs["MODEL"], "full_order", solver="ros34pw2", tolerance=1e-4)
    (point,) = springs["front"](springs["Designer"](full, exact=True), [0.101])
    fine = springs["Designer"](vm.reduce(springs["MODEL"], "full_order", tolerance=1e-9))
    return point, fine


def test_springs_and_dampers_of_the_front_are_optimal(springs, stiff):
    point, fine = stiff
    assert fine.values(point.design)[0] == pytest.approx(0.101, rel=1e-3)
    roll, yaw = fine.slopes(point.design)
    # Of the Lagrange function; what is at a bound may only want beyond it.
    slope = (yaw + point.multiplier * roll) / fine.values(point.design)[1]
    top, low = point.design > springs["HIGHEST"] - 1e-6, point.design < springs["LOWEST"] + 1e-6
    free = ~(top | low)
    assert point.multiplier > 0.0
    assert free.any()
    assert np.abs(slope[free]).max() < 0.01
    assert (slope[top] < 0.0).all()
    assert (slope[low] > 0.0).all()


@pytest.fixture(scope="module")
def joints():
    return runpy.run_path(str(ROOT / "examples" / "suspension_hard_points.py"))


def squares(joints, change):
    """Sum of squares at a design, of a suspension that is built anew."""
    values = vm.model(joints["MODEL"]).parameters.values()
    points = {name.split(".")[0]: list(values[name.split(".")[0]]) for name in joints["DESIGN"]}
    for name, part in zip(joints["DESIGN"], change, strict=True):
        points[name.split(".")[0]]["xyz".index(name[-1])] += part
    model = vm.model(joints["MODEL"], parameters=points)
    run = vm.simulate(model, maneuver=joints["travel"](), errors=False)
    z = run["inputs"].sel(input="z").values
    off = [
        run["outputs"].sel(output=name).values - slope * z
        for name, slope in zip(("toe", "camber"), joints["TARGETS"], strict=True)
    ]
    return np.sum(np.square(off))


def test_hard_points_are_optimal_within_their_bounds_and_the_path_map_finds_them(joints):
    designers = joints["designers"]()
    found = joints["designed"](designers["full order, exact derivatives"])
    slope = np.array(
        [
            (squares(joints, found.x + h) - squares(joints, found.x - h)) / 2e-5
            for h in 1e-5 * np.eye(len(found.x))
        ]
    )
    at = np.sign(found.x) * (np.abs(found.x) > joints["LARGEST"] * (1.0 - 1e-4))
    assert 0 < np.count_nonzero(at) < len(at)
    size = np.abs(slope).max()
    assert np.abs(slope[at == 0]).max() < 1e-4 * size
    assert (slope[at != 0] * at[at != 0] < 0.0).all()
    mapped = joints["designed"](designers["path map, differences"])
    np.testing.assert_allclose(mapped.x, found.x, atol=1e-7)


def test_stored_designs_have_the_objectives_that_are_stored(springs, stiff):
    _, fine = stiff
    for name, points in design_studies()["fronts"].items():
        for point in points[::4]:
            found = fine.values(np.array(point["design"]))
            np.testing.assert_allclose(found, point["real"], rtol=1e-4, err_msg=name)


def test_claims_about_design_have_a_row_for_each_study_and_reduced_model():
    claims = load_published().claims
    finds, saves = (design_rows(claims[name]) for name in (FINDS, SAVES))
    assert [row.variant for row in finds] == [row.variant for row in saves]
    assert len(finds) == 5
    verdicts = {row.variant: row.verdict for row in finds}
    assert verdicts["hard points: path map"] == "met"
    assert verdicts["springs and dampers: POD, r = 3"] == "missed"
    for row in (*finds, *saves):
        assert row.verdict == ("met" if row.reproduced <= row.bound else "missed")
        assert "design_studies.py" in row.reason
