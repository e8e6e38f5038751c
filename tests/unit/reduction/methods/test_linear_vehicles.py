"""Linear methods for vehicles: right where the vehicle is linear, and no better than promised."""

from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from tests.oracles import vehicle_lagrange
from tests.reducing import fitted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.steering import (
    lane_change,
    rack_lane_change,
    rack_straight_ahead,
    straight_ahead,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape

VEHICLES = {
    "independent_suspension_vehicle": (lane_change, straight_ahead),
    "high_fidelity_vehicle": (rack_lane_change, rack_straight_ahead),
}
EVERY_MODE, FOUR = {"fastest": 1e4}, {"fastest": 45.0}
EXACT = {"solver": "dopri5", "tolerance": 1e-9}


@pytest.fixture(scope="module", params=VEHICLES)
def shape(request):
    return VehicleShape(vm.model(request.param))


@cache
def small_lane_change(name, amplitude):
    return VEHICLES[name][0].perturbed(1.0, amplitude)


@cache
def full_order_outputs(model, maneuver):
    return model.simulate(maneuver, model.starts[0], tolerance=1e-9).outputs


def relative_errors(shape, method, amplitude, **settings):
    """Relative RMS errors of yaw rate and lateral position in a small lane change."""
    model = shape.model
    maneuver = small_lane_change(model.name, amplitude)
    true = full_order_outputs(model, maneuver)
    reduced = fitted(model, maneuver, method, **EXACT, **settings)
    error = reduced.simulate(maneuver, model.starts[0]).outputs - true
    columns = [model.outputs.index(name) for name in ("yaw_rate", "lateral_position")]
    return np.linalg.norm(error[:, columns], axis=0) / np.linalg.norm(true[:, columns], axis=0)


def steady_turn(shape):
    """Yaw rate per steering of the whole linearised model; the speed's zero eigenvalue is cut."""
    linear = shape.linearised
    return linear.velocity_a[0] @ -np.linalg.lstsq(linear.a, linear.b[:, 0], rcond=1e-10)[0]


def test_all_lateral_modes_give_the_vehicle_at_small_amplitude(shape):
    errors = relative_errors(shape, "modal_truncation", 0.01, **EVERY_MODE)
    assert (errors < 1e-3).all()
    # What is left is the vehicle's nonlinearity: the tires' least power beyond the linear term.
    smaller = relative_errors(shape, "modal_truncation", 0.001, **EVERY_MODE)
    assert (smaller < np.maximum(0.5 * errors, 1e-4)).all()
    # Four states are worse than all and still near.
    few = relative_errors(shape, "modal_truncation", 0.001, **FOUR)
    assert few[0] > smaller[0]
    assert (few < 0.02).all()


def test_single_track_lacks_roll_but_not_the_lane_change(shape):
    yaw_rate, lateral_position = relative_errors(shape, "linear_single_track", 0.01)
    assert yaw_rate < 0.1
    assert lateral_position < 0.01


def single_track(model, speed):
    """Jacobians by lateral speed and yaw rate, and by the steering, at a speed in m/s."""
    rom = vm.reduce(model, "linear_single_track", training="nominal")
    at, no_input = rom.state(model.start()), np.zeros(len(model.inputs))
    at[2] += speed - model.parameters["initial_speed"]
    return rom.jacobian(at, no_input)[:2, :2], rom.jacobian(at, no_input, "inputs")[:2, 0]


def test_single_track_corners_as_the_linearised_vehicle(shape):
    turn = -np.linalg.solve(*single_track(shape.model, shape.speed))[1]
    assert turn == pytest.approx(steady_turn(shape), rel=1e-6)
    if shape.model.name == CAR:
        assert turn == pytest.approx(vehicle_lagrange.single_track_yaw_gain(), rel=1e-6)


@pytest.mark.parametrize(
    ("method", "settings"), [("linear_single_track", {}), ("modal_truncation", EVERY_MODE)]
)
def test_without_steering_the_car_drives_straight_at_its_own_speed(shape, method, settings):
    model = vm.model(shape.model.name)
    maneuver, still = VEHICLES[model.name][1], np.zeros(len(model.inputs))
    start = vm.model(model.name, {"initial_speed": 22.0}).start(model.starts[0])
    reduced = fitted(model, maneuver, method, **settings)
    trajectory = reduced.simulate(maneuver, start)
    outputs = dict(zip(model.outputs, trajectory.outputs.T, strict=True))
    assert np.abs(outputs["lateral_position"]).max() < 1e-8
    assert outputs["longitudinal_position"][-1] == pytest.approx(22.0 * trajectory.times[-1])
    # Nothing grows, and the speed stays as it is.
    straight = reduced.begin(model.starts[0], still)
    rates = reduced.sensitivities(straight, still, 0.0, "state", "rhs")
    assert np.linalg.eigvals(rates).real.max() == pytest.approx(0.0, abs=1e-6)
    assert reduced.offline.evaluations == 2 * (len(shape.indices) + len(model.inputs))


def test_too_few_states_are_refused(shape):
    maneuver = VEHICLES[shape.model.name][0]
    with pytest.raises(InputError, match="no mode that steering moves"):
        fitted(shape.model, maneuver, "modal_truncation", fastest=1.0)
