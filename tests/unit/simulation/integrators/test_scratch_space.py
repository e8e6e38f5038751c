"""No integrator or formulation writes beyond the scratch space that is reserved for it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.kernels import kernel
from tests.unit.python_system import python_system
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Prepared, address_of_array
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.vehicle.features import FeatureListing, feature_system
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS, frozen
from vehiclemor.simulation.system import System
from vehiclemor.simulation.workspaces import Solver

GUARD, MARK = 64, 12345
# Spaces of an integrator and of a formulation are apart: each of either is seen once.
REDUCED = [(solver, "state") for solver in INTEGRATORS if not frozen(solver)]
REDUCED += [("dopri5", "coordinates")]


def oscillators(n: int, inputs: int) -> System:
    """n / 2 driven oscillators of unit mass; an odd last state decays."""
    half = n // 2

    def forces(x, u):
        pushed = sum(u[j] for j in range(inputs))
        return [(-1.0 - i) * x[i] - 0.3 * x[half + i] + pushed for i in range(half)]

    def derivative(x, u, constants, result):
        rates = [*(x[half + i] for i in range(half)), *forces(x, u), *[-1.0 * x[n - 1]] * (n % 2)]
        for place, rate in enumerate(rates):
            result[place] = rate

    def speeds(x, u, constants, result):
        for i in range(half):
            result[i] = x[half + i]

    def second_order(x, u, constants, result):
        for i, force in enumerate(forces(x, u)):
            for j, value in enumerate([*np.eye(half)[i], force]):
                result[i, j] = value

    made = [kernel(derivative)]
    if half and not n % 2:
        made += [kernel(speeds), kernel(second_order, columns=half + 1)]
    plain = python_system(lambda x, _: 0.0 * x, [0.0] * n, inputs)
    return replace(plain, kernels=Kernels(made))


def steered(inputs: int) -> Maneuver:
    def signal(times, frequency, amplitude):
        del frequency, amplitude
        return np.column_stack([np.sin((j + 1) * times) for j in range(inputs)])

    return Maneuver("m", "", signal, tuple("abc"[:inputs]), 2.0, 21, lambda _: (1.3,))


def two_windows(formulation: str, n: int, rank: int) -> ControlPeriods:
    """Subspaces of the largest and of the smallest dimension."""
    rng, half = np.random.default_rng(n), n // 2
    rows = half if formulation == "coordinates" else n
    trial = np.zeros((2, 2 * rank if formulation == "coordinates" else rank, n))
    for basis in trial:
        basis[:rank, :rows] = np.linalg.qr(rng.normal(size=(rows, rows)))[0][:rank]
    ranks = np.array([rank, 1]) * (2 if formulation == "coordinates" else 1)
    edges = np.array([0.0, 0.9, 2.0])
    return ControlPeriods(formulation, edges, np.zeros((2, n)), trial, trial.copy(), ranks)


def guarded(call: Prepared, name: str, dimensions: int, dtype: type) -> np.ndarray:
    """An array of the loop with marks before and behind it, in place of its own."""
    place = call.address(name)
    size = int(np.prod(call.words[place + 1 : place + 1 + dimensions]))
    whole = np.full(size + 2 * GUARD, MARK, dtype=dtype)
    call.words[place] = address_of_array(whole) + GUARD * whole.itemsize
    return whole


def check(system: System, inputs: int, windows: ControlPeriods, solver: str) -> None:
    space = system.workspace(steered(inputs), windows, Solver(solver, 1e-5))
    space.memory.start[:] = np.linspace(1.0, 2.0, len(system.reference))
    kinds = ("memory.buffer", 1, float), ("memory.integers", 1, int), ("output.states", 2, float)
    arrays = [guarded(space.call, *kind) for kind in kinds]
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
@pytest.mark.parametrize(("solver", "formulation"), REDUCED)
def test_a_reduced_run_stays_in_its_space(n, rank, inputs, formulation, solver):
    check(oscillators(n, inputs), inputs, two_windows(formulation, n, rank), solver)


def test_a_step_of_a_reduced_vehicle_stays_in_its_space():
    listing = FeatureListing(3, 1)
    z, alone = listing.z, (*listing.z, *listing.u, listing.number(1.0))
    terms, everything = [*((value,) for value in alone), tuple(z)], (range(6), range(6))
    features = listing.features(terms, (everything,))
    arrays = np.zeros(0), -0.1 * np.ones((6, 6)), np.ones(6), np.zeros(1)
    check(feature_system(features, *arrays), 1, whole_space(6), "etdrk4")
