"""Models of equations of motion: what they compile and refuse, and runs in parts."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.standard_problems import maneuver
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.reduction.projection.dynamic import DynamicPodSettings, check_subspace
from vehiclemor.registry import component
from vehiclemor.simulation import build
from vehiclemor.simulation.control_periods import ControlPeriods
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS
from vehiclemor.simulation.workspaces import Solver

STRAIGHT = component("maneuver", "rack_straight_ahead")
QUIET = maneuver(lambda times, *_: np.zeros((len(times), 3)), 1.0)


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build.build("high_fidelity_vehicle")


@pytest.mark.parametrize("lacking", ["second_order", "speeds"])
def test_a_model_without_a_kernel_refuses_what_needs_it(standard, lacking):
    whole = standard()
    equations = Kernels(v for k, v in whole.equations.sources.items() if k != lacking)
    model = replace(whole, equations=equations)
    settings = DynamicPodSettings(rank=1, snapshots=2, formulation="state", inner_product="range")
    check_subspace(model, settings)
    for wrong in ({"formulation": "coordinates"}, {"inner_product": "energy"}):
        with pytest.raises(InputError, match=f"has no {lacking}"):
            check_subspace(model, settings.model_copy(update=wrong))
    nothing = np.zeros((1, 1, 4))
    edges, rank = np.array([0.0, 9.0]), np.array([2])
    space = ControlPeriods("coordinates", edges, np.zeros((1, 4)), nothing, nothing, rank)
    with pytest.raises(InputError, match=f"has no {lacking}"):
        model.integrate(QUIET, model.start(), space, Solver("dopri5", 1e-3))
    function = model.mass_matrix if lacking == "second_order" else model.speeds_of_rates
    with pytest.raises(InputError, match=f"has no {lacking}"):
        function(model.start())


def test_equations_that_lack_a_function_make_no_model(standard):
    model = standard()
    equations = Kernels(v for k, v in model.equations.sources.items() if k != "outputs")
    lacking = replace(model, equations=equations)
    with pytest.raises(InputError, match="its equations have no outputs"):
        build.reparametrised(lacking, {})


# Borders


@pytest.mark.parametrize("solver", INTEGRATORS)
@pytest.mark.parametrize("end", [0.0, 1e-13, 1e-12, 1e-10, 1e-8])
def test_a_run_that_ends_at_once_is_its_start(vehicle, solver, end):
    found = vehicle.simulate(STRAIGHT, times=np.array([end]), solver=solver, tolerance=1e-6)
    np.testing.assert_allclose(found.states[0], vehicle.start(), atol=1e-6)


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_start_with_rates_that_are_not_finite_says_so(vehicle, solver):
    with pytest.raises(ConvergenceError, match=r"a state is not finite at t = 0 s"):
        vehicle.simulate(STRAIGHT, np.full(52, 1e200), solver=solver)


def test_a_kernel_that_is_not_there_is_never_called(standard):
    system = standard().system
    kernels = system.kernels.sources.values()
    lacking = [kernel for kernel in kernels if kernel.name not in ("speeds", "outputs")]
    system = replace(system, kernels=Kernels(lacking))
    with pytest.raises(InputError, match="no speeds"):
        system.called("coordinates", "")
    with pytest.raises(InputError, match="no outputs"):
        system.values_at("outputs", np.zeros((1, 4)), np.zeros((1, 3)), 8)


# Runs that begin in mid-maneuver: cut at any time and continued, a run is the uncut one


CASES = (
    ("independent_suspension_vehicle", "step_steer"),
    ("high_fidelity_vehicle", "rack_step_steer"),
)


# The steering moves from 1 s to 1.2 s; its acceleration jumps in neither.
@pytest.mark.parametrize(("name", "maneuver"), CASES)
def test_a_cut_run_goes_on_as_the_uncut_one(name, maneuver):
    model, maneuver = build.build(name), component("maneuver", maneuver)
    whole = model.simulate(maneuver, "dropped", tolerance=1e-8)
    scale = np.abs(whole.states).max(axis=0) + 1.0
    for sample in (0, 17, 50, 55, 60, 181, 250):
        begin = float(whole.times[sample])
        later = model.simulate(maneuver, whole.states[sample], tolerance=1e-8, begin=begin)
        np.testing.assert_array_equal(later.times, whole.times[sample:])
        # Both runs are wrong by their tolerance a step, in hundreds of steps.
        assert np.abs((later.states - whole.states[sample:]) / scale).max() < 3e-5


def test_a_run_begins_within_its_maneuver_between_output_times_too():
    model, maneuver = (
        build.build("independent_suspension_vehicle"),
        component("maneuver", "step_steer"),
    )
    whole, begin = model.simulate(maneuver), 1.0137
    state = model.simulate(maneuver, times=[0.0, begin]).states[-1]
    later = model.simulate(maneuver, state, begin=begin)
    np.testing.assert_array_equal(later.times, whole.times[whole.times > begin])
    np.testing.assert_allclose(later.states, whole.states[-len(later.times) :], atol=1e-5)
    for wrong in (-0.1, 5.1, np.nan):
        with pytest.raises(InputError, match="begin"):
            model.simulate(maneuver, begin=wrong)
    # No output time lies before.
    with pytest.raises(InputError, match="1 to 5 s"):
        model.simulate(maneuver, times=[0.5, 2.0], begin=1.0)
