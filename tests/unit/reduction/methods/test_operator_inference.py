"""Operator inference: operators recovered from data, parity of vehicles, stability."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vehiclemor as vm
from tests.reducing import fitted
from vehiclemor.errors import InputError
from vehiclemor.reduction.methods.operator_inference import operators, reflected
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import polynomial_features
from vehiclemor.reduction.vehicle.mirror import mirror, mirror_basis, term_parity
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.steering_maneuvers import lane_change, straight_ahead

VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


@pytest.fixture(scope="module", params=VEHICLES)
def shape(request):
    return VehicleShape(vm.model(request.param))


def test_operators_of_a_known_quadratic_system_are_recovered():
    random = np.random.default_rng(1)
    features = polynomial_features(3, 1, 2)
    true = 0.3 * random.standard_normal((len(features.terms), 3))
    true[0] = 0.0
    true[1:4] -= np.eye(3)
    times = np.linspace(0.0, 2.0, 21)
    none = np.zeros(0)

    def steering(t):
        return np.sin(3.0 * np.atleast_1d(t))[:, None]

    def rate(t, z):
        return (feature_columns(features, z[None], steering(t), none) @ true)[0]

    z = np.vstack(
        [
            solve_ivp(rate, (0.0, 2.0), start, t_eval=times, rtol=1e-4).y.T
            for start in random.uniform(-1.0, 1.0, (4, 3))
        ]
    )
    u = np.tile(steering(times), (4, 1))
    columns = feature_columns(features, z, u, none)
    found = operators(columns, columns @ true, 0.0)
    np.testing.assert_allclose(found, true, atol=1e-8)
    # Ridge regression shrinks.
    shrunk = operators(columns, columns @ true, 1e-2)
    assert np.linalg.norm(shrunk[1:]) < np.linalg.norm(true)


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


def test_basis_vectors_are_odd_or_even(shape):
    image = mirror(shape)
    data = np.random.default_rng(3).standard_normal((40, len(image)))
    basis = mirror_basis(data, image, 8)
    np.testing.assert_allclose(basis.encoding @ basis.lifting, np.eye(8), atol=1e-12)
    signs = np.where(basis.odd, -1.0, 1.0)
    np.testing.assert_allclose(image @ basis.lifting, basis.lifting * signs, atol=1e-10)
    np.testing.assert_allclose(np.abs(data @ basis.encoding.T).max(axis=0), 1.0)


def test_parity_of_terms_is_that_of_their_values():
    random, odd = np.random.default_rng(4), np.array([True, False, True])
    features = polynomial_features(3, 2, 2)
    z, u = random.standard_normal((1, 3)), random.standard_normal((1, 2))
    values = feature_columns(features, z, u, np.zeros(0))
    mirrored = feature_columns(features, np.where(odd, -z, z), -u, np.zeros(0))
    parity = term_parity(odd, 2, 2)
    np.testing.assert_allclose(mirrored, np.where(parity, -values, values))


def test_growing_eigenvalues_are_reflected():
    a = np.array([[1.0, 5.0, 0.0], [-5.0, 1.0, 0.0], [0.3, 0.0, -2.0]])
    values = np.sort_complex(np.linalg.eigvals(reflected(a)))
    np.testing.assert_allclose(values, [-2.0, -1.0 - 5.0j, -1.0 + 5.0j], atol=1e-12)


@pytest.fixture(scope="module")
def vehicle():
    return vm.model("independent_suspension_vehicle")


@pytest.mark.parametrize("stabilise", ["check", "shift"])
def test_fitted_vehicle_drives_straight_and_tells_its_spectral_abscissa(vehicle, stabilise):
    reduced = fitted(vehicle, lane_change, "operator_inference", stabilise=stabilise, rank=4)
    linear = reduced.coefficients[1:5, :4].T
    assert reduced.spectral_abscissa == pytest.approx(
        np.linalg.eigvals(linear).real.max(), abs=1e-6
    )
    if stabilise == "shift":
        assert reduced.spectral_abscissa <= 1e-9
    trajectory = reduced.simulate(straight_ahead, vehicle.starts[0])
    lateral = trajectory.outputs[:, vehicle.outputs.index("lateral_position")]
    assert np.abs(lateral).max() < 1e-10


def test_wrong_settings_are_refused(vehicle):
    with pytest.raises(InputError, match="the shape has 21 states"):
        fitted(vehicle, lane_change, "operator_inference", rank=22)
    with pytest.raises(InputError, match="allowed: 1, 2"):
        fitted(vehicle, lane_change, "operator_inference", degree=3)
