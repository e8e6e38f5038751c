"""Protocols: scenarios of the files, what they resolve to, and what the schema refuses."""

import numpy as np
import pytest

from vehiclemor.errors import FileError
from vehiclemor.reduction.methods import replay
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.registry import component
from vehiclemor.simulation import input_polynomials
from vehiclemor.simulation.build import build
from vehiclemor.study import evaluate
from vehiclemor.study import scenario as scenario_module
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.plans.protocol import load_protocol, protocol_names
from vehiclemor.study.scenario import Scenario, start_of, training_run

VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


def scenario(maneuver, start, speed):
    """An unperturbed scenario."""
    return Scenario(component("maneuver", maneuver), start, speed)


@pytest.fixture(scope="module")
def protocols():
    return {model: load_protocol(study) for model, study in protocol_names().items()}


def test_the_study_names_every_protocol(protocols):
    assert sorted(load_studies("predictive")) == sorted(protocol_names().values())


@pytest.mark.parametrize("name", VEHICLES)
def test_the_sets_of_a_vehicle(protocols, name):
    protocol = protocols[name]
    sets, definition = protocol.sets, protocol.definition
    prefix = "rack_" if name == "high_fidelity_vehicle" else ""
    inside, outside = definition.drawn, definition.drawn_outside
    # 299 runs without a miss prove a rate below 1 % at 95 %.
    assert inside.runs == 299
    shapes = ("lane_change", "step_steer", "sine_sweep", "multisine")
    assert {box.maneuver for box in inside.boxes} == {f"{prefix}{shape}" for shape in shapes}
    for box in inside.boxes:
        assert (box.frequency, box.amplitude, box.speed) == ([0.7, 1.8], [0.5, 1.5], [18.0, 22.0])
        assert box.both_signs
        assert box.start == ["equilibrium", "dropped"]
    # Training reaches at least as far as what is drawn inside, and nowhere near all outside.
    trained = [s.maneuver.frequency_factor for s in sets["training"]]
    assert min(trained) <= 0.7
    assert max(trained) >= 1.8
    assert max(abs(s.maneuver.amplitude_factor) for s in sets["training"]) >= 1.5
    assert max(box.amplitude[1] for box in outside.boxes) == 2.5
    assert {s.maneuver.name for s in sets["test"]} == {f"{prefix}straight_ahead"}


def test_no_run_stands_in_two_sets(protocols):
    for protocol in protocols.values():
        runs = [s.run_key for scenarios in protocol.sets.values() for s in scenarios]
        assert len(set(runs)) == len(runs)


def test_another_speed_is_a_state_and_the_own_speed_a_name():
    model = build(VEHICLES[0])
    own = scenario("lane_change", "dropped", 20.0)
    assert start_of(model, own) == "dropped"
    faster = start_of(model, scenario("lane_change", "dropped", 26.0))
    assert isinstance(faster, np.ndarray)
    run = training_run(model, scenario("lane_change", "equilibrium", 26.0))
    speeds = run.at(np.array([0.0, 0.1])).outputs[:, model.outputs.index("longitudinal_speed")]
    np.testing.assert_allclose(speeds, 26.0, rtol=1e-3)


def test_full_order_rows_are_named_after_their_tolerances(protocols):
    contestants = {c.label: c for c in protocols[VEHICLES[0]].entries}
    names, tolerances = zip(*map(str.split, contestants["ros34pw2"].row_labels), strict=True)
    assert set(names) == {"ros34pw2"}
    used = [settings["tolerance"] for settings in contestants["ros34pw2"].candidates]
    assert [float(tolerance) for tolerance in tolerances] == used
    assert not any(".0e" in tolerance or "e-0" in tolerance for tolerance in tolerances)
    assert contestants["replay"].row_labels == ["replay"]


def test_a_contestant_may_learn_from_some_maneuvers_only(protocols):
    for contestant in protocols[VEHICLES[1]].entries:
        if contestant.label == "fixed basis":
            assert {s.maneuver.name for s in contestant.training} == {"rack_lane_change"}
            assert len(contestant.training) < len(protocols[VEHICLES[1]].sets["training"])


def test_what_all_rows_need_of_a_run_is_kept_until_the_next_row(protocols):
    kept = (
        input_polynomials._recorded,
        input_polynomials._found_signal,
        evaluate.kept_reference,
        scenario_module._state_at,
        scenario_module.input_hash,
    )
    for protocol in protocols.values():
        draws = (protocol.definition.drawn, protocol.definition.drawn_outside)
        runs = len(protocol.sets["test"]) + sum(draw.runs for draw in draws if draw)
        # Of a smaller cache nothing would be left when the next row comes.
        assert all(runs <= function.cache_parameters()["maxsize"] for function in kept)


def test_one_run_under_two_names_is_found(tmp_path, protocol_text):
    # Without amplitude a chirp is a sine.
    text = protocol_text.replace("points = [[0.9, 1.0]]", "points = [[0.9, 1.0], [1.0, 0.0]]")
    text += '\n[[outside]]\nmaneuver = "chirp_travel"\npoints = [[1.0, 0.0]]\n'
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=r"outside: the scenario .* is in test too"):
        load_protocol(str(path))


def test_replay_of_runs_of_other_lengths():
    model = build(VEHICLES[0])
    step, change = component("maneuver", "step_steer"), component("maneuver", "lane_change")
    runs = [TrainingRun(model, step, "equilibrium"), TrainingRun(model, change, "equilibrium")]
    recorded = replay.fit(model, runs, {})
    again = recorded.simulate(change.perturbed(1.0, 1.1), "equilibrium")
    np.testing.assert_array_equal(again.coordinates, recorded.recorded[1].coordinates)
    sweep = component("maneuver", "sine_sweep").perturbed(1.0, 0.0)
    held = replay.fit(model, runs[:1], {}).simulate(sweep, "equilibrium")
    assert held.coordinates.shape == (sweep.samples, len(model.coordinates))
    np.testing.assert_allclose(held.coordinates[:251], recorded.recorded[0].coordinates)
    np.testing.assert_array_equal(held.coordinates[-1], held.coordinates[250])
