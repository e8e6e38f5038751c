"""General learners: what they fit is what their libraries found, and linear models are learned."""

import sys
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import CAR
from tests.reducing import training_runs
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.steering import lane_change
from vehiclemor.reduction.learned_model import TrainingData, stepped
from vehiclemor.reduction.methods.learners import RIDGES
from vehiclemor.reduction.methods.single_track import BODY, TIRES, driven, fitted_constants, rates
from vehiclemor.reduction.methods.trajectory_network import in_lanes
from vehiclemor.reduction.vehicle.linear_modes import slow_modes
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import FINISHED

LINEAR = {
    "operator_inference": {"form": "linear"},
    "sparse_identification": {"degree": 1, "threshold": 0.0, "ridge": 0.0},
    "dynamic_mode_decomposition": {"ridge": 1e-14},
}

STEPPED = {
    "operator_inference": {"rank": 3, "form": "bilinear"},
    "sparse_identification": {"rank": 3, "degree": 2},
    "dynamic_mode_decomposition": {"rank": 3, "degree": 2},
    "gaussian_process": {"rank": 3, "samples": 50},
    "neural_network": {"rank": 3, "width": 4, "epochs": 5},
    "trajectory_network": {"rank": 3, "width": 4, "epochs": 2},
    "single_track": {"iterations": 1},
}


def learned(name, model, runs, **settings):
    """What a method fits to runs, and what it has seen."""
    method = component("method", name)
    chosen = method.settings[model.kind](**settings)
    return method.fit(model, runs, chosen), TrainingData.of(model, runs, chosen)


@pytest.fixture(scope="module")
def car():
    return build(CAR)


@pytest.fixture(scope="module")
def runs(car):
    return training_runs(car, lane_change, "set", ((1.0, 1.0), (1.3, -0.8)))


@pytest.mark.usefixtures("plug_in_package")
@pytest.mark.parametrize("name", LINEAR)
def test_a_linear_model_is_learned_and_predicts_another_road(name):
    model = vm.model("quarter_car")
    roads = [vm.maneuver("quarter_car_road", frequency=f) for f in (1.0, 2.3)]
    settings = {"rank": 4, "steps": 4, "skipped": 0.0} | LINEAR[name]
    reduced = vm.reduce(model, name, training=roads, **settings)
    unseen = vm.maneuver("quarter_car_road", frequency=1.6, amplitude=-0.9)
    for start in ("equilibrium", "dropped"):
        run, full = reduced.simulate(unseen, start), model.simulate(unseen, start)
        # It may swing further than in training.
        assert run.status in FINISHED
        error = np.abs(run.outputs - full.outputs).max(axis=0) / np.ptp(full.outputs, axis=0)
        # Inputs between two samples are known as a line alone.
        assert error.max() < 1e-2


def test_operators_are_those_that_repeat_the_training_best(car, runs):
    """The path is that of opinf's own `predict`, for the ridge of the least error."""
    import opinf

    reduced, data = learned("operator_inference", car, runs, rank=3, form="quadratic")
    before, after = [z[:-1] for z in data.paths], [z[1:] for z in data.paths]
    now, inputs, following = (np.concatenate(part).T for part in (before, data.inputs, after))
    best, least = None, np.inf
    for ridge in RIDGES:
        step = opinf.models.DiscreteModel("AHBN", solver=opinf.lstsq.L2Solver(ridge))
        step.fit(now, following, inputs)
        runs_of_it = zip(data.paths, data.inputs, strict=True)
        with np.errstate(all="ignore"):
            paths = [step.predict(z[0], len(z), u.T).T for z, u in runs_of_it]
            pairs = zip(paths, data.paths, strict=True)
            error = sum(np.linalg.norm(path - z) / np.linalg.norm(z) for path, z in pairs)
        if error < least:
            best, least = paths[0], error
    found = reduced.path(data.paths[0][:1], data.inputs[0][:, None])[:, 0]
    np.testing.assert_allclose(found, best, atol=1e-9)


def test_monomials_are_stepped_and_begin_as_those_of_the_start(car, runs):
    settings = {"rank": 3, "degree": 2, "ridge": 1e-14}
    reduced, data = learned("dynamic_mode_decomposition", car, runs, **settings)
    now, inputs, following = data.steps
    products = [now[:, i] * now[:, j] for i in range(3) for j in range(i, 3)]
    lifted = np.column_stack([now, *products, inputs])
    expected = lifted @ np.linalg.lstsq(lifted, following, rcond=None)[0]
    found = reduced.path(now[::90], inputs[None, ::90])[1]
    np.testing.assert_allclose(found, expected[::90], atol=1e-5)


def test_slow_coordinates_are_those_of_the_slow_manifold(car, runs):
    reduced, data = learned("operator_inference", car, runs, coordinates="slow", readout=3)
    modes = slow_modes(VehicleShape(car), 45.0, 2)
    own = data.samples.runs[0]
    slow, found = modes.coordinates(own.deviations, own.inputs), data.paths[0]
    np.testing.assert_allclose(found * np.ptp(slow, 0), slow * np.ptp(found, 0), atol=1e-9)
    # Fast motion follows the slow one, so that its states can be read.
    read = reduced.readout.predict(np.hstack([found, own.inputs / data.input_scale]))
    assert (np.abs(read - own.values).max(axis=0) < 0.02 * np.ptp(own.values, axis=0)).all()
    with pytest.raises(InputError, match="only vehicles that steer have slow coordinates"):
        vm.reduce("flexible_truck", "neural_network", training="road:1", coordinates="slow")


def test_a_learned_car_drives_straight_on_and_turns_with_its_heading(car, runs):
    reduced, _ = learned("operator_inference", car, runs, rank=4, form="linear")
    straight = reduced.simulate(vm.maneuver("straight_ahead"), "equilibrium")
    distance = straight["longitudinal_position"][-1]
    assert abs(straight["lateral_position"]).max() < 1e-9
    assert distance == pytest.approx(reduced.shape.speed * straight.times[-1], rel=1e-9)
    turned, (x, y, heading) = car.start("equilibrium").copy(), car.planar
    for a, b in zip(car.rotating[1::2], car.rotating[2::2], strict=True):
        turned[b], turned[a] = turned[a], -turned[b]
    turned[[heading, x, y]] = 0.5 * np.pi, 3.0, -2.0
    one, other = (reduced.simulate(lane_change, start) for start in ("equilibrium", turned))
    ahead, aside = one["longitudinal_position"], one["lateral_position"]
    np.testing.assert_allclose(other["lateral_position"] + 2.0, ahead, atol=1e-6)
    np.testing.assert_allclose(3.0 - other["longitudinal_position"], aside, atol=1e-6)


def test_a_single_track_finds_the_constants_of_its_own_runs():
    step, speed, first = 0.02, 20.0, np.array([1.0, *TIRES, *BODY])
    true = first * np.random.default_rng(1).uniform(0.9, 1.1, len(first)) + 1e-2
    # Runs of several lengths, of which the tires saturate.
    times = [step * np.arange(count + 1) for count in (200, 150, 250)]
    steer = [0.05 * a * np.sin(a * t) for a, t in zip((1.0, 1.6, 2.2), times, strict=True)]
    inputs = [np.column_stack([s[:-1], s[1:]]) for s in steer]
    thrice = [np.column_stack([s[:-1], 0.5 * (s[:-1] + s[1:]), s[1:]]) for s in steer]
    paths = [driven(partial(rates, true, speed), np.zeros(5), u, step)[:, :5] for u in thrice]
    spacing = SimpleNamespace(spacing=step)
    data: Any = SimpleNamespace(samples=spacing, inputs=inputs, input_scale=[1.0], paths=paths)
    found = fitted_constants(data, first, speed, 30)
    again = driven(partial(rates, found, speed), np.zeros(5), thrice[2], step)[:, :5]
    size = np.abs(paths[2]).max(axis=0)
    np.testing.assert_allclose(again / size, paths[2] / size, atol=1e-3)
    # The mirror image of steering drives the mirror image.
    mirrored = driven(partial(rates, found, speed), np.zeros(5), -thrice[2], step)[:, :5]
    np.testing.assert_allclose(mirrored * [-1, -1, -1, -1, 1], again, atol=1e-9)


def test_a_fitted_single_track_is_nearer_than_the_linear_one(car, runs):
    method = component("method", "single_track")
    more = training_runs(car, lane_change, "set", ((0.8, 1.2), (1.1, -1.6)))
    fitted = method.fit(car, [*runs, *more], method.settings["ode"](iterations=12))
    unseen, linear = lane_change.perturbed(0.9, 1.4), vm.reduce(car, "linear_single_track")
    full = car.simulate(unseen)["lateral_position"]
    both = fitted.simulate(unseen, "equilibrium"), linear.simulate(unseen)
    near, far = (np.abs(run["lateral_position"] - full).max() for run in both)
    assert near < 0.8 * far


def test_a_diverged_run_is_recorded_up_to_where_it_left(car, runs):
    reduced, _ = learned("operator_inference", car, runs, rank=4, form="linear")
    grown = replace(reduced, path=stepped(lambda z, _: 1.1 * z + 1e-3))
    run = grown.simulate(lane_change, "dropped")
    assert run.status == "diverged"
    assert "have diverged at t = " in run.message
    assert np.isnan(run.outputs[-1]).all()
    # Another that goes on beside it does so.
    path = stepped(lambda z, _: 2.0 * z)(np.array([[1.0], [1e-9]]), np.zeros((20, 2, 1)))
    np.testing.assert_allclose(path[:, 1, 0], 1e-9 * 2.0 ** np.arange(21))
    assert np.isfinite(path[:, 0]).sum() == 10


@pytest.mark.parametrize("name", STEPPED)
def test_runs_in_step_are_those_of_one_after_the_other(car, runs, name):
    if name == "trajectory_network":
        pytest.importorskip("jax_sysid")
    method = component("method", name)
    reduced = method.fit(car, runs, method.settings[car.kind](**STEPPED[name]))
    maneuvers = lane_change, vm.maneuver("sine_sweep"), lane_change.perturbed(0.7, 4.0)
    tests = [(car, maneuver, start) for maneuver in maneuvers for start in car.starts[:2]]
    together = reduced.in_step(tests)

    def refused(*_):
        raise AssertionError("it is marched again")

    for _, maneuver, start in tests:
        # More output times leave the steps as they are.
        alone = reduced.simulate(maneuver.subdivided(2), start)
        run = replace(together, path=refused).simulate(maneuver.subdivided(2), start)
        assert run.message == alone.message
        np.testing.assert_allclose(run.outputs, alone.outputs, rtol=1e-6, atol=1e-9)
    assert not reduced.known


def test_reduced_lateral_dynamics_answer_slow_steering_as_all_modes_do(car):
    few = vm.reduce(car, "balanced_truncation", rank=4)
    all_modes = vm.reduce(car, "modal_truncation")
    slow = vm.maneuver("lane_change", frequency=0.5, amplitude=0.05)
    one, other = (reduced.simulate(slow)["yaw"] for reduced in (few, all_modes))
    assert np.abs(one - other).max() < 0.02 * np.ptp(other)
    with pytest.raises(InputError, match=r"rank is 90; .* allows at most"):
        vm.reduce(car, "balanced_truncation", rank=90)


def test_a_car_is_judged_by_its_error_not_by_the_states_of_training():
    reduced = vm.reduce(CAR, "operator_inference", training="lane_change", rank=4, form="linear")
    wider = vm.maneuver("lane_change", amplitude=1.3)
    message = reduced.simulate(wider).message
    assert message.startswith("the estimated error of longitudinal_position is ")
    assert reduced.simulate(wider, bounds={"yaw": 10.0}).status == "ok"


def test_a_truck_beyond_the_states_or_the_payload_of_training_is_not_trusted():
    truck = vm.model("flexible_truck")
    reduced = vm.reduce(truck, "dynamic_mode_decomposition", training="road:1", rank=10)
    own, empty = reduced.simulate("road:1"), reduced.for_parameters({"payload": 0.0})
    assert own.status == "ok"
    assert "payload" in empty.simulate("road:1").message
    rougher = reduced.simulate(vm.maneuver("road:1", amplitude=1.5))
    assert rougher.message.startswith("component ")


def test_what_cannot_be_learned_is_said_in_one_line(car, runs, monkeypatch, tmp_path):
    faster = replace(runs[1], maneuver=replace(runs[1].maneuver, samples=501))
    with pytest.raises(InputError, match=r"of one spacing, not 0\.02 and 0\.05 s"):
        learned("operator_inference", car, [runs[0], faster])
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "opinf", None)
        with pytest.raises(InputError, match=r'this method needs opinf; .*\[contenders\]"'):
            vm.reduce(car, "operator_inference", training="lane_change")
    reduced = vm.reduce(car, "operator_inference", training="lane_change")
    with pytest.raises(InputError, match="it can't be saved: reduced is"):
        reduced.save(tmp_path / "model.nc")
    with pytest.raises(InputError, match="nothing moves in the training runs"):
        vm.reduce(car, "gaussian_process", training="straight_ahead")


def test_runs_stand_one_behind_the_other_in_lanes_as_long_as_the_longest():
    lanes = in_lanes([3, 10, 4, 3, 10, 2])
    assert lanes == [[(1, 0)], [(4, 0)], [(2, 0), (0, 4), (3, 7)], [(5, 0)]]


def test_a_network_trained_on_whole_runs_repeats_them_better_than_one_of_steps(car, runs):
    pytest.importorskip("jax_sysid")
    off = {}
    for epochs in (0, 60):
        given = {"coordinates": "slow", "width": 4, "epochs": epochs}
        reduced, data = learned("trajectory_network", car, runs, **given)
        pairs = zip(data.paths, data.inputs, strict=True)
        found = [reduced.path(z[:1], u[:, None])[:, 0] for z, u in pairs]
        off[epochs] = np.linalg.norm(np.concatenate(found) - np.concatenate(data.paths))
    assert off[60] < 0.5 * off[0]


def test_a_network_learns_the_same_of_runs_that_share_a_lane(car, runs, monkeypatch):
    pytest.importorskip("jax_sysid")
    samples = 2 * (lane_change.samples - 1) // 5 + 1
    short = {"duration": 0.4 * lane_change.duration, "samples": samples}
    runs = [*runs, *(replace(run, maneuver=replace(run.maneuver, **short)) for run in runs)]
    given = {"coordinates": "slow", "width": 4, "epochs": 5}
    sharing, data = learned("trajectory_network", car, runs, **given)
    alone = "vehiclemor.reduction.methods.trajectory_network.in_lanes"
    monkeypatch.setattr(alone, lambda lengths: [[(run, 0)] for run in range(len(lengths))])
    other, _ = learned("trajectory_network", car, runs, **given)
    start, inputs = data.paths[0][:1], data.inputs[0][:, None]
    np.testing.assert_allclose(sharing.path(start, inputs), other.path(start, inputs), atol=1e-6)
