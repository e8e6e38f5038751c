"""Drawn test sets: what they depend on, what they hold, and how their runs are judged."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

import vehiclemor as vm
from vehiclemor.errors import FileError, InputError
from vehiclemor.report.unseen import at_error, upper_bound
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.drawn_runs import drawn, drawn_sets
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.sensitive import _lifted, reasons
from vehiclemor.study.plans.study_file import Bound, Box, Draw

SEEDS = (1, 1, 0)
SAME_POINT = "f 1.01, a 1.435, equilibrium, 18.548 m/s"
BOX = Box(maneuver="sine_travel", frequency=[0.7, 1.8], amplitude=[0.5, 1.1], start=["equilibrium"])


@pytest.fixture(scope="module")
def protocol(tmp_path_factory, protocol_text):
    path = tmp_path_factory.mktemp("draws") / "small.toml"
    path.write_text(protocol_text)
    return load_protocol(str(path))


def test_drawn_runs_follow_from_seed_version_and_purpose(protocol):
    draw = Draw(runs=40, boxes=[BOX])
    one, again, *others = (
        drawn(protocol.model, draw, seeds)
        for seeds in ((1, 1, 0), (1, 1, 0), (2, 1, 0), (1, 2, 0), (1, 1, 1))
    )
    assert one == again
    assert not any(set(one) & set(other) for other in others)


@pytest.mark.parametrize(
    ("name", "first", "digest"),
    [
        ("double_wishbone", "chirp_travel, f 1.01, a 1.108, equilibrium", "28232a475758a403"),
        ("independent_suspension_vehicle", f"multisine, {SAME_POINT}", "f7189e5c56c5dcb0"),
        ("high_fidelity_vehicle", f"rack_multisine, {SAME_POINT}", "1d377d9c35dd8f7a"),
    ],
)
def test_the_test_set_of_every_commit_and_machine(name, first, digest):
    """A change here is another test set: it needs another version in the protocol."""
    protocol = load_protocol(f"predictive-{name}")
    assert protocol.test_set == f"predictive-{name}-1, seed 20261122"
    sets = drawn_sets(protocol)
    assert len(sets["drawn"]) == 299
    assert sets["drawn"][0].label == first
    labels = [run.label for runs in sets.values() for run in runs]
    assert hashlib.sha256("\n".join(labels).encode()).hexdigest()[:16] == digest


def test_a_method_more_changes_no_test_run(protocol):
    fewer = replace(protocol, entries=protocol.entries[:1])
    assert drawn_sets(fewer) == drawn_sets(protocol)
    # Nor does a list for other ends strike runs from a draw.
    runs = drawn_sets(protocol)["drawn"]
    listed = replace(protocol, sets=protocol.sets | {"outside": runs})
    assert drawn_sets(listed)["drawn"] == runs


def test_drawn_sets_are_apart_from_what_was_learned(protocol):
    sets = drawn_sets(protocol)
    assert {name: len(runs) for name, runs in sets.items()} == {"drawn": 5, "drawn_outside": 2}
    learned = [protocol.sets[name] for name in ("training", "validation")]
    keys = [run.run_key for runs in (*learned, *sets.values()) for run in runs]
    assert len(set(keys)) == len(keys)


def test_an_audit_draws_other_runs_and_stands_apart(protocol_text, tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(protocol_text)
    own, audit = load_protocol(str(path)), load_protocol(str(path), seed=7)
    assert not set(drawn_sets(own)["drawn"]) & set(drawn_sets(audit)["drawn"])
    assert (own.study, audit.study) == ("small", "small-seed-7")
    with pytest.raises(InputError, match="seed"):
        vm.run_study("figure-12", seed=7, out=tmp_path)


def test_a_draw_fills_its_box_and_stays_inside(protocol):
    runs = drawn(protocol.model, Draw(runs=400, boxes=[BOX]), SEEDS)
    assert len({run.run_key for run in runs}) == 400
    frequency = np.array([run.maneuver.frequency_factor for run in runs])
    amplitude = np.array([run.maneuver.amplitude_factor for run in runs])
    assert frequency.min() >= 0.7
    assert frequency.max() <= 1.8
    assert np.abs(amplitude).min() >= 0.5
    assert np.abs(amplitude).max() <= 1.1
    # Uniform: means and shares lie within five standard deviations.
    assert abs(frequency.mean() - 1.25) < 5.0 * 1.1 / math.sqrt(12 * 400)
    assert abs((amplitude > 0.0).mean() - 0.5) < 5.0 * 0.5 / 20.0


def test_what_is_known_is_not_drawn(protocol):
    draw = Draw(runs=10, boxes=[BOX])
    first = drawn(protocol.model, draw, SEEDS)
    assert not set(first) & set(drawn(protocol.model, draw, SEEDS, first))


def test_a_box_without_room_is_refused(protocol):
    point = Box(maneuver="sine_travel", both_signs=False)
    with pytest.raises(InputError, match="fewer than 2 different runs"):
        drawn(protocol.model, Draw(runs=2, boxes=[point]), SEEDS)


@given(st.integers(0, 40), st.integers(1, 400))
def test_the_bound_of_a_rate_is_exact(misses, runs):
    misses = min(misses, runs)
    bound = upper_bound(misses, runs)
    if misses == runs:
        assert bound == 1.0
    else:
        # At the bound so few misses have a probability of 5 %.
        np.testing.assert_allclose(binom.cdf(misses, runs, bound), 0.05, rtol=1e-6)


def test_299_runs_without_a_miss_prove_less_than_1_percent():
    assert upper_bound(0, 298) > 0.01 > upper_bound(0, 299)


def ladder(name, order, scores, factor=1.0):
    return [
        {"label": f"{name} {s}", "score": s, "seconds": factor * s ** (-1.0 / order)}
        for s in scores
    ]


@given(st.floats(0.011, 0.99))
def test_a_power_law_is_interpolated_exactly(error):
    rows = ladder("a", 3.0, [1.0, 0.1, 0.01])
    # A row that is slower and less accurate than another is no part of the curve.
    rows.append({"label": "slip", "score": 0.5, "seconds": 50.0})
    found = at_error([rows], error, "seconds")
    np.testing.assert_allclose(found.seconds, error ** (-1.0 / 3.0), rtol=1e-12)
    assert "slip" not in found.rows


def test_the_fastest_ladder_counts_that_reaches_the_error():
    slow, fast = ladder("slow", 3.0, [1.0, 0.001], 2.0), ladder("fast", 3.0, [1.0, 0.1])
    assert at_error([slow, fast], 0.2, "seconds").rows == ("fast 1.0", "fast 0.1")
    assert at_error([slow, fast], 0.04, "seconds").rows == ("slow 1.0", "slow 0.001")
    # Just beyond its end the fast one is continued by its own law, not replaced by the slow one.
    (first, last), continued = fast, at_error([slow, fast], 0.06, "seconds")
    law = math.log(last["seconds"] / first["seconds"]) / math.log(last["score"] / first["score"])
    expected = last["seconds"] * (0.06 / last["score"]) ** law
    assert continued.rows == ("fast 1.0", "fast 0.1")
    assert continued.seconds == pytest.approx(expected, rel=1e-12)
    assert at_error([slow, fast], 5.0, "seconds") == (1.0, ("fast 1.0",))
    assert math.isnan(at_error([slow, fast], 1e-6, "seconds").seconds)


def results(errors, statuses, until):
    shape = ("scenario", "output")
    return xr.Dataset(
        {
            "rms_error": (shape, np.array(errors)[:, None]),
            "largest_output": (shape, np.array([[1.0]] * len(errors))),
            "status": ("scenario", np.array(statuses, dtype=object)),
            "message": ("scenario", np.array(["why"] * len(errors), dtype=object)),
            "smallest_output": (shape, np.array([[1.0]] * len(errors))),
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
    assert found.silent.tolist() == [False, True, False, False, False]
    assert found.flagged.tolist() == [False, False, True, True, True]


def test_runs_of_a_sensitive_full_order_are_found(protocol):
    definition = protocol.definition.model_copy(
        update={"bounds": {"toe": Bound(measure="rms", bound=1.0)}, "sensitive": {"toe": 2.0}}
    )
    second = results([0.1, 3.0, 0.1], ["ok"] * 3, [np.inf] * 3)
    found = reasons(replace(protocol, definition=definition), second)
    assert found[0] == found[2] == ""
    assert "differ by 3 times a bound" in found[1]
    assert _lifted(second.isel(scenario=0), ["toe"]) == ""
    second["smallest_output"][2] = 0.0
    assert _lifted(second.isel(scenario=2), ["toe"]) == "without load: toe"
    tipped = definition.model_copy(update={"sensitive": {"toe": 0.5}})
    assert "reaches 1" in reasons(replace(protocol, definition=tipped), second)[0]


def test_boxes_are_checked_when_a_protocol_is_read(tmp_path, protocol_text):
    path = tmp_path / "wrong.toml"
    for old, new, told in (
        ("frequency = [0.7, 2.0], amplitude = [0.5, 1.1]", "frequency = [2.0, 0.7]", "in order"),
        ("amplitude = [1.3, 1.4]", 'start = ["dropped"]', "drawn_outside, box 1"),
        ("runs = 5", "runs = 0", "drawn"),
    ):
        assert old in protocol_text
        path.write_text(protocol_text.replace(old, new))
        with pytest.raises(FileError, match=told):
            load_protocol(str(path))
