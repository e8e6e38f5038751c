"""Sealed draws: what they depend on, what they hold, what is kept of them."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from vehiclemor.errors import FileError, InputError
from vehiclemor.report.predictive.equal_error import at_error
from vehiclemor.report.predictive.rates import upper_bound
from vehiclemor.resources import data_names
from vehiclemor.study.plans.boxes import drawn
from vehiclemor.study.plans.choice import Row, outcomes
from vehiclemor.study.plans.ledger import Drawn, Ledger, Shown, pooled, same_rules
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.protocol_file import Bound, Box, Draw
from vehiclemor.study.plans.protocol_run import run_protocol
from vehiclemor.study.plans.seal import rules, seal, sealed_sets
from vehiclemor.study.plans.sensitive import _lifted, reasons
from vehiclemor.study.scenario import parameters_of

BOX = Box(maneuver="sine_travel", frequency=[0.7, 1.8], amplitude=[0.5, 1.1], start=["equilibrium"])


@pytest.fixture(scope="module")
def protocol(tmp_path_factory, protocol_text):
    path = tmp_path_factory.mktemp("draws") / "small.toml"
    path.write_text(protocol_text)
    return load_protocol(str(path))


@pytest.fixture(scope="module")
def rows(protocol):
    return [Row(contestant, 0, ()) for contestant in protocol.contestants]


def test_the_same_seal_draws_the_same_runs_and_another_others(protocol):
    draw = Draw(runs=40, boxes=[BOX])
    one, again, other = (drawn(protocol.model, draw, seed, "drawn") for seed in "aab")
    assert one == again
    assert not set(one) & set(other)
    assert not set(one) & set(drawn(protocol.model, draw, "a", "drawn_outside"))


def test_a_draw_fills_its_box_and_stays_inside(protocol):
    runs = drawn(protocol.model, Draw(runs=400, boxes=[BOX]), "a", "drawn")
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
    first = drawn(protocol.model, draw, "a", "drawn")
    assert not set(first) & set(drawn(protocol.model, draw, "a", "drawn", first))


def test_a_box_without_room_is_refused(protocol):
    point = Box(maneuver="sine_travel", both_signs=False)
    with pytest.raises(InputError, match="fewer than 2 different runs"):
        drawn(protocol.model, Draw(runs=2, boxes=[point]), "a", "drawn")


def test_whatever_is_tested_changes_the_seal(protocol, rows):
    first = seal(protocol, rows)
    assert seal(protocol, rows) == first
    other = [*rows[:-1], replace(rows[-1], candidate=1)]
    trained = replace(rows[-1].contestant, training=rows[-1].contestant.training * 2)
    learned = [*rows[:-1], replace(rows[-1], contestant=trained)]
    bounds = protocol.definition.bounds | {"toe": Bound(measure="rms", bound=1.0)}
    judged = replace(protocol, definition=protocol.definition.model_copy(update={"bounds": bounds}))
    validated = replace(protocol, sets=protocol.sets | {"validation": ()})
    seals = {first, seal(protocol, other), seal(protocol, learned)}
    assert len(seals | {seal(judged, rows), seal(validated, rows)}) == 5
    assert seal(protocol, [replace(row, winner=True) for row in rows]) != first
    # A new name is no new draw: nobody renames until one pleases.
    assert seal(replace(protocol, path=protocol.path.with_name("other.toml")), rows) == first
    # A list for other ends can't strike runs from a draw.
    drawn_runs = sealed_sets(protocol, first)["drawn"]
    listed = replace(protocol, sets=protocol.sets | {"outside": drawn_runs})
    assert seal(listed, rows) == first
    assert sealed_sets(listed, first)["drawn"] == drawn_runs


def test_drawn_sets_are_apart_from_what_was_learned(protocol, rows):
    sets = sealed_sets(protocol, seal(protocol, rows))
    assert {name: len(runs) for name, runs in sets.items()} == {"drawn": 5, "drawn_outside": 2}
    learned = [protocol.sets[name] for name in ("training", "validation")]
    keys = [run.run_key for runs in (*learned, *sets.values()) for run in runs]
    assert len(set(keys)) == len(keys)


def test_nothing_is_drawn_before_it_stands_in_the_ledger(tmp_path, protocol_text, monkeypatch):
    path = tmp_path / "small.toml"
    path.write_text(protocol_text)

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("vehiclemor.study.plans.protocol_run.test", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_protocol(load_protocol(str(path)), tmp_path)
    (draw,) = Ledger("small", tmp_path, own=False).entries()
    assert (draw.runs, draw.rows) == (0, {})


def entry(digest, misses=0, runs=299, rules="r"):
    row = Shown("m", {}, True, misses, misses, 0, {"yaw": 1e-5})
    return Drawn(f"2026-01-0{digest}", "v", "car", digest, rules, runs, 0, {"fast": row})


def test_the_ledger_keeps_every_draw(tmp_path):
    ledger = Ledger("car", tmp_path, own=False)
    for draw in (entry("2", misses=7), entry("1"), entry("2", misses=7), entry("3", runs=100)):
        ledger.open(draw)
        ledger.record(draw)
    found = ledger.entries()
    # Neither order nor a second try of the same draw changes what stands there.
    assert [draw.digest for draw in found] == ["1", "2", "3"]
    assert pooled(found, "r", "fast") == pooled(found, "r") == (7, 7, 698)
    assert pooled(found, "r", "slow") == (0, 0, 0)
    assert len((tmp_path / "draws" / "car.jsonl").read_text().splitlines()) == 3


def test_a_draw_that_was_opened_stays_until_it_is_evaluated(tmp_path):
    ledger = Ledger("car", tmp_path, own=False)
    ledger.open(entry("1"))
    assert [(draw.digest, draw.runs, draw.rows) for draw in ledger.entries()] == [("1", 0, {})]
    ledger.record(entry("1", misses=2))
    assert [draw.rows["fast"].misses for draw in ledger.entries()] == [2]
    ledger.open(entry("1"))
    # Another result of the same draw does not replace the first.
    ledger.record(entry("1", misses=0))
    assert [draw.rows["fast"].misses for draw in ledger.entries()] == [2, 0]
    # It counts once, as the worse of the two.
    assert pooled(ledger.entries(), "r") == (2, 2, 299)


def test_draws_under_other_rules_are_not_pooled(tmp_path):
    ledger = Ledger("car", tmp_path, own=False)
    for draw in (entry("1", misses=3), entry("2", runs=5000, rules="easy")):
        ledger.record(draw)
    assert pooled(ledger.entries(), "r", "fast") == (3, 3, 299)


@pytest.mark.parametrize("line", ["{}", "half", '{"date": 1}'])
def test_a_damaged_ledger_is_named(tmp_path, line):
    ledger = Ledger("car", tmp_path, own=False)
    ledger.record(entry("1"))
    path = tmp_path / "draws" / "car.jsonl"
    path.write_text(path.read_text() + line)
    with pytest.raises(FileError, match="not a ledger of draws"):
        ledger.entries()


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
        {"method": f"{name} {s}", "score": s, "seconds": factor * s ** (-1.0 / order)}
        for s in scores
    ]


@given(st.floats(0.011, 0.99))
def test_a_power_law_is_interpolated_exactly(error):
    rows = ladder("a", 3.0, [1.0, 0.1, 0.01])
    # A row that is slower and less accurate than another is no part of the curve.
    rows.append({"method": "slip", "score": 0.5, "seconds": 50.0})
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


@pytest.mark.parametrize("name", data_names("protocols"))
def test_the_ledger_of_the_package_can_be_read(name, tmp_path):
    for draw in Ledger(name, tmp_path, own=True).entries():
        assert len(draw.digest) == len(draw.rules) == 64
        assert draw.model == name


@pytest.mark.parametrize("name", sorted(data_names("protocols")))
def test_rules_that_are_called_the_same_differ_by_a_null_key_alone(name):
    own = load_protocol(name)
    content = own.definition.model_dump(include={"sensitive", "drawn", "drawn_outside"})
    content["bounds"] = {o: [b.measure, b.bound] for o, b in own.definition.bounds.items()}
    for draw in (content["drawn"], content["drawn_outside"]):
        for box in draw["boxes"] if draw else ():
            box["cars"] = None
    text = json.dumps([content, parameters_of(own.model)], sort_keys=True)
    before = hashlib.sha256(text.encode()).hexdigest()
    assert same_rules().get(before, rules(own)) == rules(own)
