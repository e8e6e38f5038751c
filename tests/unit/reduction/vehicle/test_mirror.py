"""A vehicle is its own mirror image, in its equations and in what is linear of them."""

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.reduction.vehicle.mirror import mirror
from vehiclemor.reduction.vehicle.shape import VehicleShape

VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


@pytest.fixture(scope="module", params=VEHICLES)
def shape(request):
    return VehicleShape(vm.model(request.param))


def test_the_mirror_image_of_a_vehicle_is_the_vehicle(shape):
    image, linear = mirror(shape), shape.linearised
    np.testing.assert_array_equal(image @ image, np.eye(len(image)))
    np.testing.assert_allclose(image @ linear.a @ image, linear.a, atol=1e-9 * abs(linear.a).max())
    np.testing.assert_allclose(image @ linear.b, -linear.b, atol=1e-9 * abs(linear.b).max())


def test_the_nonlinear_equations_have_the_same_mirror_image(shape):
    random, image = np.random.default_rng(2), mirror(shape)
    deviations = 1e-3 * random.standard_normal((5, len(image)))
    inputs = 1e-2 * random.standard_normal((5, len(shape.model.inputs)))
    rates, motion = shape.motion(shape.reference + deviations, inputs)
    other, mirrored = shape.motion(shape.reference + deviations @ image.T, -inputs)
    np.testing.assert_allclose(other, rates @ image.T, atol=1e-8 * np.abs(rates).max())
    np.testing.assert_allclose(mirrored, motion * [-1.0, 1.0, -1.0], atol=1e-9)
