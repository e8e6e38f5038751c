"""No integrator or formulation writes beyond the scratch space that is reserved for it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.python_system import python_system
from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.loops import Prepared, address_of_array
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.vehicle.features import Features, feature_system
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS, frozen
from vehiclemor.simulation.projection_windows import ProjectionWindows, whole_space
from vehiclemor.simulation.system import System
from vehiclemor.simulation.workspaces import Solver

GUARD, MARK = 64, 12345
HEAD = "(_x, _u, _constants, _work, _result):"


def oscillators(n: int, inputs: int) -> System:
    """n / 2 driven oscillators of unit mass; an odd last state decays."""
    half, pushed = n // 2, "".join(f" + _u[{j}]" for j in range(inputs))
    force = [f"{-1.0 - i}*_x[{i}] - 0.3*_x[{half + i}]{pushed}" for i in range(half)]
    rates = [*(f"_x[{half + i}]" for i in range(half)), *force, *[f"-1.0*_x[{n - 1}]"] * (n % 2)]
    parts = [f"def derivative{HEAD}", *(f"    _result[{k}] = {f}" for k, f in enumerate(rates))]
    if half and not n % 2:
        parts += [f"def speeds{HEAD}", *(f"    _result[{i}] = {rates[i]}" for i in range(half))]
        parts += [f"def second_order{HEAD}"]
        for i in range(half):
            row = [*(str(float(i == j)) for j in range(half)), force[i]]
            parts += [f"    _result[{i}, {j}] = {value}" for j, value in enumerate(row)]
    kernels = Kernels(kernel_sources("\n".join(parts)))
    plain = python_system(lambda x, _: 0.0 * x, [0.0] * n, inputs)
    return replace(plain, kernels=kernels)


def steered(inputs: int) -> Maneuver:
    def signal(times, frequency, amplitude):
        del frequency, amplitude
        return np.column_stack([np.sin((j + 1) * times) for j in range(inputs)])

    return Maneuver("m", "", signal, tuple("abc"[:inputs]), 2.0, 21, lambda _: (1.3,))


def two_windows(formulation: str, n: int, rank: int) -> ProjectionWindows:
    """Subspaces of the largest and of the smallest dimension."""
    rng, half = np.random.default_rng(n), n // 2
    rows = half if formulation == "coordinates" else n
    trial = np.zeros((2, 2 * rank if formulation == "coordinates" else rank, n))
    for basis in trial:
        basis[:rank, :rows] = np.linalg.qr(rng.normal(size=(rows, rows)))[0][:rank]
    ranks = np.array([rank, 1]) * (2 if formulation == "coordinates" else 1)
    edges = np.array([0.0, 0.9, 2.0])
    return ProjectionWindows(formulation, edges, np.zeros((2, n)), trial, trial.copy(), ranks)


def guarded(call: Prepared, name: str, dimensions: int, dtype: type) -> np.ndarray:
    """An array of the loop with marks before and behind it, in place of its own."""
    place = call.address(name)
    size = int(np.prod(call.words[place + 1 : place + 1 + dimensions]))
    whole = np.full(size + 2 * GUARD, MARK, dtype=dtype)
    call.words[place] = address_of_array(whole) + GUARD * whole.itemsize
    return whole


def check(system: System, inputs: int, windows: ProjectionWindows, solver: str) -> None:
    space = system.workspace(steered(inputs), windows, Solver(solver, 1e-5))
    space.start[:] = np.linspace(1.0, 2.0, len(system.reference))
    arrays = [
        guarded(space.call, name, dimensions, dtype)
        for name, dimensions, dtype in (
            ("buffer", 1, float),
            ("integers", 1, int),
            ("output.path", 2, float),
        )
    ]
    assert space.call() == 0
    path = arrays[-1][GUARD:-GUARD]
    assert np.isfinite(path).all()
    assert not (path == MARK).any()
    for array in arrays:
        assert (array[:GUARD] == MARK).all()
        assert (array[-GUARD:] == MARK).all()


@pytest.mark.parametrize(("n", "inputs"), [(1, 1), (2, 3), (4, 1), (9, 3), (30, 1)])
@pytest.mark.parametrize("solver", INTEGRATORS)
def test_a_run_of_the_full_system_stays_in_its_space(n, inputs, solver):
    check(oscillators(n, inputs), inputs, whole_space(n), solver)


@pytest.mark.parametrize(("n", "rank", "inputs"), [(2, 1, 1), (4, 1, 3), (4, 2, 1), (30, 15, 3)])
@pytest.mark.parametrize("formulation", ["state", "coordinates"])
@pytest.mark.parametrize("solver", [name for name in INTEGRATORS if not frozen(name)])
def test_a_reduced_run_stays_in_its_space(n, rank, inputs, formulation, solver):
    check(oscillators(n, inputs), inputs, two_windows(formulation, n, rank), solver)


@pytest.mark.parametrize("solver", ["ros34pw2", "etdrk4"])
def test_a_step_of_a_reduced_vehicle_stays_in_its_space(solver):
    features = Features(3, 1, (), ("z0", "z1", "z2", "u0", "z0 * z1 * z2", "1.0"))
    system = feature_system(features, np.zeros(0), -0.1 * np.ones((6, 6)), np.ones(6), np.zeros(3))
    assert system.whole_steps(solver)
    check(system, 1, whole_space(6), solver)
