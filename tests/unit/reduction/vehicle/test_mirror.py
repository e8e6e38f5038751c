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
