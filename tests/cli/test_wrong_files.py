"""Studies and protocols that are none: one line that names the file, exit status 2."""

import json

import pytest

STUDY = """
title = "for the tests"
model = "double_wishbone"
[grid]
rank = [3]
[[methods]]
method = "pod"
"""
PROTOCOL = """
title = "for the tests"
model = "double_wishbone"
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", points = [[1.3, 1.0]] }]
test = [{ maneuver = "sine_travel", points = [[0.9, 1.0]] }]
bounds = { spindle_y = { measure = "rms", bound = 1e-4 } }
contestants = [{ label = "newton", method = "full_order", role = "full order" }]
"""
# Part of the file -> what stands in its place, and what the line must say.
STUDIES = {
    "rank = [3]": [
        ("rank = []", "rank"),
        ("rank = 3", "grid.rank"),
        ("rank = [3, 3]", "same value twice"),
        ("rank = [12]", "rank 12"),
        ("rang = [3]", "unknown grid dimension"),
        ("amplitude_factor = [inf]", "amplitude"),
        ("frequency_factor = [-1.0]", "frequency"),
        ("rank = {first = 1.0, last = 2.0, count = 1000000000}", "count"),
        ("rank = {first = 1.0, last = 2.0, count = 0}", "count"),
        ("rank = {first = 2.0, last = 2.0, count = 3}", "same value twice"),
        ("rank = {first = 1.0, last = inf, count = 3}", "grid.rank.span.last"),
        ("rank = {first = 1.0, count = 3}", "grid.rank.span.last"),
    ],
    'method = "pod"': [
        ('methode = "pod"', "methods.0"),
        ('method = "dmd"', "unknown method"),
        ('method = "pod"\n[[methods]]\nmethod = "pod"', "used twice"),
        ('method = "pod"\nsettings = {rank = 2}', "rank is set twice"),
    ],
    'title = "for the tests"': [
        ("", "title"),
        ("x = " + 2000 * "[" + 2000 * "]", "nested too deeply"),
        ("x = " + 5000 * "9", "not a valid TOML file"),
    ],
    'model = "double_wishbone"': [
        ("model = 3", "model"),
        ('model = "double_wishbone"\nmaneuver = "lane_change"', "gives inputs delta"),
    ],
    "[grid]": [
        ('training = "set"\n[grid]', "training_set"),
        ("keep = 'all'\n[grid]", "keep"),
        ("[grid", "not a valid TOML file"),
    ],
    STUDY: [
        ('title = "mine"\nprotocols = ["double_wishbon"]', "unknown protocol"),
        ('title = "mine"\nprotocols = ["absent.toml"]', "absent.toml"),
        ('title = "x"\nmodel = "x"\nprotocols = ["double_wishbone"]', "nothing else"),
    ],
}
PROTOCOLS = {
    "points = [[0.9, 1.0]]": [
        ("points = [[1.0, 1.2]]", "is in training too"),
        ("points = [[1.3, 1.0]]", "is in validation too"),
        ("points = []", "points is empty"),
        ("points = [[0.9]]", "a point is [frequency, amplitude]"),
        ("points = [[0.9, 1.0, 20.0]]", "has no initial_speed"),
        ("points = [[-0.9, 1.0]]", "test, group 1"),
        ('start = ["droped"]', "unknown start 'droped'"),
        ("points = [[1.0, 1.0]], speed = [1.0]", "points or lists"),
    ],
    'test = [{ maneuver = "sine_travel"': [
        ('test = [{ maneuver = "lane_change"', "delta"),
        ('test = [{ maneuver = "sine"', "unknown maneuver"),
    ],
    'role = "full order"': [
        ('role = "umpire"', "contestants.0.role"),
        ("candidates = [{ rank = 3 }]", "unknown setting of full_order"),
        ('candidates = [{ preset = "best" }]', "unknown preset"),
        ("candidates = [{}, {}]", "the same candidate twice"),
        ("candidates = []", "contestants.0.candidates"),
        ('train_on = ["lane_change"]', "training of"),
    ],
    "title =": [
        ('targets = [{ against = "me", ratio = 2.0 }]\ntitle =', "target is against"),
        ("rounds = 3\ntitle =", "rounds"),
    ],
    '"for the tests"': [('""', "title: ''")],
    'label = "newton"': [('label = "a\\nb"', r"label: 'a\nb'")],
    '"double_wishbone"': [('"double_wishbon"', "unknown model")],
    "spindle_y": [("spindl_y", "unknown output")],
    '"rms"': [('"mean"', "bounds.spindle_y.measure")],
    "bound = 1e-4": [("bound = 0.0", "bounds.spindle_y.bound")],
    '"full_order"': [('"full_ordr"', "unknown method")],
}


def rows(table):
    return [(old, *row) for old, found in table.items() for row in found]


@pytest.mark.parametrize(("old", "new", "word"), rows(STUDIES))
def test_a_study_that_cant_be(fails, tmp_path, old, new, word):
    assert old in STUDY
    path = tmp_path / "mine.toml"
    path.write_text(STUDY.replace(old, new))
    fails(["run", path, "--out", tmp_path / "results"], word)
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(("old", "new", "word"), rows(PROTOCOLS))
def test_a_protocol_that_cant_be(fails, tmp_path, old, new, word):
    assert old in PROTOCOL
    path, study = tmp_path / "wrong.toml", tmp_path / "study.toml"
    path.write_text(PROTOCOL.replace(old, new, 1))
    study.write_text(f'title = "mine"\nprotocols = {json.dumps([str(path)])}\n')
    fails(["run", study, "--out", tmp_path / "out"], "wrong.toml", word)
