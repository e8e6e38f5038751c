"""Models of equations of motion: what they compile, and what they refuse without it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.standard_problems import maneuver
from vehiclemor.codegen import kernels as codegen_kernels
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.reduction.projection.dynamic import DynamicPodSettings, check_subspace
from vehiclemor.registry import component
from vehiclemor.simulation import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS
from vehiclemor.simulation.projection_windows import ProjectionWindows

QUIET = maneuver(lambda times, *_: np.zeros((len(times), 3)), 1.0)


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build.build("high_fidelity_vehicle")


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of kernels that are asked for."""
    asked: list[str] = []
    machine = codegen_kernels._machine
    monkeypatch.setattr(
        codegen_kernels,
        "_machine",
        lambda source, lanes: asked.append(source.name) or machine(source, lanes),
    )
    return asked


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_run_of_the_full_model_needs_its_solver_and_two_kernels(vehicle, compiled, solver):
    straight = component("maneuver", "rack_straight_ahead")
    vehicle.simulate(straight, times=np.array([0.1]), solver=solver, tolerance=1e-3)
    # Neither the mass matrix nor the equations before elimination.
    needed = {"derivative", "outputs"}
    assert set(compiled) - {f"{solver}_step"} <= needed < set(vehicle.kernels.sources)


def test_all_models_run_in_the_same_loop(standard, vehicle):
    straight = component("maneuver", "rack_straight_ahead")
    for solver, own in INTEGRATORS.items():
        found = []
        for model, man in ((vehicle, straight), (standard(), QUIET)):
            model.simulate(man, times=np.array([0.1]), solver=solver, tolerance=1e-3)
            found.append(catalogue.time_loop(own, "full", model.system.whole_steps(solver)))
        assert found[0] is found[1]


def test_a_start_that_cannot_be_written_is_integrated(standard):
    model = standard()
    start = model.start()
    start.flags.writeable = False
    run = model.simulate(QUIET, start, solver="dopri5", tolerance=1)
    assert run.status == "ok"
    np.testing.assert_array_equal(start, model.start())


def test_hash_of_a_dynamic_model_follows_its_loops(standard, monkeypatch):
    before = standard().kernel_hash
    assert standard().kernel_hash == before
    monkeypatch.setattr(build, "loops_digest", lambda _: "changed")
    assert standard().kernel_hash != before


def test_every_integrator_and_formulation_counts_in_the_hash():
    for own in INTEGRATORS.values():
        assert {f"simulation.integrators.{m}" for m in own.modules} <= set(catalogue.LOOP_SOURCES)
    for name in ("full", "state", "coordinates", "inputs"):
        assert f"simulation.formulations.{name}" in catalogue.LOOP_SOURCES


@pytest.mark.parametrize("lacking", ["second_order", "speeds"])
def test_a_model_without_a_kernel_refuses_what_needs_it(standard, lacking):
    whole = standard()
    shapes = {k: v for k, v in whole.equations.shapes.items() if k != lacking}
    sources = {k: v for k, v in whole.equations.sources.items() if k != lacking}
    equations = replace(whole.equations, shapes=shapes, sources=sources)
    model = replace(whole, equations=equations)
    settings = DynamicPodSettings(rank=1, snapshots=2, formulation="state", inner_product="range")
    check_subspace(model, settings)
    for wrong in ({"formulation": "coordinates"}, {"inner_product": "energy"}):
        with pytest.raises(InputError, match=f"has no {lacking}"):
            check_subspace(model, settings.model_copy(update=wrong))
    nothing = np.zeros((1, 1, 4))
    edges, rank = np.array([0.0, 9.0]), np.array([2])
    space = ProjectionWindows("coordinates", edges, np.zeros((1, 4)), nothing, nothing, rank)
    with pytest.raises(InputError, match=f"has no {lacking}"):
        model.integrate(QUIET, model.start(), space, "dopri5", 1e-3)
    function = model.mass_matrix if lacking == "second_order" else model.speeds_of_rates
    with pytest.raises(InputError, match=f"has no {lacking}"):
        function(model.start())


# Borders


@pytest.mark.parametrize("solver", INTEGRATORS)
@pytest.mark.parametrize("end", [0.0, 1e-13, 1e-12, 1e-10, 1e-8])
def test_a_run_that_ends_at_once_is_its_start(vehicle, solver, end):
    straight = component("maneuver", "rack_straight_ahead")
    found = vehicle.simulate(straight, times=np.array([end]), solver=solver, tolerance=1e-6)
    np.testing.assert_allclose(found.states[0], vehicle.start(), atol=1e-6)


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_start_with_rates_that_are_not_finite_says_so(vehicle, solver):
    straight = component("maneuver", "rack_straight_ahead")
    with pytest.raises(ConvergenceError, match=r"a state is not finite at t = 0 s"):
        vehicle.simulate(straight, np.full(52, 1e200), solver=solver)


def test_a_start_may_be_any_sequence(standard):
    model = standard()
    np.testing.assert_array_equal(model.start([0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3, 0.4])
    with pytest.raises(InputError, match="start"):
        model.start([1.0, 2.0])


def test_the_system_refuses_what_its_machine_code_would_read_beyond(standard):
    system = standard().system
    for x, u in ((np.zeros(3), np.zeros(3)), (np.zeros(4), np.zeros(1)), (np.zeros(4), 0.0)):
        with pytest.raises(InputError, match="x and u have shapes"):
            system.jacobian(x, u)


def test_a_kernel_that_is_not_there_is_never_called(standard):
    system = standard().system
    lacking = {k: v for k, v in system.kernels.sources.items() if k not in ("speeds", "outputs")}
    system = replace(system, kernels=Kernels(lacking))
    with pytest.raises(InputError, match="no speeds"):
        system.called("coordinates", "")
    with pytest.raises(InputError, match="no outputs"):
        system.along("outputs", np.zeros((1, 4)), np.zeros((1, 3)), 8)
