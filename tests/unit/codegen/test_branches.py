"""Branches of a plug-in's equations are SymPy's on every way to numbers; slopes are one-sided."""

import shutil

import numpy as np
import pytest
import sympy as sp

import vehiclemor as vm
from tests.unit import branches
from tests.unit.conftest import builder
from tests.unit.exporting.programs import compiled, driven

ARGUMENTS = [branches.STATES, branches.INPUTS, branches.PARAMETERS]
BY_SYMPY = [sp.lambdify(ARGUMENTS, part, "math") for part in (branches.RATES, branches.OUTPUTS)]


@pytest.fixture(scope="module", params=[1.3, 0.2], ids=["p > q", "p < q"])
def model(request):
    return builder("branches")(p=request.param)


@pytest.fixture(scope="module")
def points():
    """States and inputs of all signs, some at a kink."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.5, 1.5, (300, 7))
    points[:60] = rng.choice([-1.0, 0.0, 0.5, 1.0], (60, 7))
    return points[:, :4], points[:, 4:]


def wanted(model, states, inputs):
    p = model.parameters.flat()
    pairs = [*zip(states, inputs, strict=True)]
    return [np.array([f(x, u, p) for x, u in pairs], dtype=float) for f in BY_SYMPY]


def test_kernels_one_by_one_and_in_lanes(model, points):
    rates, outputs = wanted(model, *points)
    singly = [model.rhs(x, u) for x, u in zip(*points, strict=True)]
    for found in (singly, model.rhs_at(*points)):
        np.testing.assert_allclose(found, rates, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(model.outputs_at(*points), outputs, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("of", ["rhs", "outputs"])
def test_derivatives_are_those_of_the_branch(model, points, of):
    step, which = 1e-6, ["rhs", "outputs"].index(of)
    for x, u in zip(points[0][60:], points[1][60:], strict=True):
        ends = [wanted(model, x + side * np.eye(4), [u] * 4) for side in (step, -step)]
        slopes = (ends[0][which] - ends[1][which]).T / (2.0 * step)
        np.testing.assert_allclose(model.jacobian(x, u, of=of), slopes, atol=1e-8)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_exported_c(model, points, tmp_path):
    driver = compiled(vm.export(model, "c", tmp_path / "c"))
    inputs = points[1][:40]
    rates, rows = driven(driver, inputs, 1e-3)
    start = model.start()
    np.testing.assert_allclose(rates, wanted(model, [start], inputs[:1])[0][0], rtol=1e-14)
    np.testing.assert_allclose(rows[:, 4:], wanted(model, rows[:, :4], inputs)[1], rtol=1e-13)


@pytest.mark.parametrize("target", ["casadi", "jax"])
def test_other_libraries(model, points, target):
    library = pytest.importorskip(target)
    function, p = vm.export(model, target), model.parameter_values
    if target == "casadi":
        found = [part.full().T for part in function(points[0].T, points[1].T, p)]
    else:
        library.config.update("jax_enable_x64", True)
        found = library.vmap(function, (0, 0, None))(*points, p)
    for part, exact in zip(found, wanted(model, *points), strict=True):
        np.testing.assert_allclose(np.asarray(part), exact, rtol=1e-13, atol=1e-15)
