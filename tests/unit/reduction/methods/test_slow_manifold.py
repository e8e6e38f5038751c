"""Slow manifold: shape, modes, features and their kernels, fits on trajectories."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from vehiclemor.inputs.signal import Signal
from vehiclemor.inputs.steering import lane_change, rack_lane_change, straight_ahead
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.methods import slow_manifold
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.reduction.vehicle.linear_modes import slow_modes
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.build import build
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.scenario import Scenario, start_of, training_run

LANE_CHANGES = {
    "independent_suspension_vehicle": lane_change,
    "high_fidelity_vehicle": rack_lane_change,
}
TRAINED_ON = ((1.0, 0.5), (1.0, -1.0), (1.0, 1.3), (0.75, 1.2), (1.4, -1.2), (1.3, 0.7))


@pytest.fixture(scope="module", params=LANE_CHANGES)
def car(request):
    return build(request.param)


@pytest.fixture(scope="module")
def vehicle():
    return build("independent_suspension_vehicle")


def start_at(speed, name):
    return build("independent_suspension_vehicle", overrides={"initial_speed": speed}).start(name)


def fitted(model, dropped=True, **settings):
    complete = validated(slow_manifold.METHOD, model.kind, settings)
    runs = [TrainingRun(model, lane_change.perturbed(f, a), "equilibrium") for f, a in TRAINED_ON]
    if dropped:
        runs += [
            TrainingRun(model, straight_ahead, start_at(v, "dropped")) for v in (18.0, 19.0, 22.0)
        ]
    return slow_manifold.fit(model, runs, complete)


@pytest.fixture(scope="module")
def reduced(vehicle):
    return fitted(vehicle, steps=1, tolerance=1e-4)


def errors(reduced, maneuver, start="equilibrium"):
    model = reduced.model
    run, full = reduced.simulate(maneuver, start), model.simulate(maneuver, start)
    assert run.status == "ok"
    largest = np.abs(run.outputs - full.outputs).max(axis=0)
    return dict(zip(model.outputs, largest, strict=True))


def test_the_mirror_image_of_a_vehicle_is_the_vehicle(car):
    shape = VehicleShape(car)
    image, linear = shape.mirror, shape.linearised
    np.testing.assert_array_equal(image @ image, np.eye(len(image)))
    np.testing.assert_allclose(image @ linear.a @ image, linear.a, atol=1e-9 * abs(linear.a).max())
    np.testing.assert_allclose(image @ linear.b, -linear.b, atol=1e-9 * abs(linear.b).max())


def test_slow_coordinates_obey_their_linear_equation_where_steering_is_small(car):
    shape = VehicleShape(car)
    modes = slow_modes(shape, 45.0)
    np.testing.assert_allclose(modes.left @ modes.right, np.eye(len(modes.rates)), atol=1e-6)
    run = car.simulate(LANE_CHANGES[car.name].perturbed(1.0, 1e-3))
    found = modes.coordinates(shape.of(run.states) - shape.reference, run.inputs)
    z, speed = found[:, :-1], found[:, -1]
    rate = np.gradient(z, run.times, axis=0)
    linear = z @ modes.rates.T + np.outer(run.inputs[:, 0], modes.input_matrix)
    # Differences over 0.02 s are good to a few per cent of the fastest mode.
    inner = slice(60, 170)
    for j in range(len(modes.rates)):
        size = np.abs(linear[inner, j]).max()
        assert np.abs(rate - linear)[inner, j].max() < 0.05 * size
    assert np.abs(speed).max() < 1e-6


def test_it_is_right_on_inputs_between_those_that_it_has_seen(reduced):
    unseen = lane_change.perturbed(1.1, 0.85)
    found = errors(reduced, unseen)
    # Replay is off by decimetres here; the bounds are those of the study.
    assert found["yaw"] < 3e-4
    assert found["lateral_position"] < 0.05
    linear = replace(reduced, coefficients=_without_curvature(reduced))
    assert errors(linear, unseen)["lateral_position"] > 5.0 * found["lateral_position"]


def _without_curvature(reduced):
    c, (odd, even) = reduced.coefficients.copy(), (block[0] for block in reduced.features.groups)
    # Four lateral coordinates and the steering; 1, the speed and four symmetric coordinates.
    c[list(odd[5:])] = 0.0
    c[list(even[6:])] = 0.0
    return c


def test_a_dropped_car_is_right_at_a_speed_of_no_training_run(vehicle, reduced):
    start = start_at(20.5, "dropped")
    run, full = (model.simulate(straight_ahead, start) for model in (reduced, vehicle))
    bounds = load_protocol("predictive-independent_suspension_vehicle").definition.bounds
    wrong = run.outputs - full.outputs
    for name in ("longitudinal_position", "pitch", "vertical_speed"):
        rms = np.sqrt(np.mean(wrong[:, vehicle.outputs.index(name)] ** 2))
        assert rms < bounds[name].bound


def test_the_fit_weighs_heading_by_the_bound_of_the_paper_unless_it_has_another(vehicle):
    bounds = load_protocol("predictive-independent_suspension_vehicle").definition.bounds
    settings = validated(slow_manifold.METHOD, vehicle.kind, {})
    assert settings.heading_error == pytest.approx(bounds["yaw"].bound, rel=0.01)
    usual, loose = (
        fitted(vehicle, dropped=False, steps=1, **given).coefficients
        for given in ({}, {"heading_error": 1e-3})
    )
    assert not np.array_equal(usual, loose)


@cache
def high_fidelity():
    return build("high_fidelity_vehicle")


def scenario(frequency, amplitude, speed):
    return Scenario(rack_lane_change.perturbed(frequency, amplitude), "equilibrium", speed)


@cache
def with_tires():
    """The other vehicle, whose features have the law of its tires."""
    runs = (1.0, 1.4, 20.0), (0.8, -0.8, 18.5), (1.6, 1.2, 21.5), (0.8, 1.1, 22.0), (1.2, 0.4, 18.0)
    training = [training_run(high_fidelity(), scenario(*run)) for run in runs]
    given = {"terms": 4, "even_terms": 8}
    settings = validated(slow_manifold.METHOD, "dae", given)
    return slow_manifold.fit(high_fidelity(), training, settings)


def of(run, name):
    return run.outputs[:, high_fidelity().outputs.index(name)]


def test_states_in_which_its_tires_slide_are_beyond_its_training():
    case, reduced = scenario(0.75, 1.9, 22.0), with_tires()
    path = reduced.path(case.maneuver, start_of(high_fidelity(), case))
    inputs = case.maneuver.at(case.maneuver.times)
    assert reduced.trust(path[:1], inputs[:1]).indicator < 1.0
    assert reduced.trust(path, inputs).indicator > 1.0
    watched = [what for _, what in reduced.features.watched]
    assert all(any(wheel in what for what in watched) for wheel in WHEELS)


def worst(run, full, name):
    """Largest error of an output as part of its range."""
    return np.abs(of(run, name) - of(full, name)).max() / np.abs(of(full, name)).max()


def test_small_steering_is_exact_however_little_was_learnt():
    steering = rack_lane_change.perturbed(1.0, 0.01)
    full = high_fidelity().simulate(steering)
    run = replace(with_tires(), tolerance=1e-6).simulate(steering, "equilibrium")
    assert worst(run, full, "yaw") < 2e-4
    assert worst(run, full, "yaw_rate") < 2e-4
    assert worst(run, full, "lateral_speed") < 0.02


def test_steering_may_move_already_when_a_run_begins():
    times = np.linspace(0.0, 4.0, 201)
    values = 1e-4 * np.sin(3.0 * times) * np.exp(-2.0 * times)
    steering = Signal.from_samples(times, values, "cubic", inputs=["s"], name="begun")
    full = high_fidelity().simulate(steering)
    run = replace(with_tires(), tolerance=1e-6).simulate(steering, "equilibrium")
    # Fast motion is over: where it has led to is known.
    for name in ("yaw", "lateral_position"):
        off = of(run, name)[-1] - of(full, name)[-1]
        assert abs(off) < 5e-4 * np.abs(of(full, name)).max()
