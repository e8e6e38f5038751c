"""Models of equations of motion: what they compile, and what they refuse without it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.standard_problems import maneuver
from vehiclemor.codegen import kernels as codegen_kernels
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.errors import InputError
from vehiclemor.reduction.projection.dynamic import check_subspace
from vehiclemor.reduction.projection.pod_settings import DynamicPodSettings
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
    """Names of kernels that are asked for, and modules of time loops."""
    asked: list[str] = []
    machine, loops = codegen_kernels._machine, catalogue.loops
    monkeypatch.setattr(
        codegen_kernels, "_machine", lambda source: asked.append(source.name) or machine(source)
    )
    monkeypatch.setattr(
        catalogue, "loops", lambda modules, *rest: asked.extend(modules) or loops(modules, *rest)
    )
    return asked


@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_run_of_the_full_model_needs_its_solver_and_two_kernels(vehicle, compiled, solver):
    straight = component("maneuver", "rack_straight_ahead")
    vehicle.simulate(straight, times=np.array([0.1]), solver=solver, tolerance=1e-3)
    kernels = {name for name in compiled if "." not in name}
    # Neither the mass matrix nor the equations before elimination.
    assert kernels <= {"derivative", "outputs"} < set(vehicle.kernels.sources)
    folder = "simulation.integrators."
    used = {name.removeprefix(folder) for name in compiled if name.startswith(folder)}
    assert used == {*INTEGRATORS[solver].modules, "structures", "loop"}


def test_all_models_run_in_the_same_loop(standard, vehicle, compiled):
    straight = component("maneuver", "rack_straight_ahead")
    for solver, own in INTEGRATORS.items():
        found = []
        for model, man in ((vehicle, straight), (standard(), QUIET)):
            model.simulate(man, times=np.array([0.1]), solver=solver, tolerance=1e-3)
            found.append(catalogue.time_loop(own, "full", False))
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
    model = replace(whole, equations=equations, kernels=Kernels(sources))
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
