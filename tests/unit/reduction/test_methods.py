"""Methods for a mechanism near the floor and exact at full rank; settings; what is told."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

import vehiclemor as vm
from tests.reducing import figure_errors, fitted, floor_errors, training_runs, two_way_travel
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.bases import Basis
from vehiclemor.reduction.settings import AT_MOST_COORDINATES, Settings
from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.study.evaluate import reference_run
from vehiclemor.study.scenario import Scenario, start_of


def test_least_squares_is_near_the_projection_floor_and_falls_with_the_rank(model, nominal, full):
    errors = []
    for rank in (1, 2, 3, 4):
        reduced = fitted(model, nominal, "pod", rank=rank)
        run = reduced.simulate(nominal, model.starts[0])
        errors.append(figure_errors(model, run.outputs, full))
        assert np.all(errors[-1] < 1.5 * floor_errors(model, reduced, full))
        # No trajectory in the subspaces is nearer in the coordinates' norm than the projection.
        best = reduced.best_approximation(full.states) - full.coordinates
        assert np.sum(best**2) <= np.sum((run.coordinates - full.coordinates) ** 2)
    assert np.all(np.array(errors[1:]) < 0.2 * np.array(errors[:-1]))


@pytest.mark.parametrize("galerkin", [False, True])
def test_full_rank_equals_full_order(model, rng, galerkin):
    maneuver = two_way_travel()
    turned, _ = np.linalg.qr(rng.standard_normal((8, 8)))
    basis = Basis(model.design + 0.05 * rng.standard_normal(8), turned, np.ones(8))
    fit = fitted(model, maneuver, "pod")
    tests = (turned, turned) if galerkin else None
    run = replace(fit, bases=(basis, basis), tests=tests).simulate(maneuver, model.starts[0])
    assert run.status == "ok"
    np.testing.assert_allclose(
        run.coordinates, model.simulate(maneuver).coordinates, rtol=0, atol=1e-11
    )


def test_fixed_basis_is_pod_with_one_control_period(model, nominal):
    one = fitted(model, nominal, "fixed_basis", snapshots=20, rank=3)
    same = fitted(model, nominal, "pod", snapshots=20, rank=3, control_period=10.0)
    assert len(one.bases) == len(same.bases) == 1
    runs = [reduced.simulate(nominal, model.starts[0]) for reduced in (one, same)]
    np.testing.assert_array_equal(runs[0].coordinates, runs[1].coordinates)


def test_iteration_that_fails_is_a_result(model, nominal):
    reduced = fitted(model, nominal, "pod", "nominal", rank=3, test_space="galerkin")
    broken = tuple(np.zeros_like(test) for test in reduced.tests)
    run = replace(reduced, tests=broken).simulate(nominal, model.starts[0])
    assert run.status == "diverged"
    assert "singular at t = 0 s" in run.message
    assert np.isnan(run.coordinates).all()
    assert np.isnan(run.outputs[:, 0]).all()


def test_a_run_has_the_histories_of_its_trajectory(model, nominal):
    [run] = training_runs(model, nominal)
    recorded = run.recorded()
    for name in ("times", "inputs", "states", "outputs"):
        np.testing.assert_array_equal(getattr(run, name), getattr(recorded, name))
    assert run.outputs is run.outputs
    with pytest.raises(AttributeError, match="rank"):
        _ = run.rank


def test_snapshots_of_several_runs_are_put_side_by_side(model, nominal):
    method = component("method", "pod")
    settings = validated(method, model.kind, {"rank": 3})
    pairs = [(1.0, 1.0), (1.0, 0.5)]
    together = method.fit(model, training_runs(model, nominal, "set", pairs), settings)
    means = [
        [basis.mean for basis in fitted(model, nominal.perturbed(*pair), "pod").bases]
        for pair in pairs
    ]
    for k, basis in enumerate(together.bases):
        assert basis.mean == pytest.approx((means[0][k] + means[1][k]) / 2.0, abs=1e-14)


def test_replay_of_several_runs_takes_the_nearest_input(model, nominal):
    method, start = component("method", "replay"), model.starts[0]
    pairs = [(1.0, 1.0), (1.0, 0.5), (2.0, 1.0)]
    replay = method.fit(model, training_runs(model, nominal, "set", pairs), {})
    for pair, tested in zip(pairs, [(1.0, 0.9), (1.05, 0.4), (1.9, 1.1)], strict=True):
        run = replay.simulate(nominal.perturbed(*tested), start)
        expected = model.simulate(nominal.perturbed(*pair)).coordinates
        np.testing.assert_array_equal(run.coordinates, expected)


CAR, SPEEDS = "independent_suspension_vehicle", (18.0, 22.0)
STARTS = ("equilibrium", "dropped")
# Model -> runs of which no two differ in one thing alone that replay might not look at.
DIFFERENT = {
    "double_wishbone": [
        Scenario.of(name, (f, 1.0), "equilibrium")
        for name in ("chirp_travel", "travel_and_rack")
        for f in (1.0, 1.3)
    ],
    "flexible_truck": [
        Scenario.of("road:3", (1.0, 1.0), "equilibrium", None, (("payload", payload),))
        for payload in (0.0, 5e3)
    ],
    CAR: [Scenario.of("lane_change", (1.0, 1.0), s, v) for s in STARTS for v in SPEEDS],
    "high_fidelity_vehicle": [
        Scenario.of("rack_lane_change", (1.0, 1.0), s, v) for s in STARTS for v in SPEEDS
    ],
}


@pytest.mark.parametrize("name", DIFFERENT)
def test_replay_is_exact_on_every_training_run(name):
    replay = vm.reduce(name, "replay", training=DIFFERENT[name])
    for scenario in DIFFERENT[name]:
        online = dict(scenario.parameters)
        own = replay.for_parameters(online) if online else replay
        run = own.simulate(scenario.maneuver, start_of(replay.model, scenario))
        full = reference_run(replay.model, scenario)
        np.testing.assert_array_equal(run.outputs, full.outputs)
        np.testing.assert_array_equal(run.states, full.states)


def test_replay_weighs_each_input_by_its_range_in_training():
    times = np.linspace(0.0, 5.0, 101)

    def moved(travel, rack):
        inputs = np.outer(np.sin(times), [travel, rack])
        return vm.Signal.from_samples(times, inputs, "cubic")

    # The rack moves ten times less than the wheel, and is as far as it goes from the second run.
    training = [moved(0.1, 0.01), moved(0.06, -0.01)]
    replay = vm.reduce("double_wishbone", "replay", training=training)
    first = replay.model.simulate(training[0])
    np.testing.assert_array_equal(replay.simulate(moved(0.07, 0.01)).states, first.states)


@given(size=st.floats(0.0, 3.0), sample=st.integers(0, 9), column=st.integers(0, 1))
def test_the_first_range_that_is_left_is_named(size, sample, column):
    used = np.zeros((10, 2))
    used[sample:, column] = -size
    found = trust_of(np.arange(10.0), used, ("roll", "speed"))
    assert found.indicator == size
    assert found.until == (sample if size > 1.0 else np.inf)
    assert found.reason.startswith(("roll", "speed")[column] if size > 1.0 else "")
    assert bool(found.reason) == (size > 1.0)


def test_what_is_no_number_is_beyond():
    found = trust_of(np.arange(3.0), np.array([[0.5], [np.nan], [0.1]]), ("roll",))
    assert (found.indicator, found.until) == (0.5, 1.0)


class Declared(Settings):
    rank: int = Field(3, ge=1, description="how many")
    period: float = Field(5.0, gt=0.0, description="how long")
    mode: Literal["fast", "slow"] = Field("fast", description="how")
    label: str = Field("", description="any text")
    order: Literal["up", "down"] = "up"
    share: float = Field(0.5, ge=0.0, le=1.0)


def declared(**presets):
    return Method("m", "", {"ode": Declared}, fit=lambda *_: None, presets={"ode": presets})


def test_defaults_then_preset_then_given():
    others = {"label": "", "order": "up", "share": 0.5}
    plain = validated(declared(), "ode", {}).model_dump()
    assert plain == {"rank": 3, "period": 5.0, "mode": "fast", **others}
    method = declared(mine={"rank": 4, "mode": "slow"})
    settings = validated(method, "ode", {"rank": 5}, "mine").model_dump()
    assert settings == {"rank": 5, "period": 5.0, "mode": "slow", **others}


class Bounded(Declared):
    modes: Annotated[int, AT_MOST_COORDINATES] = Field(3, ge=1, description="how many at most")


def test_a_default_is_at_most_the_number_of_coordinates_where_it_says_so():
    method = replace(declared(), presets={"ode": {"mine": {"modes": 4}}}, settings={"ode": Bounded})
    for preset in ("recommended", "mine"):
        settings = validated(method, "ode", {}, preset, coordinates=2)
        assert (settings.rank, settings.modes) == (3, 2)
    assert validated(method, "ode", {"modes": 3}, coordinates=2).modes == 3


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rank", np.int64(0), "rank is 0.*at least 1"),
        ("rank", 2.5, "rank is 2.5, not an integer"),
        ("rank", float("nan"), "rank is nan, not finite"),
        ("period", 0.0, "period is 0.*above 0"),
        ("mode", "quick", "mode is 'quick'.*fast, slow"),
        ("label", 1, "label is 1.*text"),
        ("order", "{left}", "order is '{left}'.*up, down"),
        ("share", 2, "share is 2.*at most 1"),
        ("rang", 3, "'rang'.*did you mean rank"),
    ],
)
def test_wrong_setting_is_named_with_what_is_allowed(name, value, words):
    with pytest.raises(InputError, match=words):
        validated(declared(), "ode", {name: value})
