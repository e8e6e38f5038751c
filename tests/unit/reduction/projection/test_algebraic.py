"""Reduced equations against NumPy: order and signs of equations, signs of coordinates, restarts."""

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.projection import reduced_path
from tests.reducing import fitted
from vehiclemor.reduction.projection.bases import Basis, pod_basis

# The paper's two control periods on 1001 samples.
WINDOWS = (range(500), range(500, 1001))


def subspaces(reduced):
    return [(basis.mean, basis.vectors) for basis in reduced.bases]


def signed_permutation(rng):
    return rng.choice([-1.0, 1.0], 8)[:, None] * np.eye(8)[rng.permutation(8)]


def by_numpy(model, reduced, inputs, equations, **settings):
    """Path on the same subspaces, with the equations put in another order and with other signs."""
    path, _ = reduced_path(
        lambda q, u: equations @ model.residual(q, u),
        lambda q, u: equations @ model.jacobian(q, u),
        subspaces(reduced),
        WINDOWS,
        inputs,
        model.design,
        **settings,
    )
    return path


@pytest.fixture(scope="module")
def least_squares(model, nominal):
    return fitted(model, nominal, "pod", rank=3)


def test_least_squares_ignores_order_and_signs_of_the_equations(
    model, nominal, full, least_squares, rng
):
    found = least_squares.simulate(nominal, model.starts[0]).coordinates
    for equations in (np.eye(8), signed_permutation(rng)):
        other = by_numpy(model, least_squares, full.inputs, equations)
        np.testing.assert_allclose(found, other, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_equation_seed_permutes_and_signs_the_equations(model, nominal, full, seed):
    settings = {"test_space": "galerkin", "equation_seed": seed}
    whole = fitted(model, nominal, "pod", rank=8, rank_tolerance=0.0, **settings)
    # W = D^T U with an orthogonal U: D = U W^T must be a signed permutation.
    equations = whole.bases[0].vectors @ whole.tests[0].T
    np.testing.assert_allclose(np.abs(equations).sum(axis=0), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(equations).max(axis=1), 1.0, rtol=0, atol=1e-12)
    assert np.abs(equations - np.eye(8)).max() > 0.5

    reduced = fitted(model, nominal, "pod", rank=3, **settings)
    run = reduced.simulate(nominal, model.starts[0])
    other = by_numpy(model, reduced, full.inputs, np.round(equations), galerkin=True)
    assert run.status == "ok"
    np.testing.assert_allclose(run.coordinates, other, rtol=0, atol=1e-10)


def test_reversed_coordinates_equal_a_model_in_these_coordinates(model, nominal, full):
    names = ("theta_u", "theta_l")
    signs = np.diag([-1.0 if name in names else 1.0 for name in model.coordinates])
    reduced = fitted(
        model, nominal, "pod", rank=3, test_space="galerkin", reversed_coordinates=",".join(names)
    )
    run = reduced.simulate(nominal, model.starts[0])

    # The same model in coordinates p = S q: other snapshots and bases, U^T Phi(S p) = 0.
    bases = []
    for begin in (0.0, 5.0):
        snapshots = model.simulate(nominal, times=np.linspace(begin, begin + 5.0, 10)).coordinates
        bases.append(pod_basis(signs @ snapshots.T, 3))
    path, _ = reduced_path(
        lambda p, u: model.residual(signs @ p, u),
        lambda p, u: model.jacobian(signs @ p, u) @ signs,
        [(basis.mean, basis.vectors) for basis in bases],
        WINDOWS,
        full.inputs,
        signs @ model.design,
        galerkin=True,
    )
    np.testing.assert_allclose(run.coordinates, path @ signs, rtol=0, atol=1e-11)


def test_each_window_starts_at_the_projection_of_the_last_sample(
    model, nominal, full, least_squares
):
    # With a coarse tolerance every sample gets one iteration, and the start decides the result.
    coarse = replace(least_squares, tolerance=1.0).simulate(nominal, model.starts[0])
    assert set(coarse.counts.values()) == {1001}
    other = by_numpy(model, least_squares, full.inputs, np.eye(8), tolerance=1.0)
    np.testing.assert_allclose(coarse.coordinates, other, rtol=0, atol=1e-12)
    converged = least_squares.simulate(nominal, model.starts[0]).coordinates
    assert np.abs(coarse.coordinates - converged).max() > 1e-9


def test_rounding_seed_changes_only_directions_that_rounding_chooses(model, nominal):
    def span(**settings):
        basis: Basis = fitted(model, nominal, "pod", rank_tolerance=0.0, **settings).bases[0]
        return basis.vectors @ basis.vectors.T

    assert np.abs(span(rank=4, rounding_seed=1) - span(rank=4)).max() < 1e-9
    assert np.abs(span(rank=6, rounding_seed=1) - span(rank=6)).max() > 1e-2
