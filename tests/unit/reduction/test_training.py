"""Training policies run what they say, and training runs are exact at any time."""

import numpy as np
import pytest

from tests.reducing import fitted, training_runs
from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.trajectory import Trajectory


def test_policies_choose_the_factors(model: AlgebraicModel, nominal: Maneuver) -> None:
    tested = nominal.perturbed(1.2, 0.9)
    pairs = [(1.0, 0.5), (2.0, 1.0)]
    found = {
        policy: [
            (run.maneuver.frequency_factor, run.maneuver.amplitude_factor)
            for run in training_runs(model, tested, policy, pairs if policy == "set" else ())
        ]
        for policy in ("matched", "nominal", "set")
    }
    assert found == {"matched": [(1.2, 0.9)], "nominal": [(1.0, 1.0)], "set": pairs}


def test_run_is_exact_at_any_times(
    model: AlgebraicModel, nominal: Maneuver, full: Trajectory
) -> None:
    [run] = training_runs(model, nominal)
    some = np.array([3, 250, 250, 700, 1000])
    history = run.at(nominal.times[some])
    np.testing.assert_allclose(history.coordinates, full.coordinates[some], rtol=0, atol=1e-13)


def test_a_run_has_the_histories_of_its_trajectory(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    [run] = training_runs(model, nominal)
    recorded = run.recorded()
    for name in ("time", "inputs", "states", "outputs"):
        np.testing.assert_array_equal(getattr(run, name), getattr(recorded, name))
    assert run.outputs is run.outputs
    with pytest.raises(AttributeError, match="rank"):
        _ = run.rank


def test_wrong_policy_is_named(model: AlgebraicModel, nominal: Maneuver) -> None:
    for policy, words in (("set", "training_set"), ("nomnal", "did you mean nominal")):
        with pytest.raises(InputError, match=words):
            training_runs(model, nominal, policy)


def test_snapshots_of_several_runs_are_put_side_by_side(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
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


def test_replay_of_several_runs_takes_the_nearest_input(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    method, start = component("method", "replay"), model.starts[0]
    pairs = [(1.0, 1.0), (1.0, 0.5), (2.0, 1.0)]
    replay = method.fit(model, training_runs(model, nominal, "set", pairs), {})
    for pair, tested in zip(pairs, [(1.0, 0.9), (1.05, 0.4), (1.9, 1.1)], strict=True):
        run = replay.simulate(nominal.perturbed(*tested), start)
        expected = model.simulate(nominal.perturbed(*pair)).coordinates
        np.testing.assert_array_equal(run.coordinates, expected)
