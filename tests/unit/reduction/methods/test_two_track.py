"""The two-track model: its tires are the vehicle's, it is its own mirror image, and it warns."""

from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.methods import two_track
from vehiclemor.reduction.methods.two_track import mirror
from vehiclemor.reduction.validation import validated
from vehiclemor.reduction.vehicle import tire_features as tf
from vehiclemor.reduction.vehicle.features import feature_columns
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.study.scenario import Scenario, start_of, training_run

LANE_CHANGE = component("maneuver", "rack_lane_change")
RUNS = ((1.0, 1.4, 20.0), (0.8, -0.8, 18.5), (1.6, 1.2, 21.5), (0.8, 1.1, 22.0), (1.2, 0.4, 18.0))


@cache
def vehicle():
    return build("high_fidelity_vehicle")


def scenario(frequency, amplitude, speed, start="equilibrium"):
    return Scenario(LANE_CHANGE.perturbed(frequency, amplitude), start, speed)


@cache
def reduced():
    training = tuple(training_run(vehicle(), scenario(*run)) for run in RUNS)
    given = {"terms": 8, "even_terms": 12, "wheel_terms": 6, "sweeps": 4}
    settings = validated(two_track.METHOD, "dae", given)
    return two_track.fit(vehicle(), training, settings)


def simulated(*run):
    case = scenario(*run)
    return reduced().simulate(case.maneuver, start_of(vehicle(), case))


def of(run, name):
    return run.outputs[:, vehicle().outputs.index(name)]


def test_the_tires_are_those_of_the_vehicle():
    case = scenario(0.9, 1.4, 20.5)
    run = vehicle().simulate(case.maneuver, start_of(vehicle(), case))
    parameters = {name: float(vehicle().parameters[name]) for name in FIALA}
    for wheel in WHEELS:
        made = tf.TireFeatures(0)
        force, moment, _ = tf.fiala(made, wheel, *made.z[:2], tf.Tire(parameters, 1000.0, 1.3))
        features = made.of(made.alone((1000.0 * force, 1000.0 * moment)))
        slips = np.column_stack([np.tan(of(run, f"slip_angle_{wheel}")), of(run, f"Fz_{wheel}")])
        z = np.hstack([slips, np.zeros((len(slips), 3))])
        columns = feature_columns(features, z, np.zeros((len(z), 0)), np.array(made.parameters))
        moment = parameters["tire_width"] * columns[:, 1]
        for given, name in ((columns[:, 0], "Fy"), (moment, "Mz")):
            truth = of(run, f"{name}_{wheel}")
            # What is left is the longitudinal slip of the free rolling wheel.
            assert np.abs(given - truth).max() < 1e-3 * np.abs(truth).max()


def test_steering_to_the_other_side_gives_the_mirror_image():
    left, right = simulated(1.1, 1.2, 21.0), simulated(1.1, -1.2, 21.0)
    for name, sign in (("lateral_position", -1), ("yaw", -1), ("roll", -1), ("pitch", 1)):
        np.testing.assert_allclose(of(left, name), sign * of(right, name), atol=1e-8)


@pytest.mark.parametrize("speed", [17.0, 23.0])
def test_without_steering_it_goes_straight_on_at_its_speed(speed):
    run = simulated(1.0, 0.0, speed)
    assert np.abs(of(run, "lateral_position")).max() < 1e-6
    np.testing.assert_allclose(of(run, "longitudinal_position"), speed * run.time, rtol=1e-5)


def test_it_predicts_a_run_that_it_has_not_seen():
    case = scenario(1.1, -1.0, 20.5)
    truth = vehicle().simulate(case.maneuver, start_of(vehicle(), case))
    run = simulated(1.1, -1.0, 20.5)
    assert run.status == "ok"
    assert run.trust.indicator < 1.0
    assert np.abs(of(run, "lateral_position") - of(truth, "lateral_position")).max() < 0.1
    assert np.abs(of(run, "longitudinal_position") - of(truth, "longitudinal_position")).max() < 0.1


def test_it_tells_when_its_tires_slide():
    run = simulated(0.75, 1.9, 22.0)
    assert run.status != "ok"
    assert run.trust.indicator > 1.0
    assert 1.0 < run.trust.until < run.time[-1]


def test_a_vehicle_with_other_tires_is_refused():
    reason = two_track.refusal(build("independent_suspension_vehicle"))
    assert "cornering_stiffness" in reason


VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


@pytest.fixture(scope="module", params=VEHICLES)
def shape(request):
    return VehicleShape(vm.model(request.param))


def test_the_mirror_image_of_a_vehicle_is_the_vehicle(shape):
    image, linear = mirror(shape), shape.linearised
    np.testing.assert_array_equal(image @ image, np.eye(len(image)))
    np.testing.assert_allclose(image @ linear.a @ image, linear.a, atol=1e-9 * abs(linear.a).max())
    np.testing.assert_allclose(image @ linear.b, -linear.b, atol=1e-9 * abs(linear.b).max())
