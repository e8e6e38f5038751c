"""Balanced truncation and Krylov vectors of structures, in the frequency domain and in time."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

import vehiclemor as vm
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.methods.craig_bampton import METHOD as CRAIG_BAMPTON
from vehiclemor.reduction.methods.krylov import METHOD as KRYLOV
from vehiclemor.reduction.methods.krylov import krylov_vectors
from vehiclemor.reduction.methods.linearised import BALANCED_TRUNCATION
from vehiclemor.reduction.projection.structural import modes_within, port_rates, projected


@pytest.fixture(scope="module")
def truck():
    return vm.model("flexible_truck", {"elements_per_bay": 1.0})


def fitted(method, model, **values):
    method.check(model, settings := method.settings["structural"](**values))
    return method.fit(model, None, settings)


def response(model, structure, frequency):
    """Deflections of the ports to forces at them, linearised."""
    s, (stiffness, rates) = 2j * np.pi * frequency, port_rates(model)
    sparse = structure.stiffness, structure.mass, structure.ports, structure.dampers
    k, m, b, w = (x.toarray() for x in sparse)
    damping = structure.damping_time * k + w @ w.T + (b * rates) @ b.T
    return b.T @ np.linalg.solve(s**2 * m + s * damping + k + (b * stiffness) @ b.T, b)


def response_error(model, reduced):
    full, small = model.system.structure, projected(model.system.structure, reduced.basis)
    exact, found = ([response(model, x, f) for f in (0.5, 2, 8, 20, 50)] for x in (full, small))
    return max(np.linalg.norm(a - b) / np.linalg.norm(a) for a, b in zip(exact, found, strict=True))


def test_balanced_truncation_has_smaller_errors_than_craig_bampton_of_equal_rank(truck):
    others = fitted(CRAIG_BAMPTON, truck, highest=60.0)
    ranks = 25, others.order
    errors = [response_error(truck, fitted(BALANCED_TRUNCATION, truck, rank=r)) for r in ranks]
    assert errors[1] < min(0.1 * errors[0], 0.5 * response_error(truck, others))


@pytest.mark.parametrize("method", [BALANCED_TRUNCATION, KRYLOV])
def test_reduced_trucks_ride_as_the_full_one(truck, method):
    road = vm.road("C", 7, 22.0)
    full, run = truck.run(road), fitted(method, truck).simulate(road, "equilibrium")
    error = np.sqrt(np.mean((run.outputs - full.outputs)[:, :5] ** 2, axis=0))
    assert (error < 0.01 * full.outputs[:, :5].std(axis=0)).all()


def test_krylov_vectors_match_twice_as_many_moments_as_blocks(truck):
    vectors = krylov_vectors(truck, 20.0, 2)
    assert np.allclose(vectors.T @ vectors, np.eye(vectors.shape[1]), atol=1e-12)
    moments = []
    structure = truck.system.structure
    for s in (structure, projected(structure, modes_within(structure, vectors))):
        m, b = s.mass.toarray(), s.ports.toarray()
        solved = np.linalg.inv((s.stiffness + (40.0 * np.pi) ** 2 * s.mass).toarray())
        moments.append([b.T @ solved @ np.linalg.matrix_power(m @ solved, k) @ b for k in range(5)])
    agree = [abs(a - b).max() < 1e-9 * abs(a).max() for a, b in zip(*moments, strict=True)]
    assert agree == [True] * 4 + [False]


def test_motions_without_mass_are_for_krylov_alone():
    mass, stiffness = diags_array([1.0, 2.0, 0.0], format="csc"), csc_array(np.eye(3) + 1.0)
    b, w = csc_array([[1.0], [0.0], [0.0]]), csc_array((3, 0))
    structure = SimpleNamespace(mass=mass, stiffness=stiffness, ports=b, dampers=w)
    model = SimpleNamespace(
        kind="structural", name="plate", size=3, system=SimpleNamespace(structure=structure)
    )
    assert krylov_vectors(model, 1.0, 9).shape == (3, 2)
    with pytest.raises(InputError, match="plate has motions without mass"):
        BALANCED_TRUNCATION.check(model, BALANCED_TRUNCATION.settings["structural"](rank=2))


def test_what_does_not_fit_is_refused(truck, monkeypatch):
    with pytest.raises(InputError, match=r"n = 559; balanced_truncation .* up to 499"):
        fitted(BALANCED_TRUNCATION, vm.model("flexible_truck", {"elements_per_bay": 3}))
    with pytest.raises(InputError, match=f"flexible_truck allows at most {truck.size - 1}"):
        fitted(BALANCED_TRUNCATION, truck, rank=truck.size)
    with pytest.raises(InputError, match="moments is 3; it allows at most 2"):
        KRYLOV.check(
            SimpleNamespace(kind="structural", name="it", size=3),
            KRYLOV.settings["structural"](moments=3),
        )
    monkeypatch.setitem(sys.modules, "pymor.models.iosys", None)
    with pytest.raises(InputError, match=r'pip install "vehiclemor\[contenders\]"'):
        fitted(BALANCED_TRUNCATION, truck)
