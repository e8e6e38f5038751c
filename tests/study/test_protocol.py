"""Protocols: scenarios of the files, drawn test runs, and how the runs are judged."""

import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import vehiclemor as vm
from tests.models import VEHICLES
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import complete_settings, make_experiment
from vehiclemor.study.plans.choice import Validation, choose, outcomes, reasons, scores
from vehiclemor.study.plans.protocol import (
    _of_group,
    load_protocol,
    protocol_names,
    sampled_runs,
    sampled_sets,
)
from vehiclemor.study.plans.study_file import Bound
from vehiclemor.study.plans.study_runs import Box, Draw, Group

SAME_POINT = "f 1.01, a 1.435, equilibrium, 18.548 m/s"
BOX = Box(maneuver="sine_travel", frequency=[0.7, 1.8], amplitude=[0.5, 1.1], start=["equilibrium"])


@pytest.fixture(scope="module")
def protocols():
    return {model: load_protocol(study) for model, study in protocol_names().items()}


@pytest.fixture(scope="module")
def protocol(tmp_path_factory, protocol_text):
    path = tmp_path_factory.mktemp("draws") / "small.toml"
    path.write_text(protocol_text)
    return load_protocol(str(path))


def test_a_study_that_extends_another_has_its_sets_and_the_rows_it_names(
    tmp_path, protocol_text, protocol, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(protocol_text)
    more = """
        title = "more"
        extends = "small.toml"
        rows = ["replay", "newton"]
        targets = []
        methods = [{ label = "one vector", method = "fixed_basis", candidates = [{ rank = 1 }] }]
    """
    (tmp_path / "more.toml").write_text(more)
    found = load_protocol("more.toml")
    assert [entry.label for entry in found.entries] == ["replay", "newton", "one vector"]
    assert (found.definition.title, found.definition.targets) == ("more", [])
    assert found.test_set == protocol.test_set
    assert (found.sets, sampled_sets(found)) == (protocol.sets, sampled_sets(protocol))
    again = """
        title = "again"
        extends = "more.toml"
        rows = { "small.toml" = ["newton"], "more.toml" = ["one vector", "replay"] }
        seed = 3
    """
    (tmp_path / "again.toml").write_text(again)
    third = load_protocol("again.toml")
    assert [entry.label for entry in third.entries] == ["newton", "one vector", "replay"]
    assert third.test_set == "small-1, seed 3"
    assert third.definition.bounds == protocol.definition.bounds
    for old, new, words in (
        ("replay", "rerun", "rows: unknown row of small.toml 'rerun'"),
        ("small.toml", "other.toml", "extends: other.toml extends itself"),
    ):
        (tmp_path / "other.toml").write_text(more.replace(old, new, 1))
        with pytest.raises(FileError, match=re.escape(words)):
            load_protocol("other.toml")


# What the files of the package say


@pytest.mark.parametrize(
    ("name", "first", "digest"),
    [
        ("double_wishbone", "chirp_travel, f 1.01, a 1.108, equilibrium", "28232a475758a403"),
        (VEHICLES[0], f"multisine, {SAME_POINT}", "f7189e5c56c5dcb0"),
        (VEHICLES[1], f"rack_multisine, {SAME_POINT}", "1d377d9c35dd8f7a"),
    ],
)
def test_the_test_set_of_every_commit_and_machine(protocols, name, first, digest):
    """A change here is another test set: it needs another version in the protocol."""
    protocol = protocols[name]
    assert protocol.test_set == f"predictive-{name}-1, seed 20261122"
    sets = sampled_sets(protocol)
    assert len(sets["drawn"]) == 299
    assert sets["drawn"][0].label == first
    labels = [run.label for runs in sets.values() for run in runs]
    assert hashlib.sha256("\n".join(labels).encode()).hexdigest()[:16] == digest


# Drawn runs


def test_drawn_runs_follow_from_seed_version_and_purpose(protocol):
    draw = Draw(runs=40, boxes=[BOX])
    one, again, *others = (
        sampled_runs(protocol.model, draw, seeds)
        for seeds in ((1, 1, 0), (1, 1, 0), (2, 1, 0), (1, 2, 0), (1, 1, 1))
    )
    assert one == again
    assert not any(set(one) & set(other) for other in others)
    # What is known is not drawn.
    assert not set(one) & set(sampled_runs(protocol.model, draw, (1, 1, 0), one))
    point = Box(maneuver="sine_travel", both_signs=False)
    with pytest.raises(InputError, match="2"):
        sampled_runs(protocol.model, Draw(runs=2, boxes=[point]), (1, 1, 0))


def test_drawn_sets_are_apart_from_what_was_learned_and_from_lists(protocol):
    sets = sampled_sets(protocol)
    assert {name: len(runs) for name, runs in sets.items()} == {"drawn": 5, "drawn_outside": 2}
    learned = [protocol.sets[name] for name in ("training", "validation")]
    keys = [run.run_key for runs in (*learned, *sets.values()) for run in runs]
    assert len(set(keys)) == len(keys)
    # Neither fewer methods nor a list for other ends changes a draw; learning from a run does.
    listed = {"outside": sets["drawn"]}
    assert sampled_sets(replace(protocol, entries=protocol.entries[:1])) == sets
    assert sampled_sets(replace(protocol, sets=protocol.sets | listed)) == sets
    learned = replace(protocol, sets=protocol.sets | {"training": sets["drawn"]})
    assert not set(sampled_sets(learned)["drawn"]) & set(sets["drawn"])
    # Ten runs of one box fill both.
    half = Draw(runs=5, boxes=[Box(maneuver="sine_travel", frequency=[1.5, 1.504])])
    same = protocol.definition.model_copy(update={"drawn": half, "drawn_outside": half})
    one, other = sampled_sets(replace(protocol, definition=same)).values()
    assert len({*one, *other}) == 10


def test_an_audit_draws_other_runs_and_stands_apart(protocol, tmp_path):
    audit = load_protocol(str(protocol.path), seed=7)
    assert not set(sampled_sets(protocol)["drawn"]) & set(sampled_sets(audit)["drawn"])
    assert (protocol.study, audit.study) == ("small", "small-seed-7")
    with pytest.raises(InputError, match="seed"):
        vm.run_study("figure-12", seed=7, results=tmp_path)


def test_parameters_of_a_group_are_combined_with_all_else(protocol):
    values = {"a.b": [1.0, 2.0, 3.0], "c": [4.0]}
    group = Group(maneuver="road_travel:7", amplitude=[0.5, 1.0], parameters=values)
    runs = _of_group(protocol.model, group)
    assert len(set(runs)) == len(runs) == group.scenarios == 6
    assert {run.parameters for run in runs} == {(("a.b", b), ("c", 4.0)) for b in (1.0, 2.0, 3.0)}


# How runs are judged


def results(errors, statuses, until):
    shape = ("scenario", "output")
    ones = np.ones((len(errors), 1))
    return xr.Dataset(
        {
            "rms_error": (shape, np.array(errors)[:, None]),
            "largest_output": (shape, ones),
            "smallest_output": (shape, ones.copy()),
            "status": ("scenario", np.array(statuses, dtype=object)),
            "message": ("scenario", np.array(["why"] * len(errors), dtype=object)),
            "trusted_until": ("scenario", np.array(until)),
        },
        {"output": ["toe"]},
    )


def test_only_a_miss_without_a_word_is_silent():
    bounds = {"toe": Bound(measure="rms", bound=1.0)}
    statuses = ["ok", "ok", "untrusted", "diverged", "ok"]
    part = results([0.5, 2.0, 2.0, np.nan, 0.5], statuses, [np.inf, np.inf, 3.0, np.inf, 3.0])
    found = outcomes(part, bounds)
    assert found.missed.tolist() == [False, True, True, True, False]
    assert found.undetected.tolist() == [False, True, False, False, False]
    assert found.warned.tolist() == [False, False, True, True, True]
    counts = {"runs": 5, "right": 2, "misses": 3, "silent": 1, "flagged": 3}
    assert found.counts == counts


def test_runs_of_a_sensitive_full_order_are_found(protocol):
    bounds = {"toe": Bound(measure="rms", bound=1.0)}
    given = protocol.definition.model_copy(update={"bounds": bounds, "sensitive": {"toe": 2.0}})
    model = replace(protocol.model, definition=replace(protocol.model.definition, loads=("toe",)))
    of_loads = replace(protocol, definition=given, model=model)
    second = results([0.1, 3.0, 0.1, np.nan, 0.1], ["ok"] * 3 + ["diverged", "ok"], [np.inf] * 5)
    second["smallest_output"][2] = 0.0
    second["largest_output"][4] = 2.5
    found = reasons(of_loads, second)
    assert found[0] == ""
    for reason, words in zip(found[1:], ("3 times", "toe", "why", "2.5"), strict=True):
        assert words in reason


def test_the_best_candidate_that_is_stable_everywhere_is_chosen():
    assert choose([Validation(0.9, np.inf, 1.0), Validation(1.0, 3.0, 9.0)]) == 1
    assert choose([Validation(1.0, 2.0, 9.0), Validation(1.0, 3.0, 1.0)]) == 0
    assert choose([Validation(1.0, 2.0, 9.0), Validation(1.0, 2.09, 1.0)]) == 1
    assert choose([Validation(0.5, np.inf, 1.0), Validation(0.9, np.inf, 9.0)]) == 1
    # What leaves room to the bounds is chosen by its cost.
    assert choose([Validation(1.0, 0.1, 9.0), Validation(1.0, 0.49, 1.0)]) == 1


@pytest.mark.parametrize("name", VEHICLES)
def test_the_strongest_full_order_keeps_all_bounds_on_the_validation_runs(protocols, name):
    protocol = protocols[name]
    settings = complete_settings(protocol.model, "full_order", preset="strongest")
    tested = protocol.model, "full_order", settings, (), protocol.sets["validation"], "errors"
    assert scores(evaluate(make_experiment(*tested)), protocol.definition.bounds).max() <= 1.0
