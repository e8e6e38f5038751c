"""General learners: what they fit is what their libraries found, and linear models are learned."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import vehiclemor as vm
from tests.reducing import training_runs
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.steering import lane_change
from vehiclemor.reduction.learned.learned_model import TrainingData, columns, monomials
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import FINISHED

LINEAR = {
    "operator_inference": {"form": "linear", "ridge": 0.0},
    "sparse_identification": {"degree": 1, "threshold": 0.0, "ridge": 0.0},
    "dynamic_mode_decomposition": {"ridge": 1e-14},
}
CAR = "independent_suspension_vehicle"


def learned(name, model, runs, **settings):
    """What a method fits to runs, and what it has seen."""
    method = component("method", name)
    chosen = method.settings[model.kind](**settings)
    discrete_time = name not in ("operator_inference", "sparse_identification")
    return method.fit(model, runs, chosen), TrainingData.of(
        model, runs, chosen, discrete_time, "numpy"
    )


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
        # Inputs between two samples are known to dynamic mode decomposition as a line alone.
        assert error.max() < (1e-2 if name.startswith("dynamic") else 1e-3)


def test_the_loop_evaluates_what_the_libraries_have_fitted(car, runs):
    from sklearn.neural_network import MLPRegressor

    few = {"rank": 4, "steps": 1}
    reduced, data = learned("neural_network", car, runs, epochs=20, **few)
    linear, left = data.linear
    (x, expected), scale = data.regression, left.std(axis=0)
    network = MLPRegressor(
        hidden_layer_sizes=(32, 32), activation="tanh", alpha=1e-5, max_iter=20, random_state=0
    )
    straight = [0.0] * (left.shape[1] - 2) + [reduced.states.shape.speed, 0.0]
    found = columns(monomials(x.shape[1], 1, constant=False), x) @ linear.coefficients
    found = found + network.fit(x, left / scale).predict(x) * scale + straight
    np.testing.assert_allclose(reduced._values(x), found, atol=1e-10)
    # At its own samples a process is what was given, but for its noise.
    reduced, data = learned(
        "gaussian_process", car, runs, samples=300, length=1.0, noise=1e-9, **few
    )
    rows = np.random.default_rng(0).permutation(len(x))[:300]
    results = expected[rows] + straight
    error = np.abs(reduced._values(x[rows]) - results).max(axis=0)
    assert (error < 2e-2 * expected.std(axis=0)).all()


def test_quadratic_operators_are_those_of_the_library(car, runs):
    import opinf

    reduced, data = learned("operator_inference", car, runs, rank=3, form="quadratic", ridge=1e-3)
    (x, results), r = data.regression, 3
    library = opinf.models.ContinuousModel("AHBN", solver=opinf.lstsq.L2Solver(1e-3))
    library.fit(x[:, :r].T, results[:, :r].T, x[:, r:].T)
    found = [library.rhs(0.0, row[:r], lambda _, row=row: row[r:]) for row in x[::40]]
    np.testing.assert_allclose(reduced._values(x[::40])[:, :r], found, atol=1e-9)


def test_observables_are_monomials_and_begin_as_those_of_the_start(car, runs):
    settings = {"rank": 3, "degree": 2, "steps": 1}
    reduced, data = learned("dynamic_mode_decomposition", car, runs, **settings)
    assert reduced.order == 3 + 6
    state = car.start("dropped")
    z = data.forward @ (reduced.states.of(state[None])[0])
    products = [z[i] * z[j] for i in range(3) for j in range(i, 3)]
    np.testing.assert_allclose(reduced._encoded(state)[:9], [*z, *products], rtol=1e-12)


def test_a_learned_car_drives_straight_on_and_turns_with_its_heading(car, runs):
    reduced, _ = learned("operator_inference", car, runs, rank=4, form="linear", steps=1)
    straight = reduced.simulate(vm.maneuver("straight_ahead"), "equilibrium")
    distance = straight["longitudinal_position"][-1]
    assert abs(straight["lateral_position"]).max() < 1e-9
    assert distance == pytest.approx(reduced.states.shape.speed * straight.times[-1], rel=1e-9)
    turned, (x, y, heading) = car.start(), car.planar
    turned[[heading, x, y]] = 0.5 * np.pi, 3.0, -2.0
    turned = car.start("equilibrium").copy()
    for a, b in zip(car.rotating[1::2], car.rotating[2::2], strict=True):
        turned[b], turned[a] = turned[a], -turned[b]
    turned[[heading, x, y]] = 0.5 * np.pi, 3.0, -2.0
    one, other = (reduced.simulate(lane_change, start) for start in ("equilibrium", turned))
    ahead, aside = one["longitudinal_position"], one["lateral_position"]
    np.testing.assert_allclose(other["lateral_position"] + 2.0, ahead, atol=1e-6)
    np.testing.assert_allclose(3.0 - other["longitudinal_position"], aside, atol=1e-6)


def test_a_diverged_run_is_recorded_up_to_where_it_left(car, runs):
    reduced, _ = learned("operator_inference", car, runs, rank=4, form="linear", steps=1)
    grown = reduced.equations._replace(coefficients=3e2 * abs(reduced.equations.coefficients))
    run = replace(reduced, equations=grown).simulate(lane_change, "dropped")
    assert run.status == "diverged"
    assert "have diverged at t = " in run.message
    assert np.isnan(run.outputs[-1]).all()


def test_interpolation_with_all_rows_is_the_projection_itself(car):
    given = {"rank": 4, "solver": "dopri5", "tolerance": 1e-6, "formulation": "state"}
    plain = vm.reduce(car, "fixed_basis", training="lane_change", snapshots=500, **given)
    whole = vm.reduce(car, "deim", training="lane_change", rows=28, **given)
    few = vm.reduce(car, "deim", training="lane_change", rows=8, **given)
    runs = [reduced.simulate(lane_change)["lateral_position"] for reduced in (plain, whole, few)]
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-5)
    assert np.nanmax(np.abs(runs[0] - runs[2])) > 1e-2
    np.testing.assert_allclose(few.state("dropped"), plain.state("dropped"), atol=1e-9)
    test = few.reduced.spaces.test_basis[0]
    assert (np.abs(test).max(axis=0) > 0.0).sum() == 8
    # The basis, then the training run at its output times, and a rate at each of these.
    recorded = car.simulate(lane_change)
    more = recorded.counts["rhs_calls"] + len(recorded.times)
    assert few.reduced.offline.evaluations == plain.reduced.offline.evaluations + more
    trial = few.reduced.spaces.trial_basis[0]
    np.testing.assert_allclose(test @ trial.T, np.eye(4), atol=1e-9)


@pytest.mark.parametrize("method", ["balanced_truncation", "irka"])
def test_reduced_lateral_dynamics_answer_slow_steering_as_all_modes_do(car, method):
    few, all_modes = vm.reduce(car, method, rank=4), vm.reduce(car, "modal_truncation")
    slow = vm.maneuver("lane_change", frequency=0.5, amplitude=0.05)
    one, other = (reduced.simulate(slow)["yaw"] for reduced in (few, all_modes))
    assert np.abs(one - other).max() < 0.02 * np.ptp(other)
    with pytest.raises(InputError, match=r"rank is 90; .* allows at most"):
        vm.reduce(car, method, rank=90)


def test_a_run_beyond_the_states_of_training_is_not_trusted(car, runs):
    reduced, _ = learned("operator_inference", car, runs, rank=4, form="linear")
    assert reduced.simulate(runs[0].maneuver, "equilibrium").status == "ok"
    run = reduced.simulate(lane_change, "dropped")
    assert (run.status, run.trust.until) == ("untrusted", 0.0)
    assert run.trust.reason.startswith("component ")
    small = replace(reduced, input_scale=np.ones(2))
    for wrong in (
        small,
        replace(reduced, time_step=np.inf),
        replace(reduced, ranges=np.ones((3, 2))),
    ):
        with pytest.raises(ValueError, match=r"equations|time_step|ranges"):
            wrong.check_sizes()


def test_a_truck_without_the_payload_of_training_is_not_trusted():
    truck = vm.model("flexible_truck")
    reduced = vm.reduce(truck, "dynamic_mode_decomposition", training="road:1", rank=10)
    own, empty = reduced.simulate("road:1"), reduced.for_parameters({"payload": 0.0})
    assert own.status == "ok"
    assert "payload" in empty.simulate("road:1").message


def test_what_cannot_be_learned_is_said_in_one_line(car, runs, monkeypatch):
    faster = replace(runs[1], maneuver=replace(runs[1].maneuver, samples=501))
    with pytest.raises(InputError, match=r"of one spacing, not 0\.02 and 0\.05 s"):
        learned("operator_inference", car, [runs[0], faster], steps=1)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "opinf", None)
        with pytest.raises(InputError, match=r'this method needs opinf; .*\[contenders\]"'):
            vm.reduce(car, "operator_inference", training="lane_change")
    with pytest.raises(InputError, match="nothing moves in the training runs"):
        vm.reduce(car, "gaussian_process", training="straight_ahead")
    with pytest.raises(InputError, match="reduces kind"):
        vm.reduce("double_wishbone", "sparse_identification")
    with pytest.raises(InputError, match="rows is 3; it must be from rank 4 to 28"):
        vm.reduce(car, "deim", training="lane_change", rank=4, rows=3)
