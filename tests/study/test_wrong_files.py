"""Study files that can't be: one line that names what is wrong, and nothing is written."""

import pytest

import vehiclemor as vm

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
methods = [{ label = "newton", method = "full_order", role = "full order" }]
"""
# Part of the file -> what stands in its place, and what the line must say.
STUDIES = {
    "rank = [3]": [
        ("rank = 3", "grid.rank"),
        ("rank = [3, 3]", "same value twice"),
        ("rank = [12]", "rank 12"),
        ("rang = [3]", "unknown grid dimension"),
        ("amplitude_factor = [inf]", "amplitude"),
        ("frequency_factor = [-1.0]", "frequency"),
        ("rank = {first = 1.0, last = 2.0, count = 1000000000}", "count"),
        ("rank = {first = 1.0, last = inf, count = 3}", "grid.rank.span.last"),
    ],
    'method = "pod"': [
        ('methode = "pod"', "methods.0"),
        ('method = "dmd"', "unknown method"),
        ('method = "pod"\n[[methods]]\nmethod = "pod"', "used twice"),
        ('method = "pod"\nsettings = {rank = 2}', "rank is set twice"),
    ],
    'title = "for the tests"': [
        ("x = " + 2000 * "[" + 2000 * "]", "nested too deeply"),
        ("x = " + 5000 * "9", "not a valid TOML file"),
    ],
    'model = "double_wishbone"': [
        ('model = "double_wishbone"\nmaneuver = "lane_change"', "gives inputs delta"),
    ],
    "[grid]": [('training = "set"\n[grid]', "training_set"), ("keep = 'all'\n[grid]", "keep")],
    STUDY: [
        ('title = "mine"\nstudies = ["double_wishbon"]', "unknown study"),
        ('title = "mine"\nstudies = ["absent.toml"]', "absent.toml"),
        ('title = "x"\nmodel = "x"\nstudies = ["double_wishbone"]', "nothing else"),
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
    ],
    'role = "full order"': [
        ("candidates = [{ rank = 3 }]", "unknown setting of full_order"),
        ('candidates = [{ preset = "best" }]', "unknown preset"),
        ("candidates = [{}, {}]", "the same candidate twice"),
        ('training = ["lane_change"]', "training of"),
    ],
    "title =": [
        ('targets = [{ against = "me", ratio = 2.0 }]\ntitle =', "target is against"),
        ("rounds = 3\ntitle =", "rounds"),
        ('keep = "metrics"\ntitle =', "keep"),
    ],
    '"for the tests"': [('""', "title: ''")],
    'label = "newton"': [('label = "a\\nb"', r"label: 'a\nb'")],
    '"double_wishbone"': [('"double_wishbon"', "unknown model")],
    "spindle_y": [("spindl_y", "unknown output")],
    "bound = 1e-4": [("bound = 0.0", "bounds.spindle_y.bound")],
    '"full_order"': [('"full_ordr"', "unknown method")],
}
FILES = [
    (text, old, *row)
    for text, table in ((STUDY, STUDIES), (PROTOCOL, PROTOCOLS))
    for old, found in table.items()
    for row in found
]


@pytest.mark.parametrize(("text", "old", "new", "word"), FILES)
def test_a_study_that_cant_be(tmp_path, text, old, new, word):
    assert old in text
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(vm.VehiclemorError) as error:
        vm.run_study(path, results=tmp_path / "results")
    assert word in str(error.value)
    assert not (tmp_path / "results").exists()
