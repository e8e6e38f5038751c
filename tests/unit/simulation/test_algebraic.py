"""Full-order solvers of mechanisms: accuracy, counts, branches; wrong paths of any model."""

from dataclasses import replace

import numpy as np
import pytest

from tests.models import MODELS
from vehiclemor.exceptions import ConvergenceError, InputError, UnreachableError
from vehiclemor.reduction.methods.full_order import FullOrderMechanism
from vehiclemor.registry import component
from vehiclemor.simulation.build import build


def test_reach_is_that_of_the_specification_and_can_be_reached(model):
    assert model.reach() == pytest.approx((-0.2145, 0.2965), abs=1e-3)
    for limit in model.reach():
        q = model.solve([limit, 0.0])
        assert np.abs(model.residual(q, [limit, 0.0])).max() < 1e-12


@pytest.mark.parametrize("height", [-0.2147, 0.2967, -3.0, 1e9])
def test_height_out_of_reach_names_both_limits(model, height):
    with pytest.raises(UnreachableError, match=r"-0\.2146 to 0\.2966 m") as error:
        model.solve([height, 0.0])
    assert f"{height:.5g} m" in str(error.value)


@pytest.mark.parametrize("samples", [1, 7, 8, 9, 15, 16, 1000, 1001])
@pytest.mark.parametrize("name", ["travel_and_rack", "travel_and_rack_multisine"])
def test_lanes_give_the_solution_of_newton_for_any_number_of_samples(model, name, samples):
    maneuver = component("maneuver", name).perturbed(1.8, -1.1)
    few = replace(maneuver, samples=samples, duration=0.01 * samples)
    newton, lanes = model.simulate(few), model.simulate(few, solver="newton_lanes")
    assert lanes.status == "ok"
    np.testing.assert_allclose(lanes.coordinates, newton.coordinates, rtol=0, atol=1e-13)
    np.testing.assert_allclose(lanes.outputs, newton.outputs, rtol=0, atol=1e-13)
    if samples == 1001:
        # It begins nearer.
        assert lanes.counts["iterations"] < 0.8 * newton.counts["iterations"]
        # One Newton step from there: its error is the square of the last step's.
        loose = model.simulate(few, solver="newton_lanes", tolerance=1e-4)
        assert np.abs(loose.coordinates - newton.coordinates).max() < 1e-7


def test_lanes_that_fail_are_solved_sample_by_sample(model, nominal):
    heights = np.random.default_rng(3).uniform(-0.2, 0.28, 100)
    jumps = np.column_stack([heights, np.zeros(100)])
    newton, lanes = (
        model.solve_path(np.arange(100.0), jumps, solver) for solver in ("newton", "newton_lanes")
    )
    np.testing.assert_array_equal(lanes.coordinates, newton.coordinates)
    assert lanes.counts == newton.counts
    for solver in ("newton", "newton_lanes"):
        with pytest.raises(UnreachableError, match=r"at t = 7\.\d+ s"):
            model.simulate(nominal.perturbed(amplitude=2.2), solver=solver)
    # A stop is not gone beyond, though there are solutions.
    times = np.linspace(0.0, 10.0, 1001)
    low, _ = model.reach(0.05)
    turned = np.column_stack([1.02 * low * times / 10.0, np.full(1001, 0.05)])
    with pytest.raises(UnreachableError, match=r"rack at 0\.05 m"):
        model.solve_path(times, turned, "newton_lanes")


@pytest.mark.parametrize("solver", ["newton", "newton_lanes"])
def test_a_run_that_diverges_tells_its_counts(model, nominal, full, solver):
    # No step gets as small as this tolerance.
    with pytest.raises(ConvergenceError, match="does not contract") as error:
        model.simulate(nominal, solver=solver, tolerance=1e-30)
    run = error.value.trajectory
    assert run.status == "diverged"
    assert run.counts["iterations"] > 100
    assert run.counts["linear_solves"] == run.counts["iterations"]
    diverged = FullOrderMechanism(model, solver, 1e-30).simulate(nominal, "equilibrium")
    assert (diverged.status, diverged.counts) == (run.status, run.counts)


@pytest.fixture(scope="module", params=MODELS)
def each_model(request):
    return build(request.param)


@pytest.mark.parametrize("function", ["outputs_at", "rhs_at"])
def test_paths_of_another_shape_or_not_finite_are_refused(each_model, function):
    call = getattr(each_model, function, None)
    if call is None:
        assert each_model.kind == "ae"
        return
    n, m = len(each_model.definition.states), len(each_model.inputs)
    states, inputs = np.zeros((5, n)), np.zeros((5, m))
    bad = np.zeros((5, n))
    bad[3, 1] = np.nan
    wrong = [
        (states, np.zeros((1, m))),
        (states[:, :3], inputs),
        (states[0], inputs),
        ("a", inputs),
    ]
    wrong += [(states, np.full((5, m), np.inf))]
    for path in wrong:
        with pytest.raises(InputError, match=r"states|inputs"):
            call(*path)
    with pytest.raises(InputError, match=r"states\[3, 1\] is not finite"):
        call(bad, inputs)


NO_TIMES = [], [0.0, 2.0, 1.0], [0.0, 1e3], [-1.0, 0.0], [0.0, np.nan], [[0, 1]], 1, "a"
NO_STARTS = np.zeros(3), np.zeros((2, 8)), [np.nan] * 28, "abc", 1.0


@pytest.mark.parametrize(
    ("argument", "values", "named"),
    [("times", NO_TIMES, "times (are|must)"), ("start", NO_STARTS, "start")],
)
def test_times_and_starts_that_are_none_are_refused(each_model, argument, values, named):
    maneuver = component("maneuver", each_model.definition.maneuver)
    for wrong in values:
        with pytest.raises(InputError, match=named):
            each_model.simulate(maneuver, **{argument: wrong})
