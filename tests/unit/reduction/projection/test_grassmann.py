"""Interpolation on the Grassmann manifold against what is known of geodesics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.projection.grassmann import along, interpolation_weights, tangent


def basis(seed, n=9, r=3):
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((n, r)))[0]


def span(vectors):
    return vectors @ vectors.T


@given(st.integers(0, 10_000))
def test_the_geodesic_of_a_tangent_ends_where_it_should(seed):
    origin, end = basis(seed), basis(seed + 1)
    found = along(origin, tangent(origin, end))
    np.testing.assert_allclose(span(found), span(end), atol=1e-9)
    np.testing.assert_allclose(found.T @ found, np.eye(3), atol=1e-12)


def test_a_plane_turns_evenly_on_its_way():
    first, third = np.eye(4)[:, :1], np.eye(4)[:, 2:3]
    end = np.cos(1.2) * first + np.sin(1.2) * third
    for share in (0.0, 0.25, 0.5, 1.0):
        found = along(first, share * tangent(first, end))
        turned = np.cos(1.2 * share) * first + np.sin(1.2 * share) * third
        np.testing.assert_allclose(span(found), span(turned), atol=1e-12)


def test_a_subspace_does_not_depend_on_its_basis():
    origin, end, turn = basis(1), basis(2), np.linalg.qr(basis(3, 3, 3))[0]
    direction = tangent(origin, end)
    np.testing.assert_allclose(direction, tangent(origin, end @ turn), atol=1e-10)


# In four dimensions a linear function has 5 coefficients, a quadratic one 15.
@pytest.mark.parametrize(("cars", "degree"), [(4, 0), (9, 1), (14, 1), (15, 2), (40, 2)])
def test_weights_give_back_every_car_and_the_polynomials_that_cars_determine(cars, degree):
    places = np.random.default_rng(4).uniform(-1.0, 1.0, (cars, 4))
    for number, place in enumerate(places):
        weights = interpolation_weights(places, place)
        np.testing.assert_allclose(weights, np.eye(cars)[number], atol=1e-7)
    at = np.full(4, 0.1)
    weights = interpolation_weights(places, at)
    assert weights.sum() == pytest.approx(1.0)
    if degree > 0:
        np.testing.assert_allclose(weights @ places, at, atol=1e-9)
    if degree > 1:
        np.testing.assert_allclose(np.einsum("m,mi,mj", weights, places, places), 0.01, atol=1e-8)
