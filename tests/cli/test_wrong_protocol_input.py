"""Protocols that are none: one clear line, exit status 2."""

import json

import pytest

PROTOCOL = """
title = "for the tests"
model = "double_wishbone"
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", points = [[1.3, 1.0]] }]
test = [{ maneuver = "sine_travel", points = [[0.9, 1.0]] }]
bounds = { spindle_y = { measure = "rms", bound = 1e-4 } }
contestants = [{ label = "newton", method = "full_order", role = "full order" }]
"""
WRONG = [
    ("points = [[0.9, 1.0]]", "points = [[1.0, 1.2]]", ["test", "a 1.2", "is in training too"]),
    ("points = [[0.9, 1.0]]", "points = [[1.3, 1.0]]", ["test", "f 1.3", "is in validation too"]),
    ("points = [[0.9, 1.0]]", "points = []", ["test, group 1: points is empty"]),
    ('"for the tests"', '""', ["title: '' is not a line of text"]),
    ('label = "newton"', 'label = "a\\nb"', [r"label: 'a\nb' is not a line of text"]),
    ("points = [[0.9, 1.0]]", "points = [[0.9]]", ["a point is [frequency, amplitude]"]),
    ("points = [[0.9, 1.0]]", "points = [[0.9, 1.0, 20.0]]", ["has no initial_speed"]),
    ("points = [[0.9, 1.0]]", "points = [[-0.9, 1.0]]", ["test, group 1", "not positive"]),
    ("points = [[0.9, 1.0]]", 'start = ["droped"]', ["unknown start 'droped'"]),
    ("points = [[0.9, 1.0]]", "points = [[1.0, 1.0]], speed = [1.0]", ["points or lists"]),
    ('"double_wishbone"', '"double_wishbon"', ["unknown model", "double_wishbone"]),
    (
        'test = [{ maneuver = "sine_travel"',
        'test = [{ maneuver = "lane_change"',
        ["delta", "z, s0"],
    ),
    ('test = [{ maneuver = "sine_travel"', 'test = [{ maneuver = "sine"', ["unknown maneuver"]),
    ("spindle_y", "spindl_y", ["unknown output", "spindle_y"]),
    ('"rms"', '"mean"', ["bounds.spindle_y.measure"]),
    ("bound = 1e-4", "bound = 0.0", ["bounds.spindle_y.bound"]),
    ('"full_order"', '"full_ordr"', ["unknown method", "full_order"]),
    ('"full order"', '"umpire"', ["contestants.0.role"]),
    ('role = "full order"', "candidates = [{ rank = 3 }]", ["unknown setting of full_order"]),
    ('role = "full order"', 'candidates = [{ preset = "best" }]', ["unknown preset"]),
    ('role = "full order"', "candidates = [{}, {}]", ["newton", "the same candidate twice"]),
    ('role = "full order"', "candidates = []", ["contestants.0.candidates"]),
    ('role = "full order"', 'train_on = ["lane_change"]', ["training of", "sine_travel"]),
    (
        "title",
        'targets = [{ against = "me", ratio = 2.0 }]\ntitle',
        ["row that a target is against"],
    ),
    ("title", "rounds = 3\ntitle", ["rounds"]),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_a_protocol_that_cant_be(fails, tmp_path, old, new, words):
    assert old in PROTOCOL
    path = tmp_path / "wrong.toml"
    path.write_text(PROTOCOL.replace(old, new, 1))
    study = tmp_path / "study.toml"
    study.write_text(f'title = "mine"\nprotocols = {json.dumps([str(path)])}\n')
    fails(["run", study, "--out", tmp_path / "out"], "wrong.toml", *words)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('protocols = ["double_wishbon"]', ["unknown protocol", "double_wishbone"]),
        ('protocols = ["absent.toml"]', ["absent.toml", "no such file"]),
        ('protocols = ["double_wishbone"]\nmodel = "double_wishbone"', ["nothing else"]),
    ],
)
def test_a_study_of_protocols_that_cant_be(fails, tmp_path, line, words):
    study = tmp_path / "study.toml"
    study.write_text(f'title = "mine"\n{line}\n')
    fails(["run", study, "--out", tmp_path / "out"], *words)


def test_an_unknown_comparison(fails, tmp_path):
    fails(["compare", "predictiv", "--out", tmp_path], "unknown comparison", "predictive")
